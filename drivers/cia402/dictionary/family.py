"""How a drive family differs from CiA 402, as data: units, vendor objects, missing and read-only objects.

One TOML file for each in `families/`, with the source of every quirk, or a laboratory's own beside its rig file. What
is absent is neither written nor asked for, in bring-up and in moves; what then takes its place, `requirements` says.
"""

import re
from collections.abc import Mapping
from math import isclose
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fidim_lab.data.files.toml_file import Name, Positive, Table, read_toml_table, validated
from fidim_lab.errors import FileError

FORMAT = "fidim-drive-family/1"
FOLDER = Path(__file__).parent / "families"


class AmpereObject(Table):
    """A vendor object that holds a current."""

    index: Annotated[int, Field(ge=0x2000, le=0xFFFF)]
    sub: Annotated[int, Field(ge=0, le=0xFF)] = 0
    ampere: Positive
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


def _speed(unit: str) -> str:
    """A unit of speeds; empty: none of its own."""
    if unit:
        counts_per_digit(unit, 1.0)
    return unit


def _ramp(unit: str) -> str:
    if ramp_speed(unit, 1.0) is None:
        _speed(unit)
    return unit


def _upper(objects: Mapping[str, str]) -> Mapping[str, str]:
    return {name.upper(): why for name, why in objects.items()}


_Objects = Annotated[Mapping[str, Name], AfterValidator(_upper)]
"""objects as "6072:0", with a text each, which says why that is known"""
_Speed = Annotated[str, AfterValidator(_speed)]


class DriveFamily(Table):
    """One drive family; without arguments it keeps to the profile."""

    format: str = Field(default=FORMAT, exclude=True)
    name: str = "generic CiA 402"
    makers: tuple[Annotated[Name, AfterValidator(str.lower)], ...] = ()
    """words, in lower case, of which an EDS file's VendorName has one"""
    source: str = ""
    """where what it says comes from"""
    speed: _Speed = "counts/s"
    """what one digit of 6081 and 607F is (`counts_per_digit`)"""
    velocity: _Speed = ""
    """of 606C and 60FF; empty: as speed"""
    acceleration: Annotated[str, AfterValidator(_ramp)] = ""
    """of 6083 to 6085, each a second; or the time to a speed ("ms to 3000 rpm"); empty: as speed"""
    load: Literal["current", "torque"] = "current"
    """6078 or 6077, where it is no vendor object"""
    load_object: AmpereObject | None = None
    """mappable; its size is in the EDS file, and a family file calls it load"""
    rated_current: AmpereObject | None = None
    """in place of 6075: compared"""
    current_limit: AmpereObject | None = None
    """in place of 6072 and 6073"""
    absent: _Objects = Field(default_factory=dict[str, str])
    """objects that it lacks, whatever its EDS file says, and why that is known"""
    read_only: _Objects = Field(default_factory=dict[str, str])
    """objects that it shows and does not let be written, and why that is known"""
    not_mappable: _Objects = Field(default_factory=dict[str, str])
    """objects that no PDO carries, and why that is known"""
    mode_shown: Literal["always", "enabled"] = "always"
    """"enabled": 6061 is 0 until the drive is enabled"""

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
    table = {"name": path.stem, **read_toml_table(path)}
    if isinstance(table.get("load"), dict):
        table["load_object"] = table.pop("load")
    return validated(path, table, DriveFamily, FORMAT)
