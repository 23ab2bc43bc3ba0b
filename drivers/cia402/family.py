"""What a drive family does otherwise than CiA 402, as data: units, vendor objects, objects that it lacks.

One TOML file for each in `families/`, or a laboratory's own beside its rig file. What a stop without the host rests on
(watch of the heartbeat, reactions, position limits) is never declared absent: such a drive is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fidim_lab.data.files.toml_file import read_toml_table
from fidim_lab.errors import FileError

FORMAT = "fidim-drive-family/1"
FOLDER = Path(__file__).parent / "families"
NEVER_ABSENT = frozenset({"1016:1", "1017:0", "6007:0", "605A:0", "605E:0", "607D:1", "607D:2", "6065:0", "6085:0"})
SPEEDS = ("counts/s", "rpm")
LOADS = ("current", "torque")
_KEYS = {"format", "name", "speed", "load", "current_limit", "absent"}


@dataclass(frozen=True)
class AmpereObject:
    """A vendor object that holds a current."""

    index: int
    sub: int
    ampere: float
    """A for one digit"""


@dataclass(frozen=True)
class DriveFamily:
    """One drive family; without arguments it keeps to the profile."""

    name: str = "generic CiA 402"
    speed: str = "counts/s"
    """of 606C, 6081, 607F, and with /s of 6083 to 6085: "counts/s", or "rpm" of the motor"""
    load: str = "current"
    """"current" (6078) or "torque" (6077), where it is no vendor object"""
    load_object: AmpereObject | None = None
    """16 bits, mappable"""
    current_limit: AmpereObject | None = None
    """in place of 6072 and 6073"""
    absent: Mapping[str, str] = field(default_factory=dict[str, str])
    """objects of bring-up that it lacks, and what stands in for each"""


GENERIC_FAMILY = DriveFamily()


def family_path(name: str, beside: Path) -> Path:
    """The file of a built-in family, or of one beside the rig file (a name that ends in .toml)."""
    return beside / name if name.endswith(".toml") else FOLDER / f"{name}.toml"


def built_in() -> tuple[str, ...]:
    """Names of the families that come with this program."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def read_family(path: Path) -> DriveFamily:
    """Read a family file. Raises FileError naming file and key."""
    if not path.exists():
        raise FileError(path, "", "no such file", hint=f"Built in are {', '.join(built_in())}.")
    table = read_toml_table(path)
    if table.get("format") != FORMAT:
        raise FileError(path, "format", f'{table.get("format")!r}; this version reads "{FORMAT}"')
    for key in table:
        if key not in _KEYS:
            raise FileError(path, key, "unknown key")
    load = table.get("load", "current")
    speed = table.get("speed", "counts/s")
    if speed not in SPEEDS:
        raise FileError(path, "speed", f"{speed!r}; there are {', '.join(SPEEDS)}")
    if not isinstance(load, dict) and load not in LOADS:
        raise FileError(path, "load", f"{load!r}; there are {', '.join(LOADS)}, or a table of a vendor object")
    limit = table.get("current_limit")
    return DriveFamily(
        name=str(table.get("name", path.stem)),
        speed=speed,
        load="current" if isinstance(load, dict) else load,
        load_object=_object(path, "load", load) if isinstance(load, dict) else None,
        current_limit=None if limit is None else _object(path, "current_limit", limit),
        absent=_absent(path, table.get("absent", {})),
    )


def _object(path: Path, key: str, table: Any) -> AmpereObject:
    if not isinstance(table, dict) or not set(table) <= {"index", "sub", "ampere"}:
        raise FileError(path, key, f"{table!r}; a table of index, sub and ampere is expected")
    index, sub, ampere = table.get("index"), table.get("sub", 0), table.get("ampere")
    if not isinstance(index, int) or not 0x2000 <= index <= 0xFFFF or not isinstance(sub, int) or not 0 <= sub <= 255:
        raise FileError(path, key, f"index {index!r}, sub {sub!r}: an object is 0x2000 to 0xFFFF with a sub of a byte")
    if isinstance(ampere, bool) or not isinstance(ampere, int | float) or not ampere > 0:
        raise FileError(path, f"{key}, ampere", f"{ampere!r}; A for one digit, above 0")
    return AmpereObject(index, sub, float(ampere))


def _absent(path: Path, table: Any) -> Mapping[str, str]:
    if not isinstance(table, dict) or not all(isinstance(why, str) and why for why in table.values()):
        raise FileError(path, "absent", 'objects as "6072:0" with a text each, which says what stands in for them')
    for name in table:
        if name.upper() in NEVER_ABSENT:
            raise FileError(path, f"absent, {name}", "a drive without it cannot be trusted to stop by itself")
    return {name.upper(): why for name, why in table.items()}
