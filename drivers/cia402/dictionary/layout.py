"""Which PDOs of a drive carry what is needed: mapped where they can be, used as they are where they cannot. Pure."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from drivers.cia402.dictionary.config import Load, WinchConfig
from drivers.cia402.dictionary.registers import Access, Register
from drivers.cia402.profile.words import Mode
from drivers.cia402.wire.pdo import COB_MASK, COB_OFF, RPDO, TARGET_RPDO, TPDOS, Mappable, PdoMap, VendorEntry

FRAME = 8
"""bytes of a CAN frame"""
_PDOS = 4
"""of each direction, whose identifiers the predefined connection set gives"""
_OPTIONAL = (Mappable.MODE.name, Mappable.MODE_DISPLAY.name)
"""asked and told by SDO where no PDO carries them"""
_SIZED = tuple(entry.name for pdo in (TPDOS[0], RPDO) for entry in pdo.entries)
"""counts and words, whose size is the profile's"""
_NOT_A_NUMBER = (Mappable.VELOCITY.name, "f")
"""a speed that may be not a number would never be too high; a load that is not is said to be unknown"""
_WRITTEN = tuple(entry.name for entry in RPDO.entries)
_AT_ONCE = (254, 255)
"""transmission types of an RPDO that is acted upon at once"""
_OWN_TIME = ": sent when the drive likes, at rest never; samples of several winches would be of different instants"
_LAST_DUMMY = 0x1F
"""objects below are types, and hold places in a mapping"""

_ZEROED = (0x607100, 0x60B100, 0x60B200, 0x60FF00)
"""set-points of torque and velocity and their feed-forward, index and sub-index: 0 in a fixed RPDO changes nothing in a
position mode. Any other object (6072, 60FE, 6081) has a value to keep, which 0 would overwrite"""

Registers = Mapping[tuple[int, int], Register]
Entry = Mappable | VendorEntry


@dataclass(frozen=True)
class PdoLayout:
    """The PDOs that are used, and why they are not enough where they are not."""

    tpdos: tuple[PdoMap, ...]
    rpdo: PdoMap
    target: PdoMap | None
    """of cyclic position mode, or where `rpdo` has none"""
    problem: str = ""
    """what cannot be carried, and why; empty where all is"""
    velocity_digit: float = 1.0
    """counts/s of one digit of 606C, for a velocity that no PDO carries"""

    @property
    def pdos(self) -> tuple[PdoMap, ...]:
        """All of them."""
        return (*self.tpdos, self.rpdo, *(() if self.target is None else (self.target,)))

    def asks(self, name: str) -> bool:
        """Whether an RPDO carries the entry of this name."""
        return any(pdo.carries(name) for pdo in self.pdos if not pdo.transmit)

    def tells(self, name: str) -> bool:
        """Whether a TPDO carries the entry of this name."""
        return any(pdo.carries(name) for pdo in self.tpdos)


def used_pdos(config: WinchConfig) -> tuple[PdoMap, ...]:
    """What the winch's mode and load ask for, as a drive without restrictions carries it."""
    own = config.family.load_object
    load: Entry = Mappable.TORQUE if config.load is Load.TORQUE else Mappable.CURRENT
    if config.load is Load.VENDOR and own is not None:
        load = VendorEntry(f"{own.index:04X}:{own.sub:X}", own.index, own.sub, Mappable.CURRENT.code)
    told = (TPDOS[0], replace(TPDOS[1], entries=(Mappable.VELOCITY, load)))
    return (*told, RPDO, TARGET_RPDO) if config.mode is Mode.CYCLIC_POSITION else (*told, RPDO)


@dataclass
class _Record:
    """One PDO of the drive, with what has been put into it."""

    pdo: PdoMap
    places: int
    """entries that can be mapped"""
    kinds: Sequence[int]
    """transmission types of ours that it takes"""
    fixed: tuple[int, ...] | None
    """the entries of a mapping that cannot be written, as its file says; None where it can"""
    entries: list[Entry]

    def takes(self, entry: Entry) -> bool:
        """Whether it carries this entry, or has a place for it."""
        if self.fixed is not None:
            return entry.mapping in self.fixed
        used = sum(struct.calcsize(e.code) for e in self.entries)
        return len(self.entries) < self.places and used + struct.calcsize(entry.code) <= FRAME

    def carries_all(self, chosen: Sequence[Entry]) -> bool:
        """Whether an RPDO can be made of these entries; a fixed one may hold nothing else, but for what may be 0."""
        if self.fixed is None:
            return len(chosen) <= self.places
        ours = {entry.mapping for entry in chosen}
        others = set(self.fixed) - ours
        return ours <= set(self.fixed) and all(m >> 16 <= _LAST_DUMMY or m >> 8 in _ZEROED for m in others)

    def filled(self, entries: Sequence[Entry], transmission: int) -> PdoMap:
        """The PDO with its entries; of a fixed one those that nobody asked for have no name."""
        if self.fixed is not None:
            by_place = {entry.mapping: entry for entry in entries}
            entries = [by_place.pop(m, None) or _unnamed(m) for m in self.fixed]
        return replace(self.pdo, entries=tuple(entries), transmission=transmission)


