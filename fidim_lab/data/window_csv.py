"""Window files, `windows/ID.csv`: a header line, then one row a sample; a blank is a missing sample (NaN).

Named columns are t; x,y,z (main marker); m2x,m2y,m2z … (extra markers); l1…ln; i1…in. Further columns are kept.
"""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.data.input_file import read_text
from fidim_lab.errors import FileError

MIN_SAMPLES = 20
"""a window with fewer is too short to use"""

_NAMED = re.compile(r"t|[xyz]|m[1-9]\d*[xyz]|[li][1-9]\d*")


@dataclass(frozen=True, eq=False)
class WindowColumns:
    """The columns of one window file, still without their meaning for a campaign."""

    t: np.ndarray
    """(N,) s"""
    markers: np.ndarray
    """(N, M, 3) m"""
    lengths: np.ndarray | None
    """(N, n) m"""
    currents: np.ndarray | None
    """(N, n) A"""
    further: dict[str, np.ndarray]


def read_window_csv(path: Path, cables: int) -> WindowColumns:
    """Read one window of a robot with `cables` cables. Raises FileError with file and line."""
    lines = read_text(path).splitlines()
    if not lines:
        raise FileError(path, "line 1", "the file is empty; a header line was expected")
    names = [name.strip() for name in lines[0].split(",")]
    _check_header(path, names)
    columns = dict(zip(names, _numbers(path, names, lines[1:]).T, strict=True))
    t = columns["t"]
    _check_times(path, t)
    markers = _markers(path, columns)
    return WindowColumns(
        t=t,
        markers=markers,
        lengths=_per_cable(path, columns, "l", cables),
        currents=_per_cable(path, columns, "i", cables),
        further={name: values for name, values in columns.items() if not _NAMED.fullmatch(name)},
    )


def _check_header(path: Path, names: list[str]) -> None:
    for wanted in ("t", "x", "y", "z"):
        if wanted not in names:
            raise FileError(path, "line 1", f"column {wanted} is missing; found {', '.join(names)[:120]}")
    for index, name in enumerate(names):
        if not name:
            raise FileError(path, "line 1", f"column {index + 1} has no name")
        if name in names[:index]:
            raise FileError(path, "line 1", f"column {name} is there twice")


def _numbers(path: Path, names: list[str], lines: Sequence[str]) -> np.ndarray:
    """(N, C) values, NaN where blank."""
    rows: list[list[float]] = []
    for number, cells in enumerate(csv.reader(lines), start=2):
        if not cells:  # a blank line, as editors leave one at the end
            continue
        if len(cells) != len(names):
            raise FileError(path, f"line {number}", f"{len(cells)} columns, the header has {len(names)}")
        rows.append([_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)])
    if len(rows) < MIN_SAMPLES:
        raise FileError(path, "", f"{len(rows)} samples; a window needs at least {MIN_SAMPLES} to be of use")
    return np.array(rows)


def _number(path: Path, line: int, column: str, cell: str) -> float:
    cell = cell.strip()
    if not cell:
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        raise FileError(path, f"line {line}, column {column}", f"{cell[:40]!r} is not a number") from None
    if not math.isfinite(value):
        raise FileError(
            path, f"line {line}, column {column}", f"{cell!r} is not a finite number; leave a missing sample blank"
        )
    return value


def _check_times(path: Path, t: np.ndarray) -> None:
    for index in np.flatnonzero(np.isnan(t)):
        raise FileError(path, f"line {index + 2}, column t", "a sample without its time")
    for index in np.flatnonzero(np.diff(t) <= 0):
        what = "repeats" if t[index + 1] == t[index] else "goes back from"
        raise FileError(path, f"line {index + 3}", f"time {t[index + 1]:g} s {what} {t[index]:g} s of the row before")


def _markers(path: Path, columns: dict[str, np.ndarray]) -> np.ndarray:
    markers = [np.stack([columns[axis] for axis in "xyz"], axis=1)]
    numbers = sorted({int(m.group(1)) for name in columns if (m := re.fullmatch(r"m(\d+)[xyz]", name))})
    for index, number in enumerate(numbers, start=2):
        names = [f"m{number}{axis}" for axis in "xyz"]
        missing = [name for name in names if name not in columns]
        if missing:
            raise FileError(path, "line 1", f"marker {number} lacks column {', '.join(missing)}")
        if number != index:
            raise FileError(path, "line 1", f"marker m{index} is missing; extra markers are m2, m3, … without a gap")
        markers.append(np.stack([columns[name] for name in names], axis=1))
    return np.stack(markers, axis=1)


def _per_cable(path: Path, columns: dict[str, np.ndarray], letter: str, cables: int) -> np.ndarray | None:
    present = [name for name in columns if re.fullmatch(rf"{letter}[1-9]\d*", name)]
    wanted = [f"{letter}{cable}" for cable in range(1, cables + 1)]
    if not present:
        return None
    if sorted(present) != sorted(wanted):
        raise FileError(
            path,
            "line 1",
            f"columns {', '.join(present)} for a robot of {cables} cables; {', '.join(wanted)} were expected",
        )
    return np.stack([columns[name] for name in wanted], axis=1)


DECIMALS = {"t": 4, "l": 6, "i": 4}
"""decimals written for times (s), lengths (m), currents (A); anything else gets MARKER_DECIMALS"""
MARKER_DECIMALS = 6


def header(
    cables: int, markers: int, *, lengths: bool = True, currents: bool = True, further: Sequence[str] = ()
) -> list[str]:
    """The column names of a window with so many cables and markers."""
    names = ["t", "x", "y", "z"]
    names += [f"m{m}{axis}" for m in range(2, markers + 1) for axis in "xyz"]
    names += [f"l{c}" for c in range(1, cables + 1)] if lengths else []
    names += [f"i{c}" for c in range(1, cables + 1)] if currents else []
    return names + list(further)


def row(names: Sequence[str], values: Sequence[float]) -> str:
    """One line of a window file, without its end; NaN becomes blank."""
    return ",".join(_cell(name, value) for name, value in zip(names, values, strict=True))


def _cell(name: str, value: float) -> str:
    if math.isnan(value):
        return ""
    decimals = DECIMALS.get(name[0], MARKER_DECIMALS) if _NAMED.fullmatch(name) else MARKER_DECIMALS
    return f"{value:.{decimals}f}"


def write_window_csv(path: Path, columns: WindowColumns) -> None:
    """Write one window; `read_window_csv` reads it back to within the written decimals."""
    samples, markers, _ = columns.markers.shape
    per_cable = [series for series in (columns.lengths, columns.currents) if series is not None]
    names = header(
        per_cable[0].shape[1] if per_cable else 0,
        markers,
        lengths=columns.lengths is not None,
        currents=columns.currents is not None,
        further=list(columns.further),
    )
    values = np.column_stack([columns.t, columns.markers.reshape(samples, -1), *per_cable, *columns.further.values()])
    lines = [",".join(names), *(row(names, line) for line in values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
