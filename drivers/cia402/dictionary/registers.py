"""The objects of a drive by its dictionary and its family: what may be done with each, and what its file says. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from canopen.objectdictionary import ObjectDictionary, ODVariable

from drivers.cia402.dictionary.family import DriveFamily
from drivers.cia402.wire.sdo import told_by_file

_CODES = {1: "?", 2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I", 8: "f"}
"""CiA 301 data types that a PDO of ours carries"""


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


def registers_of(dictionary: ObjectDictionary, family: DriveFamily) -> Mapping[tuple[int, int], Register]:
    """By index and sub-index; what the family has as absent, read only or not mappable is so."""
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
