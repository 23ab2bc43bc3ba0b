"""How a drive family differs from CiA 402, as data: units, vendor objects, missing and read-only objects.

One TOML file for each in `families/`, with the source of every quirk, or a laboratory's own beside its rig file. What
is absent is neither written nor asked for, in bring-up and in moves; what then takes its place, `requirements` says.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path
from typing import Any

from fidim_lab.data.files.toml_file import read_toml_table
from fidim_lab.errors import FileError

FORMAT = "fidim-drive-family/1"
FOLDER = Path(__file__).parent / "families"
LOADS = ("current", "torque")
MODES_SHOWN = ("always", "enabled")
_KEYS = {
    "format",
    "name",
    "makers",
    "source",
    "speed",
    "velocity",
    "acceleration",
    "load",
    "rated_current",
    "current_limit",
} | {*("absent", "read_only", "not_mappable", "mode_shown")}


@dataclass(frozen=True)
class AmpereObject:
    """A vendor object that holds a current."""

    index: int
    sub: int
    ampere: float
    """A for one digit"""


_TURNS, _INCREMENTS, _SECOND, _MINUTE = 0xB4, 0xB5, 0x03, 0x47
_RAMP = re.compile(r"ms to (.+)")
_UNIT = re.compile(r"(?:([0-9.eE+-]+) )?(counts|turns|rpm)(?:/s)?")


def counts_per_digit(unit: str, motor_counts: float) -> float:
    """counts/s (counts/s² of an acceleration) for one digit of a speed, with so many counts for a turn of the motor.

    unit: "counts/s", "rpm", or a number of counts or turns of the motor: "0.1 rpm", "1 turns/s". Raises ValueError.
    """
    parted = _UNIT.fullmatch(unit)
    amount = 0.0 if parted is None else float(parted[1] or 1.0)
    if parted is None or not 0.0 < amount < float("inf"):
        raise ValueError(f'{unit!r}; there are "counts/s", "turns/s" and "rpm", with a number before them or without')
    return amount * {"counts": 1.0, "turns": motor_counts, "rpm": motor_counts / 60.0}[parted[2]]


def ramp_speed(unit: str, motor_counts: float) -> float | None:
    """counts/s in which a ramp is measured whose object holds a time: "ms to 3000 rpm"; None where it holds a slope.

    Raises ValueError.
    """
    parted = _RAMP.fullmatch(unit)
    return None if parted is None else counts_per_digit(parted[1], motor_counts)


def speed_unit(told: int) -> str:
    """Of an SI unit as 60A9 tells it (CiA 303-2): power of ten, numerator, denominator; empty where it is another."""
    power, above, below = (told >> 24 ^ 0x80) - 0x80, told >> 16 & 0xFF, told >> 8 & 0xFF
    name = {(_TURNS, _SECOND): "turns/s", (_TURNS, _MINUTE): "rpm", (_INCREMENTS, _SECOND): "counts/s"}.get(
        (above, below)
    )
    return "" if name is None else f"{10.0**power:g} {name}" if power else name


@dataclass(frozen=True)
class DriveFamily:
    """One drive family; without arguments it keeps to the profile."""

    name: str = "generic CiA 402"
    makers: tuple[str, ...] = ()
    """words, in lower case, of which an EDS file's VendorName has one"""
    source: str = ""
    """where what it says comes from"""
    speed: str = "counts/s"
    """what one digit of 6081 and 607F is (`counts_per_digit`)"""
    velocity: str = ""
    """of 606C and 60FF; empty: as speed"""
    acceleration: str = ""
    """of 6083 to 6085, each a second; or the time to a speed ("ms to 3000 rpm"); empty: as speed"""
    load: str = "current"
    """"current" (6078) or "torque" (6077), where it is no vendor object"""
    load_object: AmpereObject | None = None
    """mappable; its size is in the EDS file"""
    rated_current: AmpereObject | None = None
    """in place of 6075: compared"""
    current_limit: AmpereObject | None = None
    """in place of 6072 and 6073"""
    absent: Mapping[str, str] = field(default_factory=dict[str, str])
    """objects that it lacks, whatever its EDS file says, and why that is known"""
    read_only: Mapping[str, str] = field(default_factory=dict[str, str])
    """objects that it shows and does not let be written, and why that is known"""
    not_mappable: Mapping[str, str] = field(default_factory=dict[str, str])
    """objects that no PDO carries, and why that is known"""
    mode_shown: str = "always"
    """"always", or "enabled": 6061 is 0 until the drive is enabled"""

    @property
    def velocity_unit(self) -> str:
        """Of 606C and 60FF."""
        return self.velocity or self.speed

    @property
    def speeds(self) -> tuple[str, ...]:
        """Units of speeds that it has."""
        return (self.speed, self.velocity) if self.velocity else (self.speed,)

    def speaks(self, unit: str) -> bool:
        """Whether one of its speeds has this unit."""
        turn = 4096.0  # any: no unit of a turn is one of a count
        return any(isclose(counts_per_digit(unit, turn), counts_per_digit(own, turn)) for own in self.speeds)


