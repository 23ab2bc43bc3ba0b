"""What one drive can do: dictionary and family as one frozen value, for bring-up, moves and modes. Pure.

No part of this program asks for a maker: it asks whether an object is there, may be written, may be mapped.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from itertools import takewhile

from canopen.objectdictionary import ObjectDictionary, ODVariable

from drivers.cia402.dictionary.config import Load, WinchConfig
from drivers.cia402.dictionary.family import DriveFamily
from drivers.cia402.dictionary.settings import Setting
from drivers.cia402.profile.words import Mode
from drivers.cia402.wire.pdo import RPDO, TARGET_RPDO, TPDOS, Mappable, PdoMap, VendorEntry
from drivers.cia402.wire.sdo import told_by_file

_CODES = {1: "?", 2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I"}
"""CiA 301 data types that a PDO of ours carries"""
_SIZE = {"?": 1, "b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}
_LIMITS = ((0x607D, 1), (0x607D, 2))
"""lowest and highest position"""
FRAME = 8
"""bytes of a CAN frame"""
_PDOS = 4
"""of each direction, whose identifiers the predefined connection set gives"""
_OPTIONAL = (Mappable.MODE.name, Mappable.MODE_DISPLAY.name)
"""asked and told by SDO where no PDO carries them"""
_SIZED = tuple(entry.name for pdo in (TPDOS[0], RPDO) for entry in pdo.entries)
"""counts and words, whose size is the profile's"""


class Access(Enum):
    """What may be done with an object."""

    ABSENT = "absent"
    READ = "read only"
    WRITE = "written"


@dataclass(frozen=True)
class Register:
    """One object as the drive has it."""

    access: Access
    code: str
    """struct code; empty where no PDO of ours could carry it"""
    mappable: bool
    default: int | None
    """by the file (of a DCF its ParameterValue first); None where it says none"""


@dataclass(frozen=True)
class PdoLayout:
    """The PDOs that are mapped, and why they are not enough where they are not."""

    tpdos: tuple[PdoMap, ...]
    rpdo: PdoMap
    target: PdoMap | None
    """of cyclic position mode"""
    problem: str = ""
    """what cannot be carried; empty where all is"""

    @property
    def pdos(self) -> tuple[PdoMap, ...]:
        """All of them."""
        return (*self.tpdos, self.rpdo, *(() if self.target is None else (self.target,)))

    def asks(self, name: str) -> bool:
        """Whether the RPDO carries the entry of this name."""
        return any(entry.name == name for entry in self.rpdo.entries)

    def tells(self, name: str) -> bool:
        """Whether a TPDO carries the entry of this name."""
        return any(entry.name == name for pdo in self.tpdos for entry in pdo.entries)


@dataclass(frozen=True)
class Abilities:
    """All that is known of a drive before it is asked."""

    registers: Mapping[tuple[int, int], Register]
    layout: PdoLayout

    @property
    def guarded(self) -> bool:
        """Whether it misses its host by life guarding (100C, 100D): it watches no heartbeat (1016)."""
        return not self.can_write(0x1016, 1) and self.can_write(0x100C) and self.can_write(0x100D)

    @property
    def tells_its_state(self) -> bool:
        """Whether its network state is heard: by its heartbeat (1017), or by its answers to node guarding."""
        return self.guarded or self.can_write(0x1017)

    def access(self, index: int, sub: int = 0) -> Access:
        """What may be done with an object."""
        register = self.registers.get((index, sub))
        return Access.ABSENT if register is None else register.access

    def has(self, index: int, sub: int = 0) -> bool:
        """Whether the object is there."""
        return (index, sub) in self.registers

    def can_write(self, index: int, sub: int = 0) -> bool:
        """Whether the object is there and may be written."""
        return self.access(index, sub) is Access.WRITE

    def fitting(self, wanted: Iterable[Setting]) -> tuple[Setting, ...]:
        """Those that this drive can be told, or compared with: what it lacks or keeps to itself is left out.

        A limit without its other end is none: it is not written either.
        """
        whole = all(self.can_write(index, sub) for index, sub in _LIMITS)
        ours = (s for s in wanted if whole or (s.index, s.sub) not in _LIMITS)
        return tuple(s for s in ours if (self.can_write if s.write else self.has)(s.index, s.sub))

    def kept(self, wanted: Iterable[Setting]) -> tuple[Setting, ...]:
        """Those that it shows and does not let be written."""
        return tuple(s for s in wanted if s.write and self.access(s.index, s.sub) is Access.READ)


def abilities(dictionary: ObjectDictionary, config: WinchConfig) -> Abilities:
    """Of a drive with this dictionary, for a winch of this mode and load."""
    registers = _registers(dictionary, config.family)
    return Abilities(registers, _layout(registers, config))


def _registers(dictionary: ObjectDictionary, family: DriveFamily) -> Mapping[tuple[int, int], Register]:
    found: dict[tuple[int, int], Register] = {}
    for entry in dictionary.values():
        for variable in [entry] if isinstance(entry, ODVariable) else entry.values():
            name = f"{variable.index:04X}:{variable.subindex:X}"
            if name in family.absent:
                continue
            written = variable.writable and name not in family.read_only
            found[variable.index, variable.subindex] = Register(
                Access.WRITE if written else Access.READ,
                _CODES.get(variable.data_type or 0, ""),
                bool(variable.pdo_mappable) and name not in family.not_mappable,
                told_by_file(variable),
            )
    return found


