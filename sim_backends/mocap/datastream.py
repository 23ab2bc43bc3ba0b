"""Vicon DataStream as its server speaks it, written from the wire format alone (nothing here knows the decoder).

`DataStreamEncoder` makes a frame's packet, `DataStreamSession` does what a client wishes: which blocks, all frames or
one at a time. A segment at the main marker, not turned, stands for the subject: this server knows no rotations.
"""

import struct
from collections.abc import Sequence

from sim_backends.mocap.encoders import Positions

_MAGIC = 0x1A2B0001
_STREAM, _SUBJECT, _FRAME, _LABELLED, _UNLABELLED, _SEGMENTS, _LATENCY = 1, 2, 5, 6, 7, 9, 26
_ENUMS, _REQUEST, _CONTENTS = 100001, 100002, 100004
OFFERED = (_STREAM, _SUBJECT, _FRAME, _LABELLED, _UNLABELLED, _SEGMENTS, _LATENCY, _CONTENTS)
_TICKS = 135e6
"""ticks a second of the master clock"""
_UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_STAGES = (("Data Collected", 0.7), ("Circle Fitting", 0.1), ("Labelling", 0.2))
"""where the latency is said to come from, and which part of it"""


class DataStreamEncoder:
    """One subject with named markers. Markers that no camera sees are absent."""

    is_stream = True

    def __init__(
        self,
        names: Sequence[str],
        *,
        subject: str = "platform",
        rate: float = 100.0,
        latency: float = 0.004,
        strays: Positions = (),
    ) -> None:
        """rate in Hz; latency in s as the server states it; strays: unlabelled markers that stand somewhere, m."""
        segment = _u32(0xFFFFFFFF, 0) + struct.pack("<6f", *([0.0] * 6)) + _text(subject)
        markers = b"".join(_u32(number) + _text(name) for number, name in enumerate(names))
        attachments = b"".join(_u32(number, 0) for number in range(len(names)))
        count = _u32(len(names))
        info = _u32(0) + _text(subject) + _u32(1) + segment + count + markers + count + attachments
        stages = _u32(len(_STAGES)) + b"".join(_text(name) + struct.pack("<d", p * latency) for name, p in _STAGES)
        contents = _u32(0) + _u32(0)
        self._static = (
            (_CONTENTS, contents),
            (_STREAM, struct.pack("<q", round(_TICKS / rate))),
            (_SUBJECT, info),
        )
        self._after = (_LATENCY, stages)
        recons = [struct.pack("<13dI", *_recon(place), n) for n, place in enumerate(strays) if place is not None]
        self._strays = (_UNLABELLED, _u32(len(recons)) + b"".join(recons))
        self._pose = (0.0, 0.0, 0.0)

    def encode(self, number: int, positions: Positions) -> bytes:
        """One packet with everything; a session takes out what its client did not ask for."""
        recons = [
            _u32(0, marker) + struct.pack("<13dI", *_recon(place), marker)
            for marker, place in enumerate(positions)
            if place is not None
        ]
        if positions and positions[0] is not None:
            self._pose = positions[0]
        segment = struct.pack("<I3d9d", 0, *[1e3 * value for value in self._pose], *_UPRIGHT)
        return _packet(
            *self._static,
            (_FRAME, _u32(number % 2**32)),
            (_LABELLED, _u32(len(recons)) + b"".join(recons)),
            self._strays,
            (_SEGMENTS, _u32(0) + _u32(1) + segment),
            self._after,
        )


class DataStreamSession:
    """One client of the server: it hears what is offered, wishes for some of it, and asks for frames."""

    def __init__(self) -> None:
        self._wished: frozenset[int] = frozenset(OFFERED)
        self._streaming = False
        self._requested = 0
        self._rest = b""

    def greeting(self) -> bytes:
        """What is offered."""
        return _packet((_ENUMS, _u32(len(OFFERED), *OFFERED)))

    def receive(self, data: bytes) -> bytes:
        """Nothing is ever answered; the wishes count from the next frame on."""
        self._rest += data
        while len(self._rest) >= 8:
            end = 8 + int.from_bytes(self._rest[4:8], "little")
            if len(self._rest) < end:
                break
            for kind, body in _blocks(self._rest[8:end]):
                self._heed(kind, body)
            self._rest = self._rest[end:]
        return b""

    def pass_on(self, packet: bytes) -> bytes:
        """The wished blocks of a frame; a piece that is no whole packet goes through as it is."""
        if not self._streaming and self._requested == 0:
            return b""
        self._requested = max(0, self._requested - 1)
        if len(packet) < 8 or int.from_bytes(packet[4:8], "little") != len(packet) - 8:
            return packet
        return _packet(*(block for block in _blocks(packet[8:]) if block[0] in self._wished))

    def _heed(self, kind: int, body: bytes) -> None:
        if kind == _ENUMS:
            self._wished = frozenset(struct.unpack(f"<{len(body) // 4}I", body)[1:])
        elif kind == _REQUEST:
            self._streaming = body[:1] == b"\x01"
            self._requested += not self._streaming


def _packet(*blocks: tuple[int, bytes]) -> bytes:
    body = b"".join(_u32(kind, len(data)) + data for kind, data in blocks)
    return _u32(_MAGIC, len(body)) + body


def _blocks(body: bytes) -> list[tuple[int, bytes]]:
    found: list[tuple[int, bytes]] = []
    at = 0
    while at + 8 <= len(body):
        kind, size = struct.unpack_from("<II", body, at)
        found.append((kind, body[at + 8 : at + 8 + size]))
        at += 8 + size
    return found


def _recon(place: tuple[float, float, float]) -> list[float]:
    """Radius, position in mm, covariance."""
    return [7.0, *(1e3 * value for value in place), *(1e-2 * value for value in _UPRIGHT)]


def _u32(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}I", *values)


def _text(value: str) -> bytes:
    data = value.encode()
    return _u32(len(data)) + data
