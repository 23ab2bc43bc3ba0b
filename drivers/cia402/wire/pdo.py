"""Process data objects (PDO): what is mapped where, the SDO writes that map it, and the decoder. Pure.

The layout is a value, compared with the drive's own mapping in entries and bits before anything is decoded, so that a
frame can then be taken apart with `struct` alone.
"""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from operator import itemgetter
from typing import cast

from fidim_lab.errors import OurBugError


class Mappable(Enum):
    """A mappable object: index, sub-index, struct code. Names are those of the profile."""

    CONTROLWORD = (0x6040, 0, "H")
    MODE = (0x6060, 0, "b")
    TARGET_POSITION = (0x607A, 0, "i")
    STATUSWORD = (0x6041, 0, "H")
    MODE_DISPLAY = (0x6061, 0, "b")
    POSITION = (0x6064, 0, "i")
    VELOCITY = (0x606C, 0, "i")
    TORQUE = (0x6077, 0, "h")
    CURRENT = (0x6078, 0, "h")
    FOLLOWING_ERROR = (0x60F4, 0, "i")

    @property
    def index(self) -> int:
        """Of the object; its sub-index is 0."""
        return self.value[0]

    @property
    def code(self) -> str:
        """struct code"""
        return self.value[2]

    @property
    def mapping(self) -> int:
        """The entry as objects 1600 and 1A00 hold it: index, sub-index, bits."""
        index, sub, code = self.value
        return index << 16 | sub << 8 | struct.calcsize(code) * 8


@dataclass(frozen=True)
class VendorEntry:
    """A mappable object that the profile does not name."""

    name: str
    index: int
    sub: int
    code: str

    @property
    def value(self) -> tuple[int, int, str]:
        """As of an `Mappable`."""
        return self.index, self.sub, self.code

    @property
    def mapping(self) -> int:
        """As of an `Mappable`."""
        return self.index << 16 | self.sub << 8 | struct.calcsize(self.code) * 8


@dataclass(frozen=True)
class PdoMap:
    """One PDO of a drive: receive (host to drive) or transmit (drive to host), numbered from 1."""

    number: int
    transmit: bool
    entries: tuple[Mappable | VendorEntry, ...]
    transmission: int
    """1: at every SYNC; 255: at once"""
    type_fixed: bool = False
    """the drive has this transmission type already, and does not let it be written"""
    mapping_fixed: bool = False
    """so are its entries; those that nobody asked for have no name"""
    cob_fixed: bool = False
    """so is its identifier"""

    @property
    def format(self) -> struct.Struct:
        """How its bytes are packed."""
        return struct.Struct("<" + "".join(e.code for e in self.entries))

    def carries(self, name: str) -> bool:
        """Whether one of its entries has this name."""
        return any(entry.name == name for entry in self.entries)

    def pack(self, values: Mapping[str, int]) -> bytes:
        """Its bytes, from values by the names of its entries; those without a name are 0."""
        return self.format.pack(*(values[e.name] if e.name else b"" for e in self.entries))

    def cob_id(self, node_id: int) -> int:
        """Frame identifier of the predefined connection set."""
        return (0x180 if self.transmit else 0x200) + 0x100 * (self.number - 1) + node_id

    @property
    def communication_index(self) -> int:
        """Object with COB-ID and transmission type."""
        return (0x1800 if self.transmit else 0x1400) + self.number - 1

    @property
    def mapping_index(self) -> int:
        """Object with the mapped entries."""
        return (0x1A00 if self.transmit else 0x1600) + self.number - 1


RPDO = PdoMap(
    1, transmit=False, entries=(Mappable.CONTROLWORD, Mappable.MODE, Mappable.TARGET_POSITION), transmission=255
)
"""Acted upon at once, so that a stop does not wait for the next SYNC."""

TARGET_RPDO = PdoMap(2, transmit=False, entries=(Mappable.TARGET_POSITION,), transmission=1)
"""Of cyclic position mode: all drives take their targets at the same SYNC; at once where its controlword has none."""

TPDOS = (
    PdoMap(1, transmit=True, entries=(Mappable.STATUSWORD, Mappable.POSITION, Mappable.MODE_DISPLAY), transmission=1),
    PdoMap(2, transmit=True, entries=(Mappable.VELOCITY, Mappable.CURRENT), transmission=1),
)
"""Sampled at every SYNC."""


COB_OFF = 1 << 31
NO_REMOTE = 1 << 30
COB_MASK = 0x7FF


@dataclass(frozen=True)
class ObjectValue:
    """A number in an object: to be written, or expected when read."""

    index: int
    sub: int
    value: int


def mapping_writes(pdo: PdoMap, node_id: int) -> tuple[ObjectValue, ...]:
    """The writes that map a PDO, in the order of the standard: off, empty, entries, count, type, on.

    What is fixed is not written.
    """
    off_flags = COB_OFF | (NO_REMOTE if pdo.transmit else 0)
    on_flags = NO_REMOTE if pdo.transmit else 0
    cob = pdo.cob_id(node_id)
    entries = [ObjectValue(pdo.mapping_index, n, e.mapping) for n, e in enumerate(pdo.entries, start=1)]
    count = ObjectValue(pdo.mapping_index, 0, 0)
    mapped = () if pdo.mapping_fixed else (count, *entries, replace(count, value=len(entries)))
    typed = () if pdo.type_fixed else (ObjectValue(pdo.communication_index, 2, pdo.transmission),)
    off, on = (ObjectValue(pdo.communication_index, 1, cob | flags) for flags in (off_flags, on_flags))
    return (*mapped, *typed) if pdo.cob_fixed else (off, *mapped, *typed, on)