def lay_out(registers: Registers, config: WinchConfig) -> PdoLayout:
    """As much as goes of statusword, position, mode, velocity, load; a controlword with its target, or just after it.

    Without room for all, the mode is left out first (it is asked by SDO), then the velocity (told by positions), then
    the load. What a PDO with a fixed mapping carries is taken from there, before any is mapped.
    """
    wanted = used_pdos(config)
    problems = _Reasons()
    told = [_as_it_is(registers, entry) for pdo in wanted if pdo.transmit for entry in pdo.entries]
    records, useless = _records(registers, config, TPDOS[0])
    *_, display, velocity, load = told
    spare = [entry for entry in (display, velocity, load) if entry.code]
    leaving = [[e for k, e in enumerate(spare) if n >> k & 1] for n in range(1 << len(spare))]
    for left_out in leaving:
        if _packed(records, [entry for entry in told if entry.code and entry not in left_out]):
            break
    for asked, entry in zip(TPDOS[0].entries[:2], told[:2], strict=True):
        if not any(entry in record.entries for record in records):
            why = _why_not(registers, asked) or useless or "no place is left"
            problems.add(f"no TPDO carries {_name(entry)}", why)
    used = sorted((r for r in records if r.entries), key=lambda r: r.pdo.number)
    tpdos = tuple(r.filled(r.entries, TPDOS[0].transmission) for r in used)
    rpdos, lacks = _commands(registers, config, [pdo for pdo in wanted if not pdo.transmit])
    for why, every in lacks.found.items():
        problems.found.setdefault(why, []).extend(every)
    if problems.found:
        return PdoLayout(TPDOS, RPDO, TARGET_RPDO if len(rpdos) > 1 else None, str(problems))
    unit = config.counts_per_digit(config.family.velocity_unit)
    return PdoLayout(tpdos, rpdos[0], rpdos[1] if len(rpdos) > 1 else None, velocity_digit=unit)


def _packed(records: Sequence[_Record], entries: Sequence[Entry]) -> bool:
    """Put each entry into the first PDO that takes it; False where one finds none."""
    for record in records:
        record.entries.clear()
    for entry in entries:
        record = next((r for r in records if r.takes(entry)), None)
        if record is None:
            return False
        record.entries.append(entry)
    return True


class _Reasons:
    """What does not go, in sentences; those of one reason together."""

    def __init__(self) -> None:
        self.found: dict[str, list[str]] = {}

    def add(self, what: str, why: str) -> None:
        every = self.found.setdefault(why, [])
        if what not in every:
            every.append(what)

    def __str__(self) -> str:
        return "; ".join(f"{', '.join(every)} ({why})" for why, every in self.found.items())


def _commands(registers: Registers, config: WinchConfig, wanted: list[PdoMap]) -> tuple[list[PdoMap], _Reasons]:
    """RPDOs with controlword and target together, else with each in one of its own; what lacks the first of both."""
    found, useless = _records(registers, config, RPDO)
    transmission = wanted[-1].transmission  # of cyclic position mode each target is taken at a SYNC
    apart = [
        replace(RPDO, entries=(Mappable.CONTROLWORD, Mappable.MODE)),
        replace(TARGET_RPDO, entries=(Mappable.TARGET_POSITION, Mappable.MODE), transmission=transmission),
    ]
    tried: list[tuple[list[PdoMap], _Reasons]] = []
    for every in (wanted, apart):
        free, lacks = list(found), _Reasons()
        tried.append(([_received(registers, free, useless, pdo, lacks) for pdo in every], lacks))
        if not lacks.found:
            return tried[-1]
    return tried[0]


def _received(registers: Registers, free: list[_Record], useless: str, wanted: PdoMap, problems: _Reasons) -> PdoMap:
    """An RPDO with all its entries, or without the mode; the record that it takes is no longer free."""
    entries = [_as_it_is(registers, entry) for entry in wanted.entries]
    carried = [entry for entry in entries if entry.code]
    for asked, entry in zip(wanted.entries, entries, strict=True):
        if not entry.code and entry.name not in _OPTIONAL:
            problems.add(f"no RPDO carries {_name(entry)}", _why_not(registers, asked))
    needed = [entry for entry in carried if entry.name not in _OPTIONAL]
    if not needed:
        return wanted
    of_type = _AT_ONCE if wanted.transmission in _AT_ONCE else (wanted.transmission,)
    for chosen in (carried, needed):
        for record in free:
            kind = next((k for k in reversed(of_type) if k in record.kinds), None)
            if kind is not None and record.carries_all(chosen):
                free.remove(record)
                return record.filled(chosen, kind)
    room = "a place for it, or carries it alone" if len(needed) == 1 else "places for these, or carries these alone"
    others = f"no other of transmission type {wanted.transmission} has {room}" if free else ""
    why = "; ".join(filter(None, (others, useless)))
    problems.add(f"no RPDO carries {' with '.join(map(_name, needed))}", why)
    return wanted


