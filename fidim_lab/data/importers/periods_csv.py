"""Periods of a pendulum as a person writes them into a table: a line of names, then one line for each timing.

    motion, l1, l2, swings, time (s), sd (s), amplitude (rad), tilt_x (deg), tilt_y (deg), tilt_sd (deg), note

`period` may stand for `time`: then it and `sd` are of one swing. A unit may follow a name in brackets; without one they
are s, m and rad. Any delimiter and decimal sign.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from fidim_lab.arrays import PerCable
from fidim_lab.data.files.mistakes import mistakes
from fidim_lab.data.importers.reading.cells import (
    LENGTH_UNITS,
    cells_of,
    decimal_of,
    delimiter_of,
    number,
    read_export,
)
from fidim_lab.data.period_table import PeriodMistake, PeriodTable, period_of
from fidim_lab.data.records import Period
from fidim_lab.errors import FileError

NAMED = re.compile(r"\s*\"?\s*([\w ]+?)\s*(?:[(\[]\s*([^)\]]*?)\s*[)\]])?\s*\"?\s*")
"""a column's name, and its unit in brackets"""
TIMES = MappingProxyType({"s": 1.0, "ms": 1e-3, "min": 60.0})
ANGLES = MappingProxyType({"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180})
UNITS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {name: TIMES for name in ("time", "period", "sd")}
    | {name: ANGLES for name in ("amplitude", "tilt_x", "tilt_y", "tilt_sd")}
)
"""in which a column may be, by its name"""
PLAIN = ("motion", "swings", "note")


@dataclass(frozen=True)
class _Column:
    name: str
    unit: float
    """s, m or rad in one of it"""
    title: str


@dataclass(frozen=True, eq=False)
class TimedRow:
    """A period, and where it stands."""

    path: Path
    line: int
    period: Period


def read_periods(path: Path, cables: int, lengths: PerCable | None = None) -> tuple[TimedRow, ...]:
    """The periods of a table, for a robot of so many cables; lengths: m, where the table has no column of them.

    Raises FileError with line and column, and what is allowed there.
    """
    lines = [(k, text) for k, text in enumerate(read_export(path).splitlines(), start=1) if text.strip(" \t\r;,")]
    lines = [(k, text) for k, text in lines if not text.lstrip().startswith("#")]
    if len(lines) < 2:
        what = f"{len(lines)} lines that are not blank; a line of names and one for each timing were expected"
        raise FileError(path, "", what, hint="Such as: motion,l1,l2,swings,time,sd")
    delimiter = delimiter_of([text for _, text in lines])
    decimal = decimal_of([text for _, text in lines[1:]], delimiter)
    columns = _columns(path, lines[0][0], cells_of(lines[0][1], delimiter), cables, taped=lengths is not None)
    found: list[TimedRow] = []
    for line, text in lines[1:]:
        cells = cells_of(text, delimiter)
        if any(cell.strip() for cell in cells[len(columns) :]):
            what = f"{len(cells)} cells, the names are {len(columns)}"
            raise FileError(path, f"line {line}", what, hint="A decimal comma needs another delimiter, such as ;.")
        found.append(TimedRow(path, line, _period(path, line, columns, cells, decimal, cables, lengths)))
    return tuple(found)


def _columns(path: Path, line: int, names: list[str], cables: int, *, taped: bool) -> list[_Column]:
    cords = [f"l{k}" for k in range(1, cables + 1)]
    allowed = {**{name: LENGTH_UNITS for name in cords}, **UNITS, **{name: {"": 1.0} for name in PLAIN}}
    found: list[_Column] = []
    for k, title in enumerate(names, start=1):
        here = f"line {line}, column {k}"
        named = NAMED.fullmatch(title)
        name, unit = (named[1].lower().replace(" ", "_"), named[2] or "") if named else ("", "")
        if name not in allowed:
            near = get_close_matches(name, allowed, 1)
            hint = f"Is it {near[0]}?" if near else "Leave the column out, or call it note."
            raise FileError(path, here, f"named {title.strip()[:30]!r}; allowed are {', '.join(allowed)}", hint=hint)
        if name in [one.name for one in found]:
            raise FileError(path, here, f"{name} stands twice; once is allowed")
        if unit and unit.lower() not in allowed[name]:
            units = ", ".join(one for one in allowed[name] if one) or "none"
            raise FileError(path, here, f"unit {unit[:20]!r} of {name}; allowed are {units}")
        found.append(_Column(name, allowed[name][unit.lower()] if unit else 1.0, title.strip()))
    have = {one.name for one in found}
    timed = ("period" if "period" in have else "time", "sd")
    missing = [name for name in (*timed, *(() if taped else cords)) if name not in have]
    if missing:
        hint = (
            "Lengths may be given by --lengths instead." if missing[0] in cords else "sd: standard deviation of time."
        )
        raise FileError(path, f"line {line}", f"no column {', '.join(missing)}", hint=hint)
    if taped and have & set(cords):
        raise FileError(path, f"line {line}", "columns of lengths beside --lengths; one of them is allowed")
    if {"time", "period"} <= have:
        raise FileError(path, f"line {line}", "columns time and period; one of them is allowed")
    return found


def _period(
    path: Path, line: int, columns: list[_Column], cells: list[str], decimal: str, cables: int, taped: PerCable | None
) -> Period:
    values: dict[str, Any] = {"lengths": [] if taped is None else taped.tolist()}
    angles: dict[str, float] = {}
    places: dict[str, int] = {}
    for k, (column, cell) in enumerate(zip(columns, cells, strict=False), start=1):
        name, text = column.name, cell.strip().strip('"').strip()
        if name == "note" or text in ("", "?"):
            continue
        if name == "motion":
            values["motion"], places["motion"] = text.lower(), k
            continue
        value = number(path, line, k, cell, decimal=decimal) * column.unit
        if not math.isfinite(value):
            continue
        key = "lengths" if name.startswith("l") else "tilt" if name in ("tilt_x", "tilt_y") else name
        places.setdefault(key, k)
        if key == "lengths":
            values["lengths"].append(value)
        elif key == "tilt":
            angles[name] = value
        else:
            values[key] = int(value) if name == "swings" and value % 1 == 0 else value
    if angles:
        values["tilt"] = [angles.get("tilt_x"), angles.get("tilt_y")]
    if "period" in values:
        swings = values.get("swings", 1)
        values["time"] = values.pop("period") * swings
        values |= {"sd": values["sd"] * swings} if "sd" in values else {}
    titles = {column.name: k for k, column in enumerate(columns, start=1)}

    def where(key: str) -> str:
        place = places.get(key) or titles.get(
            {"lengths": "l1", "tilt": "tilt_x"}.get(key, key), titles.get("period") if key == "time" else None
        )
        return f"line {line}, column {place} ({key})" if place else f"line {line}, {key}"

    try:
        table = PeriodTable.model_validate(values)
    except ValidationError as error:
        place, what, _ = mistakes(error.errors(), values)[0]
        raise FileError(path, where(str(place[0])), what) from None
    found = period_of(table, cables)
    if isinstance(found, PeriodMistake):
        raise FileError(path, where(found.key), found.what, hint=found.hint)
    return found