def mapping_expected(pdo: PdoMap, node_id: int) -> tuple[ObjectValue, ...]:
    """The values to read back after `mapping_writes`; of a COB-ID only bit 31 and the identifier count."""
    entries = [ObjectValue(pdo.mapping_index, n, e.mapping) for n, e in enumerate(pdo.entries, start=1)]
    return (
        ObjectValue(pdo.mapping_index, 0, len(entries)),
        *entries,
        ObjectValue(pdo.communication_index, 2, pdo.transmission),
        ObjectValue(pdo.communication_index, 1, pdo.cob_id(node_id)),
    )


@dataclass(frozen=True, slots=True)
class DriveValues:
    """A drive's sample at one SYNC, in the drive's own units."""

    t: float
    """monotonic s of the SYNC"""
    statusword: int
    position: int
    """counts"""
    mode: int
    velocity: float
    """digits of 606C; by the change of the position where no TPDO carries it"""
    current: float
    """per mille of rated current, of rated torque, or digits of a vendor object; NaN where the drive tells no load"""

    @property
    def told(self) -> tuple[float, ...]:
        """All that the drive has told."""
        return self.statusword, self.position, self.mode, self.velocity, self.current


_Numbers = tuple[float, ...]


_SAMPLED = (Mappable.STATUSWORD, Mappable.POSITION)
_TOLD = (*(entry.name for entry in (*_SAMPLED, Mappable.VELOCITY)), Mappable.MODE_DISPLAY.name)
"""what else a TPDO carries is the load"""
_values = cast(Callable[..., DriveValues], DriveValues)


class _Differences:
    """Velocity by the change of a position of 32 bits."""

    def __init__(self, place: int, digit: float) -> None:
        self._place, self._digit = place, digit
        self._last: tuple[float, float] | None = None

    def __call__(self, t: float, numbers: _Numbers) -> tuple[float]:
        position = numbers[self._place]
        before, was = self._last or (t, position)
        self._last = t, position
        way = (position - was + (1 << 31)) % (1 << 32) - (1 << 31)
        return (way / (t - before) / self._digit if t > before else 0.0,)


class SampleDecoder:
    """Puts the TPDOs of one SYNC together into one `DriveValues`; an incomplete set gives none.

    A velocity that no TPDO carries is the change of the position since the sample before. Not thread-safe: one thread
    feeds it.
    """

    def __init__(self, tpdos: tuple[PdoMap, ...] = TPDOS, velocity_digit: float = 1.0) -> None:
        """velocity_digit: counts/s of one digit. Raises OurBugError for a layout without statusword or position."""
        order = [entry.name for pdo in tpdos for entry in pdo.entries]
        if missing := [entry.name for entry in _SAMPLED if entry.name not in order]:
            raise OurBugError(f"The TPDO layout leaves out {', '.join(missing)}.")
        load = next((n for n, name in enumerate(order) if name and name not in _TOLD), len(order) + 1)
        entries = [entry for pdo in tpdos for entry in pdo.entries]
        self.load = entries[load] if load < len(entries) else None
        """what tells the load"""
        mode = order.index(Mappable.MODE_DISPLAY.name) if Mappable.MODE_DISPLAY.name in order else len(order)
        state, place = (order.index(entry.name) for entry in _SAMPLED)
        self._differences = None if Mappable.VELOCITY.name in order else _Differences(place, velocity_digit)
        speed = len(order) + 2 if self._differences else order.index(Mappable.VELOCITY.name)
        self.displayed = 0
        """the mode (6061) where no TPDO carries it: as it was read last"""
        self._formats = tuple(pdo.format for pdo in tpdos)
        self._pick = cast(Callable[[_Numbers], _Numbers], itemgetter(state, place, mode, speed, load))
        self._parts: list[_Numbers | None] = [None] * len(tpdos)
        self._t = float("nan")
        self.received = 0
        self.incomplete = 0
        """SYNCs of which only some of the TPDOs arrived"""
        self.doubled = 0
        """a TPDO that came again within one SYNC: doubled, or the one before was late by a whole cycle"""
        self.contradicted = 0
        """of these, how many had other contents than the first"""
        self.malformed = 0

    def feed(self, part: int, data: bytes, t: float) -> DriveValues | None:
        """TPDO number `part` (from 0) of the SYNC at `t`; the whole sample once the last of its TPDOs is there."""
        form = self._formats[part]
        if len(data) != form.size:
            self.malformed += 1
            return None
        parts = self._parts
        if t != self._t:
            self._start(t)
        numbers = form.unpack(data)
        if parts[part] is not None:
            self.doubled += 1  # if the first was late by a cycle, the newer one is the right one: it replaces it
            self.contradicted += numbers != parts[part]
        parts[part] = numbers
        merged: _Numbers = ()
        for have in parts:
            if have is None:
                return None
            merged += have
        self.received += 1
        found = self._differences
        return _values(
            t, *self._pick((*merged, self.displayed, math.nan, *(() if found is None else found(t, merged))))
        )

    def _start(self, t: float) -> None:
        present = sum(part is not None for part in self._parts)
        if 0 < present < len(self._parts):
            self.incomplete += 1
        self._parts[:] = [None] * len(self._parts)
        self._t = t
