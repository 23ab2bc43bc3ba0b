r"""Motion-capture packets as a device sends them, written from the formats alone (nothing here knows the decoders).

`ViconEncoder`: Tracker's UDP object stream, one object for each marker; `ViconSubjectEncoder`: one body that carries
them. `TextEncoder`: lines `frame,x,y,z…*hh\n`.
`OscEncoder`: OSC bundles. Vicon's DataStream has its own module.
"""

import math
import struct
from collections.abc import Sequence
from enum import StrEnum
from typing import Protocol

import numpy as np

Positions = Sequence[tuple[float, float, float] | None]
"""m, main marker first; None where occluded"""

_BLOCK_SIZES = (256, 512, 1024)
_ITEM = np.dtype(
    [("id", "u1"), ("size", "<u2"), ("name", "S24"), ("translation", "<f8", (3,)), ("rotation", "<f8", (3,))]
)
"""packed: 75 bytes"""
_TRANSLATION = 27
_ROTATION = math.radians(0.1)
_TELL_A_POSE = 3
"""points, not in a line"""


class Encoder(Protocol):
    """Makes the packet of one frame."""

    @property
    def is_stream(self) -> bool:
        """Whether packets may be cut and joined anywhere on the way (TCP); datagrams are cut only by damage."""
        ...

    def encode(self, number: int, positions: Positions) -> bytes:
        """The bytes of one frame; positions in m."""
        ...


class Occluded(StrEnum):
    """What the object stream carries for an object that no camera sees (the vendor does not say)."""

    ABSENT = "absent"
    ZEROS = "zeros"
    LAST_POSE = "last pose"


class ViconEncoder:
    """Object stream with one object for each marker, all with the same small rotation: a marker has none."""

    is_stream = False

    def __init__(self, names: Sequence[str], *, occluded: Occluded = Occluded.ABSENT) -> None:
        """At most 13 names of at most 23 bytes."""
        items = np.zeros(len(names), _ITEM)
        items["size"] = _ITEM.itemsize - 3
        items["name"] = [name.encode()[:23] for name in names]
        # Only the translations change from frame to frame: all else is made once.
        self._heads = [item.tobytes()[:_TRANSLATION] for item in items]
        self._rotation = np.full(3, _ROTATION, "<f8").tobytes()
        self._poses = [bytes(_ITEM.itemsize - _TRANSLATION)] * len(names)
        self._occluded = occluded

    def turn(self, angles: tuple[float, float, float]) -> None:
        """The rotation that objects are sent with from now on: rad about x, then the new y, then the new z."""
        self._rotation = struct.pack("<3d", *angles)

    def encode(self, number: int, positions: Positions) -> bytes:
        """One datagram, padded to 256, 512 or 1024 bytes."""
        items: list[bytes] = []
        for index, position in enumerate(positions):
            if position is not None:
                x, y, z = position
                self._poses[index] = struct.pack("<3d", 1000.0 * x, 1000.0 * y, 1000.0 * z) + self._rotation
            elif self._occluded is Occluded.ABSENT:
                continue
            elif self._occluded is Occluded.ZEROS:
                self._poses[index] = bytes(len(self._poses[index]))
            items.append(self._heads[index] + self._poses[index])
        packet = (number % 2**32).to_bytes(4, "little") + bytes([len(items)]) + b"".join(items)
        return packet.ljust(next(size for size in _BLOCK_SIZES if size >= len(packet)), b"\0")


class ViconSubjectEncoder:
    """Object stream with one tracked body: its pose, from points fixed in it as the cameras see them."""

    is_stream = False

    def __init__(self, subject: str, points: Sequence[Sequence[float]]) -> None:
        """points: (M, 3) in the body's frame, m, three of them not in a line; of at most 23 bytes: the name."""
        self._points = np.array(points, dtype=float)
        self._encoder = ViconEncoder((subject,))

    def encode(self, number: int, positions: Positions) -> bytes:
        """One datagram; a body of which fewer than three points are seen is not tracked."""
        seen = [k for k, position in enumerate(positions) if position is not None]
        if len(seen) < _TELL_A_POSE:
            return self._encoder.encode(number, (None,))
        found = np.array([position for position in positions if position is not None])
        place, rotation = _pose(self._points[seen], found)
        self._encoder.turn(_euler(rotation))
        return self._encoder.encode(number, (place,))


class TextEncoder:
    """Marker lines in metres, blank where occluded, with a checksum unless told otherwise."""

    is_stream = True

    def __init__(self, *, checksum: bool = True, digits: int = 7) -> None:
        """`digits` after the point; 7 keeps 0.1 µm."""
        self._checksum = checksum
        self._marker = ",%%.%df,%%.%df,%%.%df" % (digits, digits, digits)  # noqa: UP031 - makes a format

    def encode(self, number: int, positions: Positions) -> bytes:
        """One line."""
        fields = [",,," if position is None else self._marker % position for position in positions]
        body = (str(number) + "".join(fields)).encode("ascii")
        if not self._checksum:
            return body + b"\n"
        total = 0
        for byte in body:
            total ^= byte
        return b"%s*%02X\n" % (body, total)


class OscEncoder:
    """One OSC bundle for each frame: its number, and a message for each marker that is seen."""

    is_stream = False

    def __init__(self, addresses: Sequence[str], *, frame_address: str = "/frame", unit: float = 1.0) -> None:
        """An address for each marker; unit: m for one unit on the wire."""
        self._unit = unit
        self._heads = [_osc_text(address) + _osc_text(",ddd") for address in addresses]
        self._frame = _osc_text(frame_address) + _osc_text(",h")

    def encode(self, number: int, positions: Positions) -> bytes:
        """One datagram; positions in m."""
        messages = [self._frame + struct.pack(">q", number)]
        for head, position in zip(self._heads, positions, strict=True):
            if position is not None:
                messages.append(head + struct.pack(">3d", *[value / self._unit for value in position]))
        now = b"\0\0\0\0\0\0\0\1"
        elements = b"".join(struct.pack(">i", len(message)) + message for message in messages)
        return b"#bundle\0" + now + elements


def _osc_text(text: str) -> bytes:
    data = text.encode("ascii") + b"\0"
    return data.ljust(-(-len(data) // 4) * 4, b"\0")


class TurnedEncoder:
    """Another encoder's packets in a frame whose y axis points up: (x, y, z) is sent as (x, z, −y)."""

    def __init__(self, encoder: Encoder) -> None:
        self._encoder = encoder
        self.is_stream = encoder.is_stream

    def encode(self, number: int, positions: Positions) -> bytes:
        """The bytes of one frame; positions in m, z up."""
        return self._encoder.encode(number, [None if p is None else (p[0], p[2], -p[1]) for p in positions])


def _pose(points: np.ndarray, seen: np.ndarray) -> tuple[tuple[float, float, float], np.ndarray]:
    """Place and rotation matrix that carry points (M, 3) nearest to where they are seen (Kabsch 1976)."""
    middle, where = points.mean(axis=0), seen.mean(axis=0)
    left, _, right = np.linalg.svd((points - middle).T @ (seen - where))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = (left @ mirror @ right).T
    x, y, z = (where - rotation @ middle).tolist()
    return (x, y, z), rotation


def _euler(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of Rx Ry Rz, rad."""
    return (
        math.atan2(-rotation[1, 2], rotation[2, 2]),
        math.asin(min(max(float(rotation[0, 2]), -1.0), 1.0)),
        math.atan2(-rotation[0, 1], rotation[0, 0]),
    )
