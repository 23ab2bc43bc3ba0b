"""Tables whose columns a small map file names: rows of numbers by column, any delimiter, decimal sign and padding."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field

from fidim_lab.data.files.toml_file import Table
from fidim_lab.data.importers.reading.cells import MIN_FRAMES, decimal_of, delimiter_of, number, read_export
from fidim_lab.errors import FileError

Column = str | Annotated[int, Field(ge=1)]
"""a column by its name in the header, or by its number from 1"""


class TableMap(Table):
    """What every map of a table says of the text itself."""

    time: Column
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None


def read_columns(path: Path, said: TableMap, wanted: Sequence[Column]) -> tuple[Float[np.ndarray, "N K"], str]:
    """The wanted columns of a table, and what was decided about a last line that was cut off.

    The first line names the columns where one of them is wanted by name, or where it holds no number. Raises FileError
    with line and column.
    """
    text = read_export(path)
    numbered = [(line, row) for line, row in enumerate(text.splitlines(), start=1) if row.strip()]
    rows = [row for _, row in numbered]
    delimiter = said.delimiter or delimiter_of(rows[:50])
    decimal = said.decimal or decimal_of(rows[1:50], delimiter)
    if decimal == delimiter:
        raise FileError(path, "", "the decimal sign is the delimiter too")
    split = [row.split(delimiter) for row in rows]
    named = any(isinstance(column, str) for column in wanted)
    headed = named or bool(split and not any(_is_number(cell, decimal) for cell in split[0]))
    header = [cell.strip().strip('"') for cell in split[0]] if split and headed else []
    places = [_place(path, header, column) for column in wanted]
    width = len(header) or max((len(cells) for cells in split[:50]), default=0)
    told = ""
    if split and len(split[-1]) < width and not text.endswith("\n"):
        split, numbered, told = split[:-1], numbered[:-1], "the last line was cut off and is left out"
    found: list[list[float]] = []
    for (line, _), cells in zip(numbered[headed:], split[headed:], strict=True):
        if len(cells) != width and not (len(cells) == width + 1 and not cells[-1].strip()):
            raise FileError(path, f"line {line}", f"{len(cells)} columns; {width} were expected")
        found.append(
            [number(path, line, at + 1, cells[at], decimal=decimal) if at < width else np.nan for at in places]
        )
    if len(found) < MIN_FRAMES:
        raise FileError(path, "", f"{len(found)} rows; a recording has at least {MIN_FRAMES}")
    if places and max(places) >= width:
        raise FileError(path, "", f"column {max(places) + 1} is wanted; there are {width}")
    return np.array(found), told


def _place(path: Path, header: Sequence[str], column: Column) -> int:
    if isinstance(column, int):
        return column - 1
    if header.count(column) != 1:
        raise FileError(path, "line 1", f"column {column[:60]!r} is not there once; found {', '.join(header)[:120]}")
    return header.index(column)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True
