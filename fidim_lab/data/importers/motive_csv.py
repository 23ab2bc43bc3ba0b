"""OptiTrack Motive's "Tracking Data" CSV, format versions 1.1 to 1.25: its labelled markers.

    Format Version,1.23,Take Name,x,…,Export Frame Rate,120,…,Length Units,Meters,…

    ,Type,Marker,…            Rigid Body, Rigid Body Marker, Marker; rows ID, Parent follow in newer versions
    ,Name,platform:1,…
    ,,Position,Position,…     Rotation, Mean Marker Error and Marker Quality are left out
    Frame,Time (Seconds),X,Y,Z,…

Markers as the cameras saw them ("Marker") go before those that Motive set by its rigid body ("Rigid Body Marker").
Motive's axes are y-up. Every mistake is a FileError with line and column.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.importers.cells import check_near, length_scale, number, table, times
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

LEAD = 2
"""Frame, Time"""
MARKER_TYPES = ("Marker", "Rigid Body Marker")
"""in the order in which they are taken"""
MOST_HEADER = 12
"""lines"""


def read_motive(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    try:
        rows = list(csv.reader(read_text(path).splitlines()))
    except csv.Error as error:
        raise FileError(path, "", f"is no CSV: {error}") from None
    head = dict(zip(rows[0][::2], rows[0][1::2], strict=False)) if rows else {}
    if "Format Version" not in head:
        raise FileError(path, "line 1", "is no Tracking Data export: 'Format Version' was expected")
    at = next((k for k, row in enumerate(rows[:MOST_HEADER]) if row and row[0].strip() == "Frame"), 0)
    labels = {row[1].strip(): row for row in rows[1:at] if len(row) > LEAD and row[1].strip()}
    if not {"Type", "Name"} <= labels.keys():
        raise FileError(path, "", "no rows Type and Name above a row that begins with Frame")
    groups = _markers(labels["Type"], labels["Name"], rows[at - 1], rows[at])
    if not groups:
        raise FileError(path, "", "no labelled marker", hint="Export markers (or rigid body markers), not bodies only.")
    values = table(path, [_padded(row, len(rows[at])) for row in rows[at + 1 :]], at + 2, len(rows[at]), lead=LEAD)
    unit = head.get("Length Units", "Meters")
    scale = length_scale(path, "line 1, Length Units", unit)
    positions = scale * np.stack([values[:, columns] for columns in groups.values()], axis=1)
    check_near(path, positions, "check Length Units in line 1")
    rate = number(path, 1, 0, head.get("Export Frame Rate") or head.get("Capture Frame Rate") or "")
    said = (f"lengths in {unit.lower()}, {rate:g} Hz and y upwards: as line 1 and Motive's own axes say",)
    return MarkerLog(path, tuple(groups), rate, times(path, rate, values[:, 0]), positions, scale, "y", said)


def _padded(row: Sequence[str], width: int) -> Sequence[str]:
    """A frame whose blanks at the end were left out; a cut-off row keeps its length."""
    return [*row, *[""] * (width - len(row))] if len(row) <= LEAD else row


def _markers(
    types: Sequence[str], names: Sequence[str], what: Sequence[str], axes: Sequence[str]
) -> dict[str, list[int]]:
    """Columns of X, Y, Z by marker's name, of the first of `MARKER_TYPES` that there is."""
    for kind in MARKER_TYPES:
        found: dict[str, dict[str, int]] = {}
        for column, cells in enumerate(zip(types, names, what, axes, strict=False)):
            type_, name, quantity, axis = (cell.strip() for cell in cells)
            if type_ == kind and quantity == "Position" and axis in {"X", "Y", "Z"} and "Unlabel" not in name:
                found.setdefault(name, {}).setdefault(axis, column)
        whole = {name: [at[axis] for axis in "XYZ"] for name, at in found.items() if len(at) == 3}
        if whole:
            return whole
    return {}
