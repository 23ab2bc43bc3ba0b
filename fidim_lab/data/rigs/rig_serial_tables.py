"""`[release]`, `[load_cells]` and `[inclinometer]` of a rig file, as pydantic checks them."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from fidim_lab.data.files.toml_file import Name, Table
from fidim_lab.data.rigs.rig_serial import GaugeEntry, Loading, ReleaseEntry
from fidim_lab.errors import FileError
from fidim_lab.units import NEWTON_FOR, RADIAN_FOR

LOAD_CELL, INCLINATION = "f{}", "incl_{}"
"""columns of a window, as `own_sensors` and the report name them"""
_PLACE = re.compile(r"\{([^{}]*)\}")
_ANYTHING = "*"
COMMANDS = ("hold", "release", "ask")
"""keys whose texts are sent byte by byte"""


def _bytes(text: str) -> str:
    if not text:
        raise ValueError("is empty")
    if any(ord(letter) > 0xFF for letter in text):
        raise ValueError("a letter beyond one byte; binary bytes are written as \\u00A0")
    return text


def _one_or_more(table: object) -> object:
    return [table] if isinstance(table, dict) else table


Command = Annotated[str, AfterValidator(_bytes)]
Baud = Annotated[int, Field(ge=300, le=4_000_000)]
Answer = Annotated[str, Field(min_length=1, max_length=80)]
Seconds = Annotated[float, Field(gt=0, le=60)]


class ReleaseTable(Table):
    """`[release]`."""

    port: Name
    baud: Baud = 9600
    hold: Command
    release: Command
    ask: Command
    holds: Answer
    released: Answer
    loading: Loading = Loading.BY_HAND
    period: Seconds = 0.1
    timeout: Seconds = 1.0
    watchdog: Seconds = 1.0

    @model_validator(mode="after")
    def _distinct(self) -> "ReleaseTable":
        if len({self.hold, self.release, self.ask}) < 3:
            raise ValueError("hold, release, ask: are not three different commands")
        if self.holds.strip() == self.released.strip():
            raise ValueError("holds, released: the answers must differ")
        if self.watchdog < 3.0 * self.period:
            raise ValueError(f"watchdog: {self.watchdog:g} s, must be at least three periods of {self.period:g} s")
        return self


class GaugeTable(Table):
    """What load cells and inclinometers have in common."""

    port: Name
    baud: Baud = 115_200
    pattern: Annotated[str, Field(min_length=1, max_length=200)]
    offset: float = 0.0
    rate: Annotated[float, Field(gt=0, le=2000)]
    age: Seconds = 0.5
    uncertainty: Annotated[float, Field(ge=0)] = 0.0
    ask: Annotated[str, Field(max_length=40)] = ""

    @property
    def names(self) -> list[str]:
        """Of the numbers in a line."""
        return [name for name in _PLACE.findall(self.pattern) if name != _ANYTHING]

    @model_validator(mode="after")
    def _young(self) -> "GaugeTable":
        if self.age < 2.0 / self.rate:
            raise ValueError(
                f"age: {self.age:g} s, must be at least {2.0 / self.rate:g} s, two lines at {self.rate:g} Hz"
            )
        return self


class LoadCellsTable(GaugeTable):
    """`[load_cells]`, or one of `[[load_cells]]`: {1} in the pattern is the tension of cable 1."""

    unit: Literal["N", "kN", "kg", "lbf"]


class InclinometerTable(GaugeTable):
    """`[inclinometer]`: {x}, {y}, {z} in the pattern are rotations about the world's axes."""

    unit: Literal["rad", "mrad", "deg"]


SeveralLoadCells = Annotated[list[LoadCellsTable], BeforeValidator(_one_or_more)]


def release_entry(path: Path, table: ReleaseTable | None) -> ReleaseEntry | None:
    """The release of a rig file, its port's name as seen from the file's folder."""
    if table is None:
        return None
    commands = {key: getattr(table, key).encode("latin-1") for key in ("hold", "release", "ask")}
    plain = table.model_dump(include={"baud", "loading", "period", "timeout", "watchdog"})
    return ReleaseEntry(
        **plain, **commands, port=_port(path, table.port), holds=table.holds.strip(), released=table.released.strip()
    )


def gauge_entries(
    path: Path, cells: list[LoadCellsTable], inclinometer: InclinometerTable | None, cables: int
) -> tuple[GaugeEntry, ...]:
    """The measuring devices of a rig file. Raises FileError for a cable that there is not, or that has two cells."""
    entries: list[GaugeEntry] = []
    free = {str(cable): LOAD_CELL.format(cable) for cable in range(1, cables + 1)}
    for table in cells:
        columns = _columns(path, "load_cells", table, free)
        entries.append(_gauge(path, "load cells", table, NEWTON_FOR[table.unit], columns))
        free = {name: column for name, column in free.items() if name not in columns}
    if inclinometer is not None:
        axes = {axis: INCLINATION.format(axis) for axis in "xyz"}
        columns = _columns(path, "inclinometer", inclinometer, axes)
        if sorted(columns) not in (["x", "y"], ["x", "y", "z"]):
            raise FileError(path, "inclinometer, pattern", f"{inclinometer.pattern!r} must name {{x}} and {{y}}")
        entries.append(_gauge(path, "inclinometer", inclinometer, RADIAN_FOR[inclinometer.unit], columns))
    return tuple(entries)


def _columns(path: Path, key: str, table: GaugeTable, allowed: Mapping[str, str]) -> dict[str, str]:
    for name in table.names:
        if name not in allowed:
            known = ", ".join(f"{{{other}}}" for other in allowed)
            raise FileError(
                path, f"{key}, pattern", f"{{{name}}} in {table.pattern!r}: there are {known or 'no cables left'}"
            )
    if not table.names:
        raise FileError(
            path, f"{key}, pattern", f"{table.pattern!r} names no number, such as {{{next(iter(allowed))}}}"
        )
    return {name: allowed[name] for name in table.names}


def _gauge(path: Path, what: str, table: GaugeTable, scale: float, columns: Mapping[str, str]) -> GaugeEntry:
    plain = table.model_dump(include={"baud", "pattern", "offset", "rate", "age", "uncertainty"})
    return GaugeEntry(
        **plain,
        what=what,
        port=_port(path, table.port),
        scale=scale,
        ask=table.ask.encode("latin-1", errors="replace"),
        columns=columns,
    )


def _port(path: Path, port: str) -> str:
    """A URL, a device's name (COM3) or an absolute path as it is; a relative path from the rig file's folder."""
    return port if "://" in port or "/" not in port else str(path.parent / port)
