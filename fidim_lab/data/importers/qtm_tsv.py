"""Qualisys Track Manager's TSV of marker places (3D): header lines of a name and its value, then one row a frame.

    NO_OF_FRAMES  500     FREQUENCY  100     MARKER_NAMES  A  B  C     DATA_INCLUDED  3D
    [Frame  Time]  A X  A Y  A Z …          the line of column names, and Frame and Time, may be left out

QTM writes millimetres; an unseen marker is 0 0 0 or blank. Every mistake is a FileError with the line it is in.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.importers.cells import check_near, number, table, times
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

SCALE = 1e-3


def read_qtm(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    lines = [line.split("\t") for line in read_text(path).splitlines()]
    head, first = _head(lines)
    if "FREQUENCY" not in head or "MARKER_NAMES" not in head:
        raise FileError(path, "line 1", "FREQUENCY or MARKER_NAMES is missing: is it QTM's TSV with its header?")
    if head.get("DATA_INCLUDED", ["3D"])[0] != "3D":
        raise FileError(path, "DATA_INCLUDED", "is not 3D", hint="Export the markers (3D) as TSV.")
    names = tuple(name for name in head["MARKER_NAMES"] if name)
    if not names or len(set(names)) < len(names):
        raise FileError(path, "MARKER_NAMES", "no marker, or one name twice")
    filled = max((len(row) for row in lines[first : first + 1]), default=0)
    lead = 2 if filled >= 3 * len(names) + 2 and _counts(lines[first:]) else 0
    values = table(path, lines[first:], first + 1, lead + 3 * len(names), lead=lead)
    positions = SCALE * values[:, lead:].reshape(len(values), -1, 3)
    check_near(path, positions, "QTM writes millimetres")
    rate = number(path, 1, 2, head["FREQUENCY"][0])
    frames = values[:, 0] if lead else np.arange(len(values), dtype=float)
    said = (f"lengths in mm and z upwards, as QTM exports them by default; {rate:g} Hz as the header says",)
    return MarkerLog(path, names, rate, times(path, rate, frames), positions, SCALE, "z", said)


def _head(lines: Sequence[Sequence[str]]) -> tuple[dict[str, list[str]], int]:
    """Values by name, and the index of the first row of numbers."""
    head: dict[str, list[str]] = {}
    for index, cells in enumerate(lines):
        name = cells[0].strip()
        if name and not name[0].isalpha():
            return head, index
        if name.isupper():
            head[name] = [cell.strip() for cell in cells[1:]] or [""]
    return head, len(lines)


def _counts(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column counts frames."""
    firsts = [row[0].strip() for row in rows[:10]]
    return all(cell.isascii() and cell.isdigit() for cell in firsts)
