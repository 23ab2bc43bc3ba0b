"""OptiTrack Motive's "Tracking Data" CSV, format versions 1.1 to 1.25: labelled and loose markers, rigid bodies.

    Format Version,1.23,Take Name,x,…,Export Frame Rate,120,…,Rotation Type,Quaternion,Length Units,Meters,…

    ,Type,Rigid Body,…,Marker,…     Rigid Body, Rigid Body Marker, Marker; rows ID, Parent follow in newer versions
    ,Name,platform,…,platform:1,…   "Unlabeled 1234" was given to no marker
    ,,Rotation,…,Position,…         Mean Marker Error and Marker Quality are left out
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,…

Markers as the cameras saw them ("Marker") go before those that Motive set by what it solved ("Rigid Body Marker").
Rotations are quaternions, or angles in degrees, about the body's own axes in the order that line 1 says ("XYZ").
Motive's axes are y-up unless its export was told otherwise. Every mistake is a FileError with line and column.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.data.importers.reading.cells import (
    NO_HEADER,
    decimal_of,
    delimiter_of,
    length_scale,
    read_export,
    table,
)
from fidim_lab.data.importers.reading.clock import clocked, header_rate
from fidim_lab.data.importers.reading.labels import is_loose
from fidim_lab.data.importers.reading.poses import by_matrices, by_quaternions
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.errors import FileError

LEAD = 2
"""Frame, Time"""
BODY, MARKER = "Rigid Body", "Marker"
"""types of columns; "Rigid Body Marker" and others that end so are set by what was solved"""
QUATERNION = "Quaternion"
MOST_HEADER = 12
"""lines"""

Columns = dict[tuple[str, str], dict[str, int]]
"""by type and name: column of "Position X" and so on"""


def read_motive(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    try:
        text = read_export(path).splitlines()
        delimiter = delimiter_of(text[:1])
        rows = list(csv.reader(text, delimiter=delimiter))
    except csv.Error as error:
        raise FileError(path, "", f"is not a CSV: {error}") from None
    head = dict(zip(rows[0][::2], rows[0][1::2], strict=False)) if rows else {}
    if "Format Version" not in head:
        what = "is not a Tracking Data export: 'Format Version' was expected."
        raise FileError(path, "line 1", what, hint=NO_HEADER)
    if head.get("Coordinate Space", "Global").strip().lower() == "local":
        what = "'Local': places are given in the frame of what they belong to, which moves."
        raise FileError(path, "line 1, Coordinate Space", what, hint="Export with Coordinate Space: Global.")
    rows = _without_timecode(rows)
    at = next((k for k, row in enumerate(rows[:MOST_HEADER]) if row and row[0].strip() == "Frame"), 0)
    labels = _labels(rows[1:at])
    if not {"Type", "Name"} <= labels.keys():
        raise FileError(path, "", "no rows Type and Name above a row that begins with Frame")
    found = _columns(path, labels["Type"], labels["Name"], rows[at - 1], rows[at])
    things = list(zip(labels["Type"], labels["Name"], strict=False))
    ends = {k for k in range(LEAD, len(things)) if things[k] != things[k - 1]}  # errors and qualities belong to a thing
    ends |= {max(columns.values()) + 1 for columns in found.values()}
    decimal = decimal_of(text[at + 1 : at + 51], delimiter)
    values = table(path, rows[at + 1 :], at + 2, len(rows[at]), lead=LEAD, ends=ends, decimal=decimal)
    unit = head.get("Length Units", "")
    scale = length_scale(path, "line 1, Length Units", unit) if unit else 1.0
    labelled, loose, solved = _markers(found)
    turns = head.get("Rotation Type", QUATERNION).strip()
    unknown = turns != QUATERNION and sorted(turns.upper()) != ["X", "Y", "Z"]
    if labelled and unknown:  # they are enough
        found = {key: columns for key, columns in found.items() if key[0] != BODY}
    bodies = tuple(_body(path, turns, n, at, values, scale) for (kind, n), at in found.items() if kind == BODY)
    if not labelled and not bodies and not loose:
        raise FileError(path, "", "no marker and no rigid body.", hint="Export markers, rigid bodies, or both.")
    positions = _places(values, labelled.values(), scale)
    said_rate = head.get("Export Frame Rate") or head.get("Capture Frame Rate") or ""
    t, rate, doubt = clocked(path, header_rate(path, 1, said_rate), values[:, 0], values[:, 1])
    lengths = f"lengths in {unit.lower()}, " if unit else ""
    said = (f"{lengths}{rate:g} Hz and y upwards: as line 1 and Motive's own axes say",)
    said += (f"rigid bodies are ignored: {turns[:20]!r} is not an order of angles",) if labelled and unknown else ()
    said += ("markers are those that Motive set by its rigid body: no other has a label",) if solved else ()
    seen = _places(values, loose.values(), scale)
    known = bool(unit)
    return MarkerLog(
        path, tuple(labelled), rate, t, positions, scale, "y", said, bodies, seen, unit_said=known, rate_doubt=doubt
    )  # fmt: skip


def _without_timecode(rows: list[list[str]]) -> list[list[str]]:
    """Without a third column of time codes, which counts what Frame and Time count."""
    names = next((row for row in rows[:MOST_HEADER] if row and row[0].strip() == "Frame"), [])
    if len(names) <= LEAD or names[LEAD].strip().lower().replace(" ", "") != "timecode":
        return rows
    return [rows[0], *([*row[:LEAD], *row[LEAD + 1 :]] for row in rows[1:])]


def _labels(above: Sequence[Sequence[str]]) -> dict[str, Sequence[str]]:
    """Rows above the numbers by what they tell; where the second column does not say it, types and names come first."""
    rows = [row for row in above if len(row) > LEAD and any(cell.strip() for cell in row)]
    named = {row[1].strip(): row for row in rows if row[1].strip()}
    if not named and len(rows) > 1 and any(_is_thing(cell.strip()) for cell in rows[0]):
        return {"Type": rows[0], "Name": rows[1]}
    return named


def _is_thing(kind: str) -> bool:
    """Whether columns of this type are a rigid body's or a marker's."""
    return kind == BODY or kind.rpartition(" ")[2] == MARKER


def _columns(
    path: Path, types: Sequence[str], names: Sequence[str], what: Sequence[str], axes: Sequence[str]
) -> Columns:
    """Where the places and rotations of each thing stand. Raises FileError where two have one name."""
    found: Columns = {}
    for column, cells in enumerate(zip(types, names, what, axes, strict=False)):
        kind, name, quantity, axis = (cell.strip() for cell in cells)
        if _is_thing(kind) and quantity in {"Position", "Rotation"} and axis in {"X", "Y", "Z", "W"}:
            while f"{quantity} {axis}" in found.get((kind, name), {}) and kind != BODY:
                name = f"*{name}"  # a name that stands there again labels nothing
            thing = found.setdefault((kind, name), {})
            if thing.setdefault(f"{quantity} {axis}", column) != column:
                raise FileError(path, f"column {column + 1}", f"{kind} {name[:60]!r} occurs twice")
    return {key: columns for key, columns in found.items() if {f"Position {axis}" for axis in "XYZ"} <= columns.keys()}


def _markers(found: Columns) -> tuple[dict[str, dict[str, int]], dict[str, dict[str, int]], bool]:
    """Labelled markers, those without a label, and whether the labelled ones are solved: measured ones go before."""
    markers = {key: columns for key, columns in found.items() if key[0] != BODY}
    loose = {name: columns for (_, name), columns in markers.items() if is_loose(name)}
    measured = {name: columns for (kind, name), columns in markers.items() if kind == MARKER and name not in loose}
    solved = {name: columns for (kind, name), columns in markers.items() if kind != MARKER and name not in loose}
    return measured or solved, loose, bool(solved) and not measured


def _places(values: np.ndarray, columns: Iterable[Mapping[str, int]], scale: float) -> np.ndarray:
    """(N, M, 3) m."""
    picked = [[one[f"Position {axis}"] for axis in "XYZ"] for one in columns]
    return scale * values[:, np.array(picked, dtype=int).reshape(-1, 3)]


def _body(path: Path, turns: str, name: str, columns: Mapping[str, int], values: np.ndarray, scale: float) -> BodyTrack:
    """turns: "Quaternion", or the axes in the order of the angles."""
    axes = "XYZW" if turns == QUATERNION else turns.upper()
    if sorted(f"Rotation {axis}" for axis in axes) != sorted(key for key in columns if key.startswith("Rotation")):
        hint = "Export with Rotation: Quaternion, or angles in an order such as XYZ."
        raise FileError(path, "line 1, Rotation Type", f"{turns[:20]!r} for body {name[:40]}.", hint=hint)
    places = scale * values[:, [columns[f"Position {axis}"] for axis in "XYZ"]]
    numbers = values[:, [columns[f"Rotation {axis}"] for axis in axes]]
    if turns == QUATERNION:
        return by_quaternions(path, name, places, numbers)
    known = np.isfinite(numbers).all(axis=1)
    matrices = np.full((len(numbers), 3, 3), np.nan)
    matrices[known] = Rotation.from_euler(axes, numbers[known], degrees=True).as_matrix()
    return by_matrices(path, name, places, matrices)
