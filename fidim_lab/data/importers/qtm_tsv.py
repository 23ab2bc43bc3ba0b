"""Qualisys Track Manager's TSV: header lines of a name and its value, then rows of markers (3D) or bodies (6D).

    NO_OF_FRAMES  500     FREQUENCY  100     DATA_INCLUDED  3D     MARKER_NAMES  A  B  C
    [Frame  Time]  A X  A Y  A Z …          the line of column names, and Frame and Time, may be left out

    DATA_INCLUDED  6D     BODY_NAMES  platform
    [Frame  Time]  X  Y  Z  Roll  Pitch  Yaw  Residual  Rot[0] … Rot[8]      for each body; Rot column by column

QTM writes millimetres; what was not seen is 0 0 0 or blank. Every mistake is a FileError with the line it is in.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.importers.reading.cells import MISSING, NO_HEADER, decimal_of, read_export, table
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
    filled = max((len(row) for row in lines[first : first + 1]), default=0)
    width = WIDTH[what] * len(names)
    lead = 2 if filled >= width + 2 and _counts(lines[first:]) else 0
    ends = range(lead, lead + width + 1, WIDTH[what])
    values = table(path, lines[first:], first + 1, lead + width, lead=lead, decimal=decimal, ends=ends)
    parts = values[:, lead:].reshape(len(values), len(names), WIDTH[what])
    positions = SCALE * parts[:, :, :3]
    frames = values[:, 0] if lead else np.arange(len(values), dtype=float)
    stamps = values[:, 1] if lead else np.full(len(values), np.nan)
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


def _of_numbers(cells: Sequence[str]) -> bool:
    """Whether a row begins with what stands for not seen, and numbers follow."""
    seen = [cell.strip() for cell in cells if cell.strip().lower() not in MISSING]
    return len(cells) > 2 and bool(seen) and not any(cell[0].isalpha() for cell in seen)


def _counts(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column counts frames."""
    firsts = [row[0].strip() for row in rows[:10]]
    return all(cell.isascii() and cell.isdigit() for cell in firsts)
