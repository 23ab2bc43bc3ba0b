"""Qualisys Track Manager's TSV: header lines of a name and its value, then rows of markers (3D) or bodies (6D).

    NO_OF_FRAMES  500     FREQUENCY  100     DATA_INCLUDED  3D     MARKER_NAMES  A  B  C
    [Frame  Time]  A X  A Y  A Z …          the line of column names, and Frame or Time or both, may be left out;
                                            A Residual may follow

    DATA_INCLUDED  6D     BODY_NAMES  platform
    [Frame  Time]  X  Y  Z  Roll  Pitch  Yaw  Residual  Rot[0] … Rot[8]      for each body; Rot column by column

QTM writes millimetres; what was not seen is 0 0 0 or blank. Every mistake is a FileError with the line it is in.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.importers.reading.cells import MISSING, NO_HEADER, decimal_of, is_number, read_export, table
from fidim_lab.data.importers.reading.clock import clocked, header_rate
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.reading.poses import by_matrices
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.errors import FileError

SCALE = 1e-3
NAMES = {"3D": "MARKER_NAMES", "6D": "BODY_NAMES"}
WIDTH = {"3D": 3, "6D": 16}
"""columns of one marker, one body"""
ROTATION = slice(7, 16)
MOST_LEAD = 3
"""columns before the data: frame, time, time code"""


def read_qtm(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    text = read_export(path).splitlines()
    lines = [line.split("\t") for line in text]
    head, first = _head(lines)
    what = head.get("DATA_INCLUDED", ["6D" if "BODY_NAMES" in head else "3D"])[0]
    if what not in NAMES:
        raise FileError(path, "DATA_INCLUDED", f"is {what[:20]!r}; 3D or 6D was expected")
    missing = [name for name in ("FREQUENCY", NAMES[what]) if name not in head]
    if missing:
        hint = f"Export 3D or 6D data with the TSV header; skeletons, forces, analog data are not read. {NO_HEADER}"
        raise FileError(path, "header", f"{' and '.join(missing)} not found.", hint=hint)
    names = tuple(name for name in head[NAMES[what]] if name)
    if not names or (what == "6D" and len(set(names)) < len(names)):
        raise FileError(path, NAMES[what], "no name, or one body's name twice")
    decimal = decimal_of(text[first : first + 50], "\t")
    if what == "3D":
        lines = _without_residuals(lines, first, len(names), decimal)
    width = WIDTH[what] * len(names)
    lead = _lead(path, _without_last_tab(lines[first:], width, WIDTH[what]), first, width, decimal)
    count, time = (next((k for k, kind in enumerate(lead) if kind == one), None) for one in ("frame", "time"))
    known = [k in (count, time) for k in range(len(lead))]
    rows = [[cell if k >= len(lead) or known[k] else "" for k, cell in enumerate(row)] for row in lines[first:]]
    ends = range(len(lead), len(lead) + width + 1, WIDTH[what])
    values = table(path, rows, first + 1, len(lead) + width, lead=len(lead), decimal=decimal, ends=ends)
    parts = values[:, len(lead) :].reshape(len(values), len(names), WIDTH[what])
    positions = SCALE * parts[:, :, :3]
    frames = np.arange(len(values), dtype=float) if count is None else values[:, count]
    stamps = np.full(len(values), np.nan) if time is None else values[:, time]
    t, rate, doubt = clocked(path, header_rate(path, 1, head["FREQUENCY"][0]), frames, stamps)
    said = (f"lengths in mm and z upwards, as QTM exports them by default; {rate:g} Hz as the header says",)
    if what == "3D":
        names, positions, loose = apart(names, positions)
        return MarkerLog(path, names, rate, t, positions, SCALE, "z", said, unlabelled=loose, rate_doubt=doubt)
    bodies = tuple(_body(path, name, positions[:, k], parts[:, k, ROTATION]) for k, name in enumerate(names))
    return MarkerLog(path, (), rate, t, np.zeros((len(t), 0, 3)), SCALE, "z", said, bodies, rate_doubt=doubt)


def _body(path: Path, name: str, positions: np.ndarray, columns: np.ndarray) -> BodyTrack:
    unseen = (positions == 0.0).all(axis=1)
    matrices = columns.reshape(-1, 3, 3).swapaxes(1, 2).copy()
    matrices[unseen] = np.nan
    return by_matrices(path, name, positions, matrices)


def _head(lines: Sequence[Sequence[str]]) -> tuple[dict[str, list[str]], int]:
    """Values by name, and the index of the first row of numbers."""
    head: dict[str, list[str]] = {}
    for index, cells in enumerate(lines):
        name = cells[0].strip()
        if (name and not name[0].isalpha()) or (head.keys() & NAMES.values() and _of_numbers(cells)):
            return head, index
        if name.isupper() and len(name) > 1:
            head[name] = [cell.strip() for cell in cells[1:]] or [""]
    return head, len(lines)


def _without_residuals(
    lines: Sequence[Sequence[str]], first: int, markers: int, decimal: str
) -> Sequence[Sequence[str]]:
    """Rows without the residual that may stand behind the place of each marker.

    The line above the first row names it; without that line, rows of four numbers for each marker show it, since before
    the first marker stand a frame, a time and a time code at the most.
    """
    names = [cell.strip() for cell in lines[first - 1]] if first else []
    at = [k for k, name in enumerate(names) if name.lower().endswith("residual")]
    named = bool(at) or any(name.upper().endswith((" X", "_X")) for name in names)
    widths = {len([*row[:-1], *filter(None, (row[-1].strip(),))]) for row in lines[first : first + 10] if len(row) > 1}
    before = max(widths, default=0) - (WIDTH["3D"] + 1) * markers
    if not named and markers > MOST_LEAD and 0 <= before <= MOST_LEAD:
        at = [before + WIDTH["3D"] + (WIDTH["3D"] + 1) * k for k in range(markers)]
    if len(at) != markers:
        return lines
    dropped = frozenset(at)
    return [row if k < first else [c for j, c in enumerate(row) if j not in dropped] for k, row in enumerate(lines)]


def _of_numbers(cells: Sequence[str]) -> bool:
    """Whether a row begins with what stands for not seen, and numbers follow."""
    seen = [cell.strip() for cell in cells if cell.strip().lower() not in MISSING]
    return len(cells) > 2 and bool(seen) and not any(cell[0].isalpha() for cell in seen)


def _without_last_tab(rows: Sequence[Sequence[str]], width: int, each: int) -> Sequence[Sequence[str]]:
    """The first rows less the blank cell after a tab that ends each; a last marker that is never seen has `each`."""
    head = rows[:10]
    whole = [row for row in rows if len(row) == len(rows[0]) > width]
    ended = not any(row[-1].strip() for row in whole)
    seen = any(cell.strip() for row in whole for cell in row[-each:])
    return [row[:-1] for row in head] if ended and seen else head


def _lead(path: Path, rows: Sequence[Sequence[str]], first: int, width: int, decimal: str) -> list[str]:
    """What each column before the data has: "frame", "time", or "" for what is no number, such as a time code.

    rows: the first of them; whole numbers count frames. Raises FileError where names and columns do not go together.
    """
    columns = [[row[k].strip() for row in rows if k < len(row)] for k in range(len(rows[0]) - width if rows else 0)]
    numbers = [all(is_number(cell, decimal) for cell in column) for column in columns]
    kinds = [_counts(column) or ("time" if known else "") for column, known in zip(columns, numbers, strict=True)]
    if any(kinds.count(kind) > 1 for kind in ("frame", "time")):
        what = f"{len(rows[0])} columns; the header's names make {width}, with one of frames and one of times before."
        raise FileError(path, f"line {first + 1}", what, hint="Name every trajectory or body in QTM, and export again.")
    return kinds


def _counts(column: Sequence[str]) -> str:
    return "frame" if all(cell.isascii() and cell.isdigit() for cell in column) else ""
