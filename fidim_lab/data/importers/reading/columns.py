"""Tables whose columns a small map file names: rows of numbers by column, any delimiter, decimal sign and padding."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field

from fidim_lab.data.files.toml_file import Table, nearest
from fidim_lab.data.importers.reading.as_table import read_table
from fidim_lab.data.importers.reading.cells import (
    MIN_FRAMES,
    cells_of,
    decimal_of,
    delimiter_of,
    is_dated,
    is_number,
    moment,
    number,
)
from fidim_lab.data.importers.reading.clock import over_midnight
from fidim_lab.errors import FileError
from fidim_lab.say import counted

Column = str | Annotated[int, Field(ge=1)]
"""a column by its name in the header, or by its number from 1"""
EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)
"""first line by which Excel is told the delimiter"""
COMMENTS = ("#", "%")
PARTS = MappingProxyType({"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9})
"""s in one unit of a column that has what stamps have below a second, by its key in a map"""
TOP = 50
"""lines in which names and the first numbers stand"""


class TableMap(Table):
    """What every map of a table says of the text itself."""

    time: Column
    date: Column | None = None
    milliseconds: Column | None = None
    microseconds: Column | None = None
    nanoseconds: Column | None = None
    time_unit: Literal["s", "ms", "us", "ns", "d"] | None = None
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None


@dataclass(frozen=True)
class ColumnTable:
    """The wanted columns of a table."""

    values: Float[np.ndarray, "N K"]
    """the first of them is the time"""
    dated: bool
    """whether times are dates, times of day, or have their parts below a second by themselves: then they are in s"""
    decided: tuple[str, ...]
    """what was decided, a sentence each"""


def read_columns(path: Path, said: TableMap, wanted: Sequence[Column], wanted_by: str) -> ColumnTable:
    """The wanted columns of a table, the time first; wanted_by: who names them, for the message.

    The header is the first of the lines at the top that has every wanted name; lines above it, comments and a row of
    units below it are passed over, as are lines below the last time and where names are repeated. Where all columns are
    numbers, the table begins with the first time. Raises FileError with line and column.
    """
    text = read_table(path)
    numbered = [(line, row) for line, row in enumerate(text.splitlines(), start=1) if row.strip()]
    mark = said.delimiter
    if numbered and (named := EXCEL.fullmatch(numbered[0][1].strip())):
        numbered, mark = numbered[1:], mark or named[1]
    rows = [row for _, row in numbered]
    delimiter = mark or delimiter_of(rows[:TOP])
    decimal = said.decimal or decimal_of(rows[1:TOP], delimiter)
    if decimal == delimiter and not any('"' in row for row in rows[1:TOP]):
        raise FileError(path, "", "the decimal sign is the delimiter too")
    split = [cells_of(row, delimiter) for row in rows]
    parts = {name: getattr(said, name) for name in PARTS if getattr(said, name) is not None}
    wanted = [*wanted, *parts.values()]
    at, header = _header(split, [*wanted, *([] if said.date is None else [said.date])])
    places = [_place(path, header, column, wanted_by) for column in wanted]
    if said.date is not None:
        day = _place(path, header, said.date, wanted_by)
        split = [_with_date(cells, places[0], day) for cells in split]
    below = split[at + 1 :] if header else split
    skipped = next((k for k, cells in enumerate(below[:TOP]) if _is_time(cells, places[0], decimal)), 0)
    first = len(split) - len(below) + skipped
    width = max(len(header), *(len(cells) for cells in split[first : first + TOP] or [[]]))
    decided = [f"{skipped} lines below the names of the columns are ignored"] if header and skipped else []
    if split and len(split[-1]) < width and not text.endswith("\n"):
        split, numbered = split[:-1], numbered[:-1]
        decided.append("the last line was cut off and is left out")
    last = next((k for k in reversed(range(first, len(split))) if _is_time(split[k], places[0], decimal)), first) + 1
    below = [cells[0] for (_, row), cells in zip(numbered[last:], split[last:], strict=True) if not _is_comment(row)]
    if below:
        decided.append(f"{counted(len(below), 'line')} below the numbers ignored, from {below[0].strip()[:40]!r} on")
    found: list[list[float]] = []
    names = rows[at].strip() if header else ""
    for (line, row), cells in zip(numbered[first:last], split[first:last], strict=True):
        if _is_comment(row) or row.strip() == names:
            continue
        if len(cells) != width and not (len(cells) == width + 1 and not cells[-1].strip()):
            raise FileError(path, f"line {line}", f"{len(cells)} columns; {width} were expected")
        found.append(_numbers(path, line, cells, places, decimal))
    if places and max(places) >= width:
        raise FileError(path, "", f"column {max(places) + 1} is wanted; there are {width}")
    if len(found) < MIN_FRAMES:
        raise FileError(path, "", f"{len(found)} rows; a recording has at least {MIN_FRAMES}")
    dated = len(split[first]) > places[0] and is_dated(split[first][places[0]])
    values = np.array(found)
    if dated:
        values[:, 0] = over_midnight(values[:, 0])
    if not parts:
        return ColumnTable(values, dated, tuple(decided))
    values[:, 0] += values[:, -len(parts) :] @ [PARTS[name] for name in parts]
    return ColumnTable(values[:, : -len(parts)], True, tuple(decided))


def _is_comment(row: str) -> bool:
    return row.lstrip().startswith(COMMENTS)


def _with_date(cells: Sequence[str], time: int, date: int) -> list[str]:
    """A row with the date of another column before its time."""
    told = len(cells) > max(time, date) and ":" in cells[time]
    return [f"{cells[date].strip()} {cell.strip()}" if told and k == time else cell for k, cell in enumerate(cells)]


def _numbers(path: Path, line: int, cells: Sequence[str], places: Sequence[int], decimal: str) -> list[float]:
    """The wanted cells of a row, NaN beyond its end; the first is a time."""
    read = [moment, *[number] * (len(places) - 1)]
    return [
        one(path, line, at + 1, cells[at], decimal=decimal) if at < len(cells) else np.nan
        for one, at in zip(read, places, strict=True)
    ]


def _header(split: Sequence[Sequence[str]], wanted: Sequence[Column]) -> tuple[int, list[str]]:
    """Which row names the columns, and the names; no names where none of them is wanted by name."""
    names = {column for column in wanted if isinstance(column, str)}
    if not names:
        return 0, []
    rows = [without_mark(cells) for cells in split[:TOP]]
    at = next((k for k, row in enumerate(rows) if names <= set(row)), 0)
    return at, rows[at] if rows else []


def without_mark(cells: Sequence[str]) -> list[str]:
    """Names of columns without the sign of a comment before them."""
    cells = cells[1:] if cells and cells[0].strip() in COMMENTS else cells
    return [cell.strip().lstrip("".join(COMMENTS)).strip().strip('"') for cell in cells]


def _place(path: Path, header: Sequence[str], column: Column, wanted_by: str) -> int:
    if isinstance(column, int):
        return column - 1
    if header.count(column) != 1:
        what = "stands there more than once" if column in header else "is not there"
        near = "" if column in header else nearest(column.lower(), [name.lower() for name in header])
        meant = next((f"The nearest is {name!r}. " for name in header if near and name.lower() == near), "")
        found = f"column {column[:60]!r} {what}; found {', '.join(header)[:120]}"
        raise FileError(path, "line 1", found, hint=f"{meant}{wanted_by}")
    return header.index(column)


def _is_time(cells: Sequence[str], at: int, decimal: str) -> bool:
    if at >= len(cells) or _is_comment("".join(cells)):
        return False
    return is_number(cells[at], decimal) or is_dated(cells[at])
