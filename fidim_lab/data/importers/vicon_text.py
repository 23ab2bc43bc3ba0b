"""The text that Vicon Nexus and Tracker export as "Trajectories", as text (tabs) or CSV: one row a frame.

    Trajectories
    100                                                  rate, Hz
    <tab><tab>subject:marker1<tab><tab><tab>subject:marker2 …
    Frame  Sub Frame  X  Y  Z  X  Y  Z …
    <tab><tab>mm  mm  mm …
    1  0  80.3694  -39.55  806.314 …                     blank where a marker was not seen

Every mistake is a FileError with the line it is in.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.importers.cells import delimiter_of
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

HEADER_LINES = 5
FRAME_COLUMNS = 2
"""Frame, Sub Frame"""
MIN_FRAMES = 20
UNITS = {"mm": 1e-3, "m": 1.0}
FARTHEST = 1e3
"""m; a laboratory is smaller"""


def read_trajectories(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    text = read_text(path).splitlines()
    delimiter = delimiter_of(text[2:HEADER_LINES])
    lines = [line.split(delimiter) for line in text]
    if len(lines) < HEADER_LINES:
        raise FileError(path, "", f"{len(lines)} lines; a trajectory export has {HEADER_LINES} before its first frame")
    if lines[0][0].strip() != "Trajectories":
        raise FileError(path, "line 1", f"{lines[0][0][:40]!r} was found, 'Trajectories' was expected")
    rate = _rate(path, lines[1])
    names = _names(path, lines[2])
    _check_axes(path, lines[3], len(names))
    scale = _scale(path, lines[4], len(names))
    frames, values = _rows(path, lines[HEADER_LINES:], len(names))
    positions = scale * values.reshape(-1, len(names), 3)
    far = (np.abs(positions) > FARTHEST).any(axis=(1, 2))
    if far.any():
        frame = frames[int(np.argmax(far))]
        raise FileError(path, f"frame {frame:.0f}", f"a marker is over {FARTHEST:g} m away; check the units in line 5")
    return MarkerLog(path, names, rate, (frames - frames[0]) / rate, positions, scale)


def _rate(path: Path, cells: Sequence[str]) -> float:
    rate = _number(path, 2, 1, cells[0])
    if not 1.0 <= rate <= 1e4:
        raise FileError(path, "line 2", f"a frame rate of {cells[0].strip()!r} Hz; 1 to 10000 was expected")
    return rate


def _names(path: Path, cells: Sequence[str]) -> tuple[str, ...]:
    names = [cell.strip() for cell in cells[FRAME_COLUMNS::3]]
    while names and not names[-1]:  # the exporter ends the line with tabs
        names.pop()
    if not names:
        raise FileError(path, "line 3", "names no marker; they stand above every third column from the third on")
    for index, name in enumerate(names):
        if not name:
            raise FileError(path, f"line 3, column {FRAME_COLUMNS + 1 + 3 * index}", "a marker without a name")
        if name in names[:index]:
            raise FileError(path, "line 3", f"marker {name!r} is there twice")
    return tuple(names)


def _check_axes(path: Path, cells: Sequence[str], markers: int) -> None:
    found = [cell.strip() for cell in cells if cell.strip()]
    wanted = ["Frame", "Sub Frame"] + ["X", "Y", "Z"] * markers
    if found != wanted:
        raise FileError(
            path,
            "line 4",
            f"{len(found)} columns ({' '.join(found)[:60]}); "
            f"Frame, Sub Frame and X, Y, Z for each of {markers} markers were expected",
        )


def _scale(path: Path, cells: Sequence[str], markers: int) -> float:
    units = [cell.strip() for cell in cells if cell.strip()]
    if len(units) != 3 * markers or len(set(units)) != 1 or units[0] not in UNITS:
        raise FileError(
            path,
            "line 5",
            f"units {' '.join(sorted(set(units)))[:40]!r} for {len(units)} columns; "
            f"{3 * markers} times mm (or m) was expected",
        )
    return UNITS[units[0]]


def _rows(path: Path, lines: Sequence[Sequence[str]], markers: int) -> tuple[np.ndarray, np.ndarray]:
    """Frame numbers (N,) and values (N, 3 M), NaN where blank."""
    width = FRAME_COLUMNS + 3 * markers
    rows: list[list[float]] = []
    for line, cells in enumerate(lines, start=HEADER_LINES + 1):
        if not any(cell.strip() for cell in cells):
            continue
        cells = _with_trailing_blanks(cells, width)
        if len(cells) != width:
            raise FileError(
                path, f"line {line}", f"{len(cells)} columns, the header has {width}; is the file truncated?"
            )
        row = [_number(path, line, column, cell) for column, cell in enumerate(cells, start=1)]
        _check_frame(path, line, row[0], rows[-1][0] if rows else None)
        rows.append(row)
    if len(rows) < MIN_FRAMES:
        raise FileError(path, "", f"{len(rows)} frames; a recording has at least {MIN_FRAMES}")
    table = np.array(rows)
    return table[:, 0], table[:, FRAME_COLUMNS:]


def _with_trailing_blanks(cells: Sequence[str], width: int) -> Sequence[str]:
    """The cells of one row, without blanks beyond the header, and with those that the exporter left out at its end.

    It leaves out whole markers that were not seen: a row that ends within a marker stays short, for it was cut off.
    """
    filled = max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)
    whole = filled <= FRAME_COLUMNS or (filled - FRAME_COLUMNS) % 3 == 0
    return [*cells[:filled], *[""] * (width - filled)] if whole else cells[:filled]


def _check_frame(path: Path, line: int, frame: float, before: float | None) -> None:
    if not frame.is_integer():  # NaN too
        raise FileError(path, f"line {line}, column 1", "a frame without its number")
    if before is not None and frame <= before:
        raise FileError(path, f"line {line}, column 1", f"frame {frame:.0f} comes after frame {before:.0f}")


def _number(path: Path, line: int, column: int, cell: str) -> float:
    text = cell.strip()
    if not text:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        raise FileError(path, f"line {line}, column {column}", f"{text[:40]!r} is not a number")
    return value