def used_pdos(config: WinchConfig) -> tuple[PdoMap, ...]:
    """What the winch's mode and load ask for, as a drive without restrictions carries it."""
    own = config.family.load_object
    load: Mappable | VendorEntry = Mappable.TORQUE if config.load is Load.TORQUE else Mappable.CURRENT
    if config.load is Load.VENDOR and own is not None:
        load = VendorEntry(f"{own.index:04X}:{own.sub:X}", own.index, own.sub, Mappable.CURRENT.code)
    told = (TPDOS[0], replace(TPDOS[1], entries=(Mappable.VELOCITY, load)))
    return (*told, RPDO, TARGET_RPDO) if config.mode is Mode.CYCLIC_POSITION else (*told, RPDO)


@dataclass
class _Record:
    """One PDO of the drive, with what has been put into it."""

    pdo: PdoMap
    places: int
    kinds: Mapping[int, bool]
    """transmission types of ours that it takes, and whether each is fixed"""
    entries: list[Mappable | VendorEntry]

    def takes(self, entry: Mappable | VendorEntry) -> bool:
        used = sum(_SIZE[e.code] for e in self.entries)
        return len(self.entries) < self.places and used + _SIZE[entry.code] <= FRAME


def _layout(registers: Mapping[tuple[int, int], Register], config: WinchConfig) -> PdoLayout:
    """First come, first served: statusword, position, mode, velocity, load; a controlword always with its target."""
    wanted = used_pdos(config)
    problems: list[str] = []
    told = [_as_it_is(registers, entry) for pdo in wanted if pdo.transmit for entry in pdo.entries]
    records = _records(registers, TPDOS[0])
    for entry in told:
        record = next((r for r in records if entry.code and r.takes(entry)), None)
        if record is not None:
            record.entries.append(entry)
        elif entry.name not in _OPTIONAL and entry is not told[-1]:  # the last is the load
            problems.append(f"no TPDO carries {_name(entry)}")
    tpdos = tuple(replace(r.pdo, entries=tuple(r.entries)) for r in records if r.entries)
    free = _records(registers, RPDO)
    rpdos = [_received(registers, free, pdo, problems) for pdo in wanted if not pdo.transmit]
    if problems:
        return PdoLayout(TPDOS, RPDO, TARGET_RPDO if len(rpdos) > 1 else None, "; ".join(problems))
    return PdoLayout(tpdos, rpdos[0], rpdos[1] if len(rpdos) > 1 else None)


def _received(
    registers: Mapping[tuple[int, int], Register], free: list[_Record], wanted: PdoMap, problems: list[str]
) -> PdoMap:
    """An RPDO with all its entries, or without the mode; the record that it takes is no longer free."""
    entries = [_as_it_is(registers, entry) for entry in wanted.entries]
    lacking = [entry for entry in entries if not entry.code and entry.name not in _OPTIONAL]
    carried = [entry for entry in entries if entry.code]
    if lacking:
        problems.append(f"no RPDO carries {', '.join(map(_name, lacking))}")
    for chosen in (carried, [entry for entry in carried if entry.name not in _OPTIONAL]):
        for record in free:
            kind = record.kinds.get(wanted.transmission)
            if kind is not None and len(chosen) <= record.places:
                free.remove(record)
                return replace(record.pdo, entries=tuple(chosen), transmission=wanted.transmission, type_fixed=kind)
    problems.append(f"no RPDO can be mapped with {', '.join(map(_name, carried))}")
    return wanted


def _as_it_is(registers: Mapping[tuple[int, int], Register], entry: Mappable | VendorEntry) -> Mappable | VendorEntry:
    """The entry; the load with the size that the drive's object has; without a code where it cannot be mapped."""
    index, sub, code = entry.value
    register = registers.get((index, sub))
    if register is None or not register.mappable or (register.code != code and entry.name in _SIZED):
        return VendorEntry(entry.name, index, sub, "")
    return entry if register.code == code else VendorEntry(entry.name, index, sub, register.code)


def _records(registers: Mapping[tuple[int, int], Register], like: PdoMap) -> list[_Record]:
    """PDOs of this direction that can be mapped; TPDOs only where they are sent at each SYNC."""
    found: list[_Record] = []
    for number in range(1, _PDOS + 1):
        pdo = replace(like, number=number, entries=())
        count, cob = registers.get((pdo.mapping_index, 0)), registers.get((pdo.communication_index, 1))
        kind = registers.get((pdo.communication_index, 2))
        entries = (_writable(registers.get((pdo.mapping_index, n))) for n in range(1, FRAME + 1))
        places = sum(takewhile(bool, entries))  # one after another: those behind a gap are not reached
        if not (_writable(count) and _writable(cob) and places):
            continue
        fixed = not _writable(kind)
        kinds = {t: fixed for t in (1, 255) if kind is not None and (not fixed or kind.default == t)}
        if pdo.transmit and pdo.transmission not in kinds:
            continue
        found.append(_Record(replace(pdo, type_fixed=fixed), places, kinds, []))
    return found


def _writable(register: Register | None) -> bool:
    return register is not None and register.access is Access.WRITE


def _name(entry: Mappable | VendorEntry) -> str:
    index, sub, _ = entry.value
    return f"{index:04X}:{sub:X}"
