"""One clean description of each object of a file, in the form that `canopen` reads, and what was repaired for it."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fidim_lab.data.eds.compact import compact_entry, compact_pdos, count_of
from fidim_lab.data.eds.numbers import NODE, number, plain, with_node
from fidim_lab.data.eds.standard import (
    BOOLEAN,
    BYTES,
    DOMAIN,
    FLOATS,
    HIGHEST,
    NAMES,
    SIGNED,
    TEXTS,
    UNSIGNED,
    known_access,
    known_type,
    same_register,
)
from fidim_lab.data.eds.text import EdsSection, Repair, no_objects
from fidim_lab.errors import FileError

MOST_ENTRIES = 60_000
"""entries of one dictionary, sub-indices counted: 8 s of reading; the largest file of a maker that we know has 3000"""
_BEHIND = r"[\s,;:-]+.*"
"""a name behind the number, as some tools write it"""
_OBJECT = re.compile(r"(?:0x)?([0-9a-f]{4})h?|(?:0x)?(?=[a-f]*[0-9])([0-9a-f]{4})h?" + _BEHIND, re.IGNORECASE)
_SUB = re.compile(r"(?:0x)?([0-9a-f]{1,4})h?[ _.]*sub[ _.]*(?:0x)?([0-9a-f]{1,4})h?(?:" + _BEHIND + ")?", re.IGNORECASE)
_LIST = re.compile(r"([0-9a-f]{4})(name|value)", re.IGNORECASE)
_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_FIRST, _LAST_SUB = 0x1000, 0xFF
_LAST_NODE = 127
_VARIABLE, _DOMAIN_OBJECT, _RECORD = 7, 2, 9
_ACCESS = {"readonly": "ro", "writeonly": "wo", "readwrite": "rw", "constant": "const", "r": "ro", "w": "wo"}


@dataclass
class _Object:
    parent: EdsSection | None = None
    subs: dict[int, EdsSection] = field(default_factory=dict[int, EdsSection])
    lists: dict[str, EdsSection] = field(default_factory=dict[str, EdsSection])


def clean_objects(path: Path, sections: Sequence[EdsSection]) -> tuple[str, list[Repair]]:
    """An EDS text of all objects, and the repairs. Raises FileError with section, line and cure."""
    return _Cleaner(path).clean(sections)


class _Cleaner:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._types: dict[int, int] = {}
        """types that CANFestival describes as objects of their own, [A0] and on"""
        self._repairs: list[Repair] = []
        self._lines: list[str] = []
        self._entries = 0
        self._silent = False
        """whether the file says of no object that a PDO carries it, though there are PDOs"""
        self._listed: dict[int, tuple[EdsSection, str]] = {}
        """objects that a list names, and where"""

    def clean(self, sections: Sequence[EdsSection]) -> tuple[str, list[Repair]]:
        objects = self._gather(sections)
        if not objects:
            raise no_objects(self._path, sections)
        for index in objects.keys() & set(self._listed):
            del self._listed[index]
        for index, (section, key) in self._listed.items():
            self._say(section, key, f"{index:04X} is listed, and no section [{index:04X}] describes it: ignored")
        self._emit("DeviceInfo")  # canopen misses it aloud
        self._silent = self._says_nothing_of_pdos(objects)
        for index, entry in objects.items():
            self._object(index, entry)
        return "\n".join(self._lines) + "\n", self._repairs

    def _gather(self, sections: Sequence[EdsSection]) -> dict[int, _Object]:
        objects: dict[int, _Object] = {}
        implied: dict[int, _Object] = {}
        for section in sections:
            if (sub := _SUB.fullmatch(section.name)) is not None:
                index, at = int(sub[1], 16), int(sub[2], 16)
                if index < _FIRST:
                    self._types[index] = number(section.text("defaultvalue")) or 0
                elif at > _LAST_SUB:
                    self._say(section, "", "there are no sub-indices beyond FF: ignored")
                else:
                    entry = objects.setdefault(index, _Object())
                    entry.subs[at] = self._first(entry.subs.get(at), section)
            elif (whole := _OBJECT.fullmatch(section.name)) is not None and _index(whole) >= _FIRST:
                entry = objects.setdefault(_index(whole), _Object())
                entry.parent = self._first(entry.parent, section)
            elif (listed := _LIST.fullmatch(section.name)) is not None:
                objects.setdefault(int(listed[1], 16), _Object()).lists[listed[2].lower()] = section
            elif (name := section.name.lower()) in _LISTS:
                self._list(section)
            elif name == "deviceinfo":
                described = [(at, subs) for at, subs in compact_pdos(section) if at not in implied]
                implied |= {
                    at: _Object(EdsSection(f"{at:04X}", section.at("compactpdo")), subs) for at, subs in described
                }
        objects = {index: entry for index, entry in objects.items() if entry.parent is not None or entry.subs}
        return (implied | objects) if objects else {}

    def _list(self, section: EdsSection) -> None:
        for key, value in section.values.items():
            index = number(value.text) if key.isdigit() else None
            if index is not None and _FIRST <= index <= 0xFFFF:
                self._listed.setdefault(index, (section, key))

    def _first(self, old: EdsSection | None, new: EdsSection) -> EdsSection:
        """Of two sections of one object the first counts, unless they contradict each other in its type."""
        if old is None:
            return new
        types = [number(section.text("datatype")) for section in (old, new)]
        if None not in types and types[0] != types[1]:
            raise FileError(
                self._path,
                f"[{new.name}], line {new.line}",
                f"DataType {new.text('datatype')}, but {old.text('datatype')} for the same object in line {old.line}",
                hint="Delete the section that is wrong: the drive's manual says which.",
            )
        self._say(new, "", f"stands twice: the one in line {old.line} counts")
        return old

    def _say(self, section: EdsSection, key: str, what: str) -> None:
        self._repairs.append(Repair(section.name, section.at(key), what))

    # objects --------------------------------------------------------------------------------------------------------

    def _object(self, index: int, entry: _Object) -> None:
        parent, subs = entry.parent, dict(entry.subs)
        if parent is None:
            first = min(subs.values(), key=lambda section: section.line)
            self._say(first, "", "has no section of its object above it: taken as a record")
            parent = EdsSection(f"{index:04X}", first.line)
        compact = self._integer(parent, "compactsubobj") or 0
        if not subs and not compact:
            if "datatype" in parent.values or self._kind(parent) in (None, _VARIABLE, _DOMAIN_OBJECT):
                self._variable(index, 0, parent)
            return
        if subs and self._kind(parent) in (_VARIABLE, _DOMAIN_OBJECT):
            self._say(parent, "objecttype", "ObjectType says variable, but it has sub-indices: taken as a record")
        if not 0 <= compact < _LAST_SUB:
            self._say(parent, "compactsubobj", f"CompactSubObj={compact}: at most 254 are read")
            compact = max(0, min(compact, _LAST_SUB - 1))
        for sub in range(1, compact + 1):
            subs.setdefault(sub, compact_entry(index, sub, parent, entry.lists))
        if 0 not in subs:
            if not compact and parent.values:
                self._say(parent, "", "has no sub-index 0: added")
            subs[0] = count_of(index, max(subs), parent, subs)
        self._emit(f"{index:04X}", ParameterName=parent.text("parametername") or f"object {index:04X}", ObjectType="9")
        for sub in sorted(subs):
            self._variable(index, sub, subs[sub])

    def _variable(self, index: int, sub: int, section: EdsSection) -> None:
        self._entries += 1
        if self._entries > MOST_ENTRIES:
            raise FileError(
                self._path,
                f"[{section.name}], line {section.line}",
                f"there are more than {MOST_ENTRIES} entries",
                hint="Delete what the drive does not have.",
            )
        name = f"{index:04X}sub{sub:X}" if sub or self._is_sub(section) else f"{index:04X}"
        given = section.text("parametername")
        if not given:
            self._say(section, "parametername", "ParameterName is missing")
        kind = self._type(index, sub, section)
        low, high = self._limits(section, kind)
        default, own = (self._value(section, key, kind) for key in ("defaultvalue", "parametervalue"))
        self._emit(
            name,
            ParameterName=given or f"object {name}",
            ObjectType=str(_VARIABLE),
            DataType=str(kind),
            AccessType=self._access(index, section),
            PDOMapping=str(int(self._mappable(section))),
            LowLimit=low,
            HighLimit=high,
            DefaultValue=default,
            ParameterValue="" if _of_another_node(default, own) else own,
        )

    @staticmethod
    def _is_sub(section: EdsSection) -> bool:
        return _SUB.fullmatch(section.name) is not None

    def _emit(self, section: str, **keys: str) -> None:
        self._lines += ["", f"[{section}]", *(f"{key}={text}" for key, text in keys.items() if text)]

    # keys -----------------------------------------------------------------------------------------------------------

    def _integer(self, section: EdsSection, key: str) -> int | None:
        text = section.text(key)
        value = number(text) if text else None
        if value is not None and not plain(text) and text.strip("0"):
            self._say(section, key, f"{text!r} is read as {value}")
        return value

    @staticmethod
    def _kind(section: EdsSection) -> int | None:
        return number(section.text("objecttype")) if section.text("objecttype") else None

    def _type(self, index: int, sub: int, section: EdsSection) -> int:
        standard = known_type(index, sub)
        kind = NAMES.get(re.sub(r"[\W_]", "", section.text("datatype")).upper())
        kind = self._integer(section, "datatype") if kind is None else self._named(section, kind)
        if kind is not None and kind > HIGHEST:
            kind = self._types.get(kind, kind)
        if kind is None or not 0 < kind <= HIGHEST:
            if standard is None and self._kind(section) == _DOMAIN_OBJECT:
                return DOMAIN
            found = section.text("datatype")
            taken = "bytes, which are not used" if standard is None else f"type 0x{standard:02X}, as the standard says"
            problem = f"DataType {found!r} is unknown" if found else "DataType is missing"
            self._say(section, "datatype", f"{problem}: taken as {taken}")
            return DOMAIN if standard is None else standard
        if standard is not None and same_register(kind, standard):
            self._say(section, "datatype", f"DataType 0x{kind:02X} has the wrong sign: 0x{standard:02X} is meant")
            return standard
        return kind

    def _named(self, section: EdsSection, kind: int) -> int:
        self._say(section, "datatype", f"DataType {section.text('datatype')!r} is a name: 0x{kind:02X}")
        return kind

    def _access(self, index: int, section: EdsSection) -> str:
        text = section.text("accesstype")
        access = re.sub(r"[^a-z]", "", text.lower())
        access = _ACCESS.get(access, access)
        if access in ("ro", "wo", "rw", "rwr", "rww", "const"):
            return access
        access = "rw" if access.startswith(("rw", "readwrite")) else known_access(index) or "ro"
        problem = f"AccessType {text[:20]!r} is unknown" if text else "AccessType is missing"
        self._say(section, "accesstype", f"{problem}: taken as {access}")
        return access

    def _says_nothing_of_pdos(self, objects: Mapping[int, _Object]) -> bool:
        mapped = next((index for index in objects if 0x1600 <= index < 0x1C00), None)
        every = (s for entry in objects.values() for s in (entry.parent, *entry.subs.values()) if s is not None)
        if mapped is None or any(number(s.text("pdomapping")) != 0 for s in every if s.text("pdomapping")):
            return False
        first = objects[mapped].parent or next(iter(objects[mapped].subs.values()))
        self._say(first, "", "PDOs are there, and no object has PDOMapping=1: what PDOs carry, the drive says")
        return True

    def _mappable(self, section: EdsSection) -> bool:
        if self._silent:
            return True
        if "pdomapping" not in section.values:
            return False
        value = self._integer(section, "pdomapping")
        if value is None:
            text = section.text("pdomapping")
            mapped = text.lower() in ("optional", "default", "tpdo", "rpdo", "both")
            self._say(section, "pdomapping", f"PDOMapping {text[:20]!r}: taken as {int(mapped)}")
            return mapped
        return bool(value)

    def _limits(self, section: EdsSection, kind: int) -> tuple[str, str]:
        low, high = (self._value(section, key, kind, quiet=True) for key in ("lowlimit", "highlimit"))
        if NODE.search(low + high) or kind not in (*SIGNED, *UNSIGNED):
            return "", ""
        if low and high and int(low) >= int(high):
            if int(low) > int(high):
                self._say(section, "lowlimit", f"limits {low} to {high} leave no value: ignored")
            return "", ""
        return low, high

    def _value(self, section: EdsSection, key: str, kind: int, *, quiet: bool = False) -> str:
        text = section.text(key)
        if not text or kind in TEXTS:
            return text
        if kind in BYTES:
            return text if re.fullmatch(r"(?:[0-9a-fA-F]{2}\s*)*", text) else ""
        value = self._float(text) if kind in FLOATS else self._fitting(section, key, text, kind)
        if value is None and not quiet:
            self._say(section, key, f"{text[:20]!r} is not a value of its type: ignored")
        return value or ""

    @staticmethod
    def _float(text: str) -> str | None:
        try:
            return text if math.isfinite(float(text)) else None
        except ValueError:
            return None

    def _fitting(self, section: EdsSection, key: str, text: str, kind: int) -> str | None:
        """The number as a decimal, in the range of its type: 0x80000000 of a signed one is negative."""
        if NODE.search(text):
            value = with_node(text)
            return None if value is None or not 0 <= value < 1 << 32 else f"$NODEID+{value}"
        value = self._integer(section, key)
        bits = 1 if kind == BOOLEAN else SIGNED.get(kind) or UNSIGNED.get(kind)
        if value is None or bits is None or not -(1 << bits - 1) <= value < 1 << bits:
            return None
        if kind in SIGNED and value >= 1 << bits - 1:
            if text.isdigit():
                return None
            value -= 1 << bits
        elif kind in UNSIGNED and value < 0:
            value += 1 << bits
        return str(value)


def _of_another_node(default: str, own: str) -> bool:
    """Whether a value is what a sum with `$NODEID` came to for the node that its DCF was saved for."""
    added = default.removeprefix("$NODEID+")
    return added != default and own.isdigit() and 1 <= int(own) - int(added) <= _LAST_NODE


def _index(section: re.Match[str]) -> int:
    return int(section[1] or section[2], 16)
