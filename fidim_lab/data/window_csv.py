"""Window files, `windows/ID.csv`: a header line, then one row a sample; a blank is a missing sample (NaN).

Named columns are t; x,y,z (main marker); m2x,m2y,m2z … (extra markers); l1…ln; i1…in. Further columns are kept.
"""

import math
import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.data.files.input_file import MIB, read_text, unseen
from fidim_lab.data.records import Window
from fidim_lab.errors import FileError

MIN_SAMPLES = 20
"""a window with fewer is too short to use"""

LIMIT = 32 * MIB
"""bytes, read in 3 s and 0.3 GB; ten minutes at 200 Hz are 20 MiB"""
MOST_COLUMNS = 512
"""of a header; a robot of five cables with ten markers has 41 of its own"""
FARTHEST = 1e12
"""largest value: also times of clocks that count from 1970 in ms are below"""

_PLAIN = re.compile(r"[0-9eE+., \t-]*")
"""what numbers in digits 0 to 9 are made of: float() takes 0.5_4 and ٠.٥ too"""
_NAMED = re.compile(r"t|[xyz]|m[1-9][0-9]*[xyz]|[li][1-9][0-9]*")


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
    text = read_text(path, LIMIT)
    lines = text.splitlines()
    if not lines:
        raise FileError(path, "line 1", "the file is empty; a header line was expected")
    columns = lines[0].count(",") + 1
    if columns > MOST_COLUMNS:
        raise FileError(path, "line 1", f"{columns} columns; at most {MOST_COLUMNS} are read")
    names = [name.strip() for name in lines[0].split(",")]
    _check_header(path, names)
    columns = dict(zip(names, _numbers(path, names, lines[1:]).T, strict=True))
    if text[-1] not in "\r\n":
        _check_cut(path, lines)
    t = columns["t"]
    _check_times(path, t)
    return WindowColumns(
        t=t,
        markers=_markers(path, columns),
        lengths=_per_cable(path, columns, "l", cables),
        currents=_per_cable(path, columns, "i", cables),
        further={name: values for name, values in columns.items() if not _NAMED.fullmatch(name)},
    )


def _check_header(path: Path, names: list[str]) -> None:
    for wanted in ("t", "x", "y", "z"):
        if wanted not in names:
            raise FileError(path, "line 1", f"column {wanted} is missing; found {', '.join(names)[:120]}")
    seen: set[str] = set()
    for index, name in enumerate(names):
        if not name:
            raise FileError(path, "line 1", f"column {index + 1} has no name")
        if unseen(name):
            raise FileError(path, "line 1", f"column {ascii(name)[:60]} holds a control character or a direction mark")
        if name in seen:
            raise FileError(path, "line 1", f"column {name} occurs twice")
        seen.add(name)


def _check_cut(path: Path, lines: Sequence[str]) -> None:
    """A last line without an end is whole unless its last number lacks decimals that all others have."""
    *others, last = (len(line.rpartition(",")[2].rpartition(".")[2]) for line in lines[1:] if line)
    if len(set(others)) == 1 and last < others[0]:
        what = (
            f"the file was cut: no line end, and {last} decimals in the last number where all others have {others[0]}"
        )
        raise FileError(path, f"line {len(lines)}", f"{what}. Remove that line, or copy the file again")


def _numbers(path: Path, names: list[str], lines: Sequence[str]) -> np.ndarray:
    """(N, C) values, NaN where blank."""
    values = array("d")
    for number, line in enumerate(lines, start=2):
        if not line:  # a blank line, as editors leave one at the end
            continue
        cells = line.split(",")
        if len(cells) != len(names):
            raise FileError(path, f"line {number}", f"{len(cells)} columns, the header has {len(names)}")
        row = _row(line, cells)
        if row is None:
            row = [_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)]
        values.extend(row)
    table = np.frombuffer(values).reshape(-1, len(names))
    if len(table) < MIN_SAMPLES:
        raise FileError(path, "", f"{len(table)} samples; a window needs at least {MIN_SAMPLES} to be of use")
    return table


def _row(line: str, cells: list[str]) -> list[float] | None:
    """A line of plain numbers; None for one to be looked at cell by cell: a blank in it, or a mistake."""
    try:
        row = list(map(float, cells))
    except ValueError:
        return None
    return row if _PLAIN.fullmatch(line) and max(row) <= FARTHEST and min(row) >= -FARTHEST else None


def _number(path: Path, line: int, column: str, cell: str) -> float:
    cell = cell.strip()
    if not cell:
        return math.nan
    place = f"line {line}, column {column[:40]}"
    try:
        value = float(cell)
    except ValueError:
        raise FileError(path, place, f"{ascii(cell)[:40]} is not a number") from None
    if not math.isfinite(value):
        raise FileError(path, place, f"{ascii(cell)[:40]} is not a finite number; leave a missing sample blank")
    if not _PLAIN.fullmatch(cell):
        raise FileError(path, place, f"{ascii(cell)[:40]} is not a number of digits 0 to 9")
    if abs(value) > FARTHEST:
        raise FileError(path, place, f"{cell[:40]} is not a measured value; at most {FARTHEST:g} is read")
    return value


def _check_times(path: Path, t: np.ndarray) -> None:
    for index in np.flatnonzero(np.isnan(t)):
        raise FileError(path, f"line {index + 2}, column t", "a sample without its time")
    for index in np.flatnonzero(np.diff(t) <= 0):
        what = "repeats" if t[index + 1] == t[index] else "goes back from"
        raise FileError(path, f"line {index + 3}", f"time {t[index + 1]:g} s {what} {t[index]:g} s of the row before")


def _markers(path: Path, columns: dict[str, np.ndarray]) -> np.ndarray:
    markers = [np.stack([columns[axis] for axis in "xyz"], axis=1)]
    found = {m.group(1) for name in columns if (m := re.fullmatch(r"m([0-9]+)[xyz]", name))}
    for number in sorted(found, key=lambda digits: (len(digits), digits)):
        names = [f"m{number}{axis}" for axis in "xyz"]
        missing = [name for name in names if name not in columns]
        if missing:
            raise FileError(path, "line 1", f"marker {number} lacks column {', '.join(missing)}")
        expected = f"{len(markers) + 1}"
        if number != expected:
            raise FileError(path, "line 1", f"marker m{expected} is missing; extra markers are m2, m3, … without a gap")
        markers.append(np.stack([columns[name] for name in names], axis=1))
    return np.stack(markers, axis=1)


def _per_cable(path: Path, columns: dict[str, np.ndarray], letter: str, cables: int) -> np.ndarray | None:
    present = [name for name in columns if re.fullmatch(rf"{letter}[1-9][0-9]*", name)]
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


def named(window: WindowColumns | Window) -> tuple[list[str], Float[np.ndarray, "N columns"]]:
    """All columns of a window side by side, as its file has them, and their names."""
    samples, markers, _ = window.markers.shape
    per_cable = [series for series in (window.lengths, window.currents) if series is not None]
    names = header(
        per_cable[0].shape[1] if per_cable else 0,
        markers,
        lengths=window.lengths is not None,
        currents=window.currents is not None,
        further=list(window.further),
    )
    return names, np.column_stack([window.t, window.markers.reshape(samples, -1), *per_cable, *window.further.values()])


def write_window_csv(path: Path, columns: WindowColumns) -> None:
    """Write one window; `read_window_csv` reads it back to within the written decimals."""
    names, values = named(columns)
    lines = [",".join(names), *(row(names, line) for line in values)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