def _as_it_is(registers: Registers, entry: Entry) -> Entry:
    """The entry; the load with the size that the drive's object has; without a code where it cannot be mapped."""
    index, sub, code = entry.value
    register = registers.get((index, sub))
    if register is None or _why_not(registers, entry):
        return VendorEntry(entry.name, index, sub, "")
    return entry if register.code == code else VendorEntry(entry.name, index, sub, register.code)


def _why_not(registers: Registers, entry: Entry) -> str:
    """Why no PDO can carry this object at all; empty where one can."""
    index, sub, code = entry.value
    register = registers.get((index, sub))
    if register is None:
        return "there is no such object"
    if not register.mappable:
        return "PDOMapping is 0, or its family says so"
    if not register.code:
        return "its DataType is not a number of at most 32 bits"
    if entry.name in _WRITTEN and register.access is not Access.WRITE:
        return "it is read only"
    if (entry.name in _SIZED and code and register.code != code) or (entry.name, register.code) == _NOT_A_NUMBER:
        return f"its DataType is not the whole number of {8 * struct.calcsize(code)} bits that CiA 402 gives it"
    return ""


def _records(registers: Registers, config: WinchConfig, like: PdoMap) -> tuple[list[_Record], str]:
    """PDOs of this direction that can be used, fixed ones first; why the others cannot.

    TPDOs only where they are sent at each SYNC.
    """
    found: list[_Record] = []
    useless = _Reasons()
    for number in range(1, _PDOS + 1):
        pdo = replace(like, number=number, entries=())
        kind, cob = (registers.get((pdo.communication_index, sub)) for sub in (2, 1))
        if (pdo.mapping_index, 0) not in registers or kind is None or cob is None:
            continue
        kinds = _kinds(kind, pdo)
        places, fixed = _mapping(registers, pdo)
        pdo = replace(
            pdo, type_fixed=not _writable(kind), mapping_fixed=fixed is not None, cob_fixed=not _writable(cob)
        )
        if not kinds:
            useless.add(
                f"{pdo.communication_index:04X}:2",
                f"read only and {kind.default}, not {like.transmission}{_OWN_TIME * pdo.transmit}",
            )
        elif pdo.cob_fixed and not _predefined(cob, pdo, config.node_id):
            off = cob.default is not None and cob.default & COB_OFF
            why = "read only, and switched off" if off else "read only, and another identifier than the standard's"
            useless.add(f"{pdo.communication_index:04X}:1", why)
        elif not places and not fixed:
            useless.add(f"{pdo.mapping_index:04X}", "read only, and the file does not say what it maps")
        else:
            found.append(_Record(pdo, places, kinds, fixed, []))
    if not found and not useless.found:
        return [], f"it has none of {'TPDO' if like.transmit else 'RPDO'} 1 to {_PDOS}"
    return sorted(found, key=lambda r: r.fixed is None), "; ".join(
        f"{', '.join(objects)}: {why}" for why, objects in useless.found.items()
    )


def _kinds(kind: Register, pdo: PdoMap) -> tuple[int, ...]:
    """Transmission types of ours that this PDO has or takes."""
    ours = (1,) if pdo.transmit else (1, *_AT_ONCE)
    return ours if _writable(kind) else tuple(t for t in ours if t == kind.default)


def _mapping(registers: Registers, pdo: PdoMap) -> tuple[int, tuple[int, ...] | None]:
    """How many entries can be mapped; or those that stand there for good, by the file.

    Where only their number is read only and none is told, the file contradicts itself: the drive is asked to map.
    """
    entries = [registers.get((pdo.mapping_index, n)) for n in range(1, FRAME + 1)]
    places = sum(takewhile(bool, map(_writable, entries)))  # one after another: those behind a gap are not reached
    if places and _writable(registers.get((pdo.mapping_index, 0))):
        return places, None
    count = registers[pdo.mapping_index, 0].default or 0
    told = tuple(0 if entry is None else entry.default or 0 for entry in entries[:count])
    whole = all(m & 0xFF and m % 8 == 0 for m in told) and sum(m & 0xFF for m in told) <= 8 * FRAME
    if told and whole and len(told) == count:
        return 0, told
    return (places, None) if places else (0, ())


def _predefined(cob: Register, pdo: PdoMap, node_id: int) -> bool:
    told = cob.default
    return told is not None and not told & COB_OFF and told & COB_MASK == pdo.cob_id(node_id)


def _unnamed(mapping: int) -> VendorEntry:
    return VendorEntry("", mapping >> 16, mapping >> 8 & 0xFF, f"{(mapping & 0xFF) // 8}s")


def _writable(register: Register | None) -> bool:
    return register is not None and register.access is Access.WRITE


def _name(entry: Entry) -> str:
    index, sub, _ = entry.value
    return f"{index:04X}:{sub:X}"
