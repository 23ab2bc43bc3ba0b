"""The load of a CAN bus: worst-case frame lengths with stuff bits. Pure; refuses a rig before it starts."""

_OVERHEAD_BITS = 44
_STUFFED_OVERHEAD_BITS = 34
_GAP_BITS = 3

MAX_LOAD = 0.8
"""Above this share of the bus a burst of emergency or SDO frames makes cyclic frames late."""


def frame_bits(data_bytes: int) -> int:
    """Bits of a classic frame with 11-bit identifier at worst-case stuffing, interframe gap included (8 bytes: 135)."""
    plain = _OVERHEAD_BITS + 8 * data_bytes
    stuff = (_STUFFED_OVERHEAD_BITS + 8 * data_bytes - 1) // 4
    return plain + stuff + _GAP_BITS


def bus_load(frames_per_second: dict[int, float], bitrate: float) -> float:
    """Share of the bus taken by `frames_per_second`, which maps data bytes to frames a second."""
    return sum(frame_bits(size) * rate for size, rate in frames_per_second.items()) / bitrate
