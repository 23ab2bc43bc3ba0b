"""Any table of marker places, by a column map "fidim-columns/1":

    format = "fidim-columns/1"
    time = "stamp"                 time_unit = "ms"          s, ms, us or ns, from any zero
    delimiter = ";"                decimal = ","             unit = "mm"      up = "z"
    [[marker]]
    name = "A"                     columns = ["ax", "ay", "az"]

The first line names the columns. Every mistake is a FileError with file and place.
"""

from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.importers.cells import MIN_FRAMES, check_long, check_near, check_rate, length_scale, number
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

FORMAT = "fidim-columns/1"
SECONDS = MappingProxyType({"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9})
UNEVEN = 0.45
"""of a step, by which a stamp may be away from even steps: more, and two samples share one"""


class MarkerColumns(Table):
    """`[[marker]]`."""

    name: Annotated[str, Field(min_length=1)]
    columns: tuple[str, str, str]


class ColumnMap(Table):
    """The whole of a column map."""

    format: Literal["fidim-columns/1"]
    time: str
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    unit: str = "m"
    up: Literal["y", "z"] = "z"
    marker: Annotated[tuple[MarkerColumns, ...], Field(min_length=1)]


def read_mapped(path: Path, map_file: Path) -> MarkerLog:
    """Read one table by its map. Raises FileError with line and column."""
    columns = read_toml(map_file, ColumnMap, FORMAT)
    if columns.decimal == columns.delimiter:
        raise FileError(map_file, "decimal", "is the delimiter too")
    lines = [line.split(columns.delimiter) for line in read_text(path).splitlines() if line.strip()]
    header = [cell.strip().strip('"') for cell in lines[0]] if lines else []
    wanted = [columns.time, *(name for marker in columns.marker for name in marker.columns)]
    missing = [name for name in wanted if header.count(name) != 1]
    if missing:
        raise FileError(path, "line 1", f"column {missing[0]!r} is not there once; found {', '.join(header)[:120]}")
    places = [header.index(name) for name in wanted]
    rows: list[list[float]] = []
    for line, cells in enumerate(lines[1:], start=2):
        if len(cells) != len(header):
            raise FileError(path, f"line {line}", f"{len(cells)} columns, the header has {len(header)}")
        rows.append([number(path, line, at + 1, cells[at], decimal=columns.decimal) for at in places])
    if len(rows) < MIN_FRAMES:
        raise FileError(path, "", f"{len(rows)} frames; a recording has at least {MIN_FRAMES}")
    values = np.array(rows)
    t, rate = _times(path, (values[:, 0] - values[0, 0]) * SECONDS[columns.time_unit])
    scale = length_scale(map_file, "unit", columns.unit)
    positions = scale * values[:, 1:].reshape(len(values), -1, 3)
    check_near(path, positions, f"check unit in {map_file.name}")
    names = tuple(marker.name for marker in columns.marker)
    said = (f"{rate:.4g} Hz by the stamps; lengths in {columns.unit}, {columns.up} upwards by {map_file.name}",)
    return MarkerLog(path, names, rate, t, positions, scale, columns.up, said)


def _times(path: Path, t: np.ndarray) -> tuple[np.ndarray, float]:
    """Times and rate of stamps that increase in even steps, with gaps. Raises FileError where they do not."""
    steps = np.diff(t)
    if not np.isfinite(t).all() or (steps <= 0.0).any():
        raise FileError(path, "time", "a sample without time, or time does not increase")
    rate = check_rate(path, float(1.0 / np.median(steps)))
    rate *= float(np.rint(t[-1] * rate) / (t[-1] * rate))
    off = np.abs(t * rate - np.rint(t * rate))
    if off.max() > UNEVEN or (np.diff(np.rint(t * rate)) == 0.0).any():
        raise FileError(path, "time", f"stamps are not in even steps of {1.0 / rate:.4g} s: bunched or jittering")
    return check_long(path, t, rate), rate