GENERIC_FAMILY = DriveFamily()


def family_path(name: str, beside: Path) -> Path:
    """The file of a built-in family, or of one beside the rig file (a name that ends in .toml)."""
    return beside / name if name.endswith(".toml") else FOLDER / f"{name}.toml"


def built_in() -> tuple[str, ...]:
    """Names of the families that come with this program."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def families_of(vendor: str) -> tuple[str, ...]:
    """Built-in families for drives of the maker that an EDS file names (its VendorName)."""
    said = vendor.lower()
    return tuple(n for n in built_in() if any(word in said for word in read_family(FOLDER / f"{n}.toml").makers))


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
    if not isinstance(load, dict) and load not in LOADS:
        raise FileError(path, "load", f"{load!r}; there are {', '.join(LOADS)}, or a table of a vendor object")
    shown = str(table.get("mode_shown", "always"))
    if shown not in MODES_SHOWN:
        raise FileError(path, "mode_shown", f"{shown!r}; there are {', '.join(MODES_SHOWN)}")
    return DriveFamily(
        name=str(table.get("name", path.stem)),
        makers=_words(path, "makers", table.get("makers", [])),
        source=str(table.get("source", "")),
        speed=_unit(path, "speed", table.get("speed", "counts/s")),
        velocity=_unit(path, "velocity", table["velocity"]) if "velocity" in table else "",
        acceleration=_acceleration(path, table["acceleration"]) if "acceleration" in table else "",
        load="current" if isinstance(load, dict) else load,
        load_object=_object(path, "load", load) if isinstance(load, dict) else None,
        rated_current=_optional(path, "rated_current", table),
        current_limit=_optional(path, "current_limit", table),
        absent=_objects(path, "absent", table),
        read_only=_objects(path, "read_only", table),
        not_mappable=_objects(path, "not_mappable", table),
        mode_shown=shown,
    )


def _words(path: Path, key: str, said: Any) -> tuple[str, ...]:
    if not isinstance(said, list) or not all(isinstance(word, str) and word for word in said):
        raise FileError(path, key, f"{said!r}; a list of words is expected")
    return tuple(word.lower() for word in said)


def _unit(path: Path, key: str, said: Any) -> str:
    try:
        counts_per_digit(str(said), 1.0)
    except ValueError as error:
        raise FileError(path, key, str(error)) from error
    return str(said)


def _acceleration(path: Path, said: Any) -> str:
    parted = _RAMP.fullmatch(str(said))
    _unit(path, "acceleration", said if parted is None else parted[1])
    return str(said)


def _optional(path: Path, key: str, table: Mapping[str, Any]) -> AmpereObject | None:
    return None if key not in table else _object(path, key, table[key])


def _object(path: Path, key: str, table: Any) -> AmpereObject:
    if not isinstance(table, dict) or not set(table) <= {"index", "sub", "ampere"}:
        raise FileError(path, key, f"{table!r}; a table of index, sub and ampere is expected")
    index, sub, ampere = table.get("index"), table.get("sub", 0), table.get("ampere")
    if not isinstance(index, int) or not 0x2000 <= index <= 0xFFFF or not isinstance(sub, int) or not 0 <= sub <= 255:
        raise FileError(path, key, f"index {index!r}, sub {sub!r}: an object is 0x2000 to 0xFFFF with a sub of a byte")
    if isinstance(ampere, bool) or not isinstance(ampere, int | float) or not ampere > 0:
        raise FileError(path, f"{key}, ampere", f"{ampere!r}; A for one digit, above 0")
    return AmpereObject(index, sub, float(ampere))


def _objects(path: Path, key: str, table: Mapping[str, Any]) -> Mapping[str, str]:
    said = table.get(key, {})
    if not isinstance(said, dict) or not all(isinstance(why, str) and why for why in said.values()):
        raise FileError(path, key, 'objects as "6072:0" with a text each, which says why that is known')
    return {name.upper(): why for name, why in said.items()}
