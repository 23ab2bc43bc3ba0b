"""Vicon Tracker's UDP object stream (port 51001): one datagram is one frame of object poses.

Little endian, packed; offsets as several public parsers agree on them (Vicon publishes no byte table):

    0   u32  frame number
    4   u8   items in this block
    5   item, then the next one at + 3 + itemDataSize
        +0  u8   item id, 0 = object (others are skipped)
        +1  u16  itemDataSize, 72 for an object
        +3  c24  name, NUL padded
        +27 f64  tx ty tz, mm
        +51 f64  rx ry rz, rad
    …   padding up to 256, 512 or 1024 bytes

The stream carries objects, not markers, no time and no validity flag. So a marker is either an object of its own
(`MarkerObjects`: give each its own one-marker or small object in Tracker) or a point fixed in a tracked subject
(`SubjectPoints`). An object is taken as occluded when it is not in the block, is at the origin to the last bit, or its
pose is not finite. Two of one name in two places (two Trackers at one port) are damage.
One that keeps its last pose cannot be told from one that stands still; see the `repeated` counter of the source.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.mocap.decoders.decoder import DecodedFrame, Event, Malformed, Position, is_place, plausible

OBJECT = 0
OBJECT_SIZE = 72

_HEADER = struct.Struct("<IB")
_ITEM = struct.Struct("<BH")
_POSE = struct.Struct("<24s6d")
_METRE = 1e-3
_NAMES_REMEMBERED = 32


@dataclass(frozen=True, slots=True)
class ViconObject:
    """The pose of one object."""

    name: str
    translation: Position
    """m"""
    rotation: tuple[float, float, float]
    """Euler angles x, y, z, rad"""

    @property
    def tracked(self) -> bool:
        """Whether this is a pose at all: finite, and not the zeros that stand for an occluded object."""
        return is_place(self.translation) and all(map(math.isfinite, (*self.translation, *self.rotation)))


@dataclass(frozen=True, slots=True)
class ViconBlock:
    """One datagram."""

    number: int
    objects: tuple[ViconObject, ...]


def parse_block(data: bytes) -> ViconBlock | Malformed:
    """The objects of one datagram (lengths in m, angles in rad), or why it is none."""
    size = len(data)
    if size < _HEADER.size:
        return Malformed(f"{size} bytes; a block has at least {_HEADER.size}")
    number, items = _HEADER.unpack_from(data)
    at = _HEADER.size
    objects: list[ViconObject] = []
    for index in range(items):
        if at + _ITEM.size > size:
            return Malformed(f"frame {number}: cut off at byte {size}, before item {index + 1} of {items}")
        item_id, item_size = _ITEM.unpack_from(data, at)
        at += _ITEM.size
        if at + item_size > size:
            return Malformed(f"frame {number}: cut off at byte {size}, in item {index + 1} of {items}")
        if item_id == OBJECT:
            if item_size < OBJECT_SIZE:
                return Malformed(f"frame {number}: item {index + 1} has {item_size} bytes; an object has {OBJECT_SIZE}")
            name, tx, ty, tz, rx, ry, rz = _POSE.unpack_from(data, at)
            text = name.partition(b"\0")[0].decode("utf-8", "replace")
            objects.append(ViconObject(text, (tx * _METRE, ty * _METRE, tz * _METRE), (rx, ry, rz)))
        at += item_size
    return ViconBlock(number, tuple(objects))


class MarkerLayout(Protocol):
    """Which points of which objects are the markers, main marker first."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects needed."""
        ...

    def markers(self, poses: dict[str, ViconObject]) -> tuple[Position | None, ...]:
        """Marker positions (m) from the poses of tracked objects by name; None where the object is not tracked."""
        ...


@dataclass(frozen=True)
class MarkerObjects:
    """Each marker is an object of its own: its translation is the marker's position."""

    objects: tuple[str, ...]

    def markers(self, poses: dict[str, ViconObject]) -> tuple[Position | None, ...]:
        """The translations (m) of the objects, in the order of `objects`."""
        return tuple([poses[name].translation if name in poses else None for name in self.objects])


@dataclass(frozen=True)
class SubjectPoints:
    """All markers are points fixed in one tracked subject: p + R m.

    R = Rx Ry Rz (about x, then the new y, then the new z) is an assumption: the sources say "Euler XYZ" and no more.
    Check it once by turning the subject by hand about two axes, or use `MarkerObjects`, which need no rotation.
    """

    subject: str
    points: tuple[Position, ...]
    """(M, 3) in the subject's frame, m, main marker first"""

    @property
    def objects(self) -> tuple[str, ...]:
        """The subject alone."""
        return (self.subject,)

    def markers(self, poses: dict[str, ViconObject]) -> tuple[Position | None, ...]:
        """The points carried by the subject's pose (m); all None while the subject is not tracked."""
        if (pose := poses.get(self.subject)) is None:
            return (None,) * len(self.points)
        rows = euler_xyz(*pose.rotation)
        px, py, pz = pose.translation
        return tuple([(px + _dot(rows[0], m), py + _dot(rows[1], m), pz + _dot(rows[2], m)) for m in self.points])


def euler_xyz(rx: float, ry: float, rz: float) -> tuple[Position, Position, Position]:
    """Rows of Rx(rx) Ry(ry) Rz(rz), angles in rad."""
    cx, sx, cy, sy, cz, sz = math.cos(rx), math.sin(rx), math.cos(ry), math.sin(ry), math.cos(rz), math.sin(rz)
    return (
        (cy * cz, -cy * sz, sy),
        (cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy),
        (sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy),
    )


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class ViconUdpDecoder:
    """Decoder of the object stream for a given layout of markers."""

    modulus = 1 << 32

    def __init__(self, layout: MarkerLayout) -> None:
        self.layout = layout
        """which points of which objects are the markers"""
        self._wanted = frozenset(layout.objects)
        self._seen: set[str] = set()

    def receive(self, data: bytes) -> list[Event]:
        """One event for one datagram."""
        block = parse_block(data)
        if isinstance(block, Malformed):
            return [block]
        poses: dict[str, ViconObject] = {}
        for item in block.objects:
            if item.name not in self._seen:
                self._remember(item.name)
            if item.name in self._wanted and item.tracked:
                if not plausible(item.translation):
                    return [Malformed(f"frame {block.number}: '{item.name}' is more than a kilometre away")]
                if poses.setdefault(item.name, item) != item:
                    return [Malformed(f"frame {block.number}: '{item.name}' occurs twice: two senders, or names?")]
        return [DecodedFrame(block.number, self.layout.markers(poses))]

    def restart(self) -> None:
        """Nothing to forget: a datagram is whole or malformed."""

    def advice(self) -> str:
        """Names the objects that are wanted but were never in the stream, beside those that were."""
        missing = sorted(self._wanted - self._seen)
        if not missing:
            return "The objects are in the stream, but not tracked: look for occluded or missing markers in Tracker."
        carried = ", ".join(f"'{name}'" for name in sorted(self._seen)) or "no object at all"
        absent = ", ".join(f"'{name}'" for name in missing)
        return f"The stream carries {carried}, not {absent}: is that its name in Tracker, and is it tracked?"

    def _remember(self, name: str) -> None:
        # Bounded: damaged datagrams could carry ever new names.
        if len(self._seen) < _NAMES_REMEMBERED or name in self._wanted:
            self._seen.add(name)
