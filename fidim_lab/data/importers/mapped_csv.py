"""Any table of marker places or poses, by a column map "fidim-columns/1":

    format = "fidim-columns/1"
    time = "stamp"                 time_unit = "ms"          s, ms, us, ns or d, from any zero; found where left
                                                             out, as are dates and times of day (ISO 8601)
    delimiter = ";"                decimal = ","             found where left out
    unit = "mm"                    up = "z"                  found by the robot file where left out
    [[marker]]
    name = "A"                     columns = ["ax", "ay", "az"]
    [[body]]
    name = "platform"              position = ["x", "y", "z"]
    quaternion = ["qw", "qx", "qy", "qz"]                    order = "wxyz", "xyzw"; found where left out
    angles = ["rx", "ry", "rz"]                              or these, about x, y, z; order = "XYZ", "xyz", "vector"
                                                             and angle_unit = "deg", "rad" are found where left out
    matrix = ["r11", "r12", "r13", "r21", …]                 or these, row by row

The first line names the columns; numbers from 1 stand for columns without names. Every mistake is a FileError with
file and place.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.importers.reading.cells import EPOCH, length_scale
from fidim_lab.data.importers.reading.clock import SECONDS, by_time, check_time_unit, even_times, time_unit_of
from fidim_lab.data.importers.reading.columns import Column, TableMap, read_columns
from fidim_lab.data.importers.reading.poses import ANGLES, VECTOR, by_angles, by_matrices, by_quaternions_in
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.errors import FileError

FORMAT = "fidim-columns/1"


class MarkerColumns(Table):
    """`[[marker]]`."""

    name: Annotated[str, Field(min_length=1)]
    columns: tuple[Column, Column, Column]


AngleOrder = Literal["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "vector"]
"""about the body's own axes in turn, about fixed axes in turn, or a rotation vector"""


class BodyColumns(Table):
    """`[[body]]`, with one of the three ways to say its rotation."""

    name: Annotated[str, Field(min_length=1)]
    position: tuple[Column, Column, Column]
    quaternion: tuple[Column, Column, Column, Column] | None = None
    angles: tuple[Column, Column, Column] | None = None
    matrix: Annotated[tuple[Column, ...], Field(min_length=9, max_length=9)] | None = None
    order: Literal["xyzw", "wxyz"] | AngleOrder | None = None
    angle_unit: Literal["deg", "rad"] | None = None

    @property
    def rotation(self) -> tuple[Column, ...]:
        """The columns that say it."""
        return self.quaternion or self.angles or self.matrix or ()


class ColumnMap(TableMap):
    """The whole of a column map."""

    format: Literal["fidim-columns/1"]
    unit: str | None = None
    up: Literal["x", "y", "z"] | None = None
    marker: tuple[MarkerColumns, ...] = ()
    body: tuple[BodyColumns, ...] = ()


def read_mapped(path: Path, map_file: Path) -> MarkerLog:
    """Read one table by its map. Raises FileError with line and column."""
    said = read_toml(map_file, ColumnMap, FORMAT)
    if not said.marker and not said.body:
        raise FileError(map_file, "", "neither a [[marker]] nor a [[body]]")
    wanted = [said.time, *(column for marker in said.marker for column in marker.columns)]
    for number, body in enumerate(said.body, start=1):
        _check_rotation(map_file, f"body {number}", body)
        wanted += [*body.position, *body.rotation]
    read = read_columns(path, said, wanted, f"{map_file.name} names it.")
    values, tidied = by_time(read.values)
    unit = "s" if read.dated else said.time_unit or time_unit_of(path, values[:, 0])
    if said.time_unit and not read.dated:
        check_time_unit(map_file, said.time_unit, values[:, 0])
    seconds = values[:, 0] * SECONDS[unit]
    t, rate, clock = even_times(path, (values[:, 0] - values[0, 0]) * SECONDS[unit])
    scale = 1.0 if said.unit is None else length_scale(map_file, "unit", said.unit)
    count = 1 + 3 * len(said.marker)
    positions = scale * values[:, 1:count].reshape(len(values), -1, 3)
    ends = np.cumsum([count, *(3 + len(body.rotation) for body in said.body)])
    parts = np.split(values, ends, axis=1)[1:-1]
    bodies = tuple(
        track
        for body, part in zip(said.body, parts, strict=True)
        for track in _tracks(path, body, scale * part[:, :3], part[:, 3:])
    )
    counts = not (read.dated or said.time_unit) and bool((np.diff(values[:, 0]) == 1.0).all())
    doubt = f"Times go up by one: are they frame numbers, or {unit} at {rate:g} Hz? (time_unit in the map says {unit})"
    decided = [f"{rate:.4g} Hz by the stamps, which are in {unit}"]
    decided += [f"lengths in {said.unit} by {map_file.name}"] if said.unit else []
    decided += [f"{said.up} upwards by {map_file.name}"] if said.up else []
    decided += (*clock.says, *read.decided, *tidied)
    return MarkerLog(
        path,
        tuple(marker.name for marker in said.marker),
        rate,
        t,
        positions,
        scale,
        said.up,
        tuple(decided),
        bodies,
        unit_said=said.unit is not None,
        began=float(seconds[0]) if seconds[0] > EPOCH and unit != "d" else None,
        rate_doubt=doubt if counts else "",
        breaks=clock.breaks,
    )


def _check_rotation(map_file: Path, place: str, body: BodyColumns) -> None:
    """Raises FileError where a rotation is said in no way or in two, or with an order or unit that is not its own."""
    if sum(way is not None for way in (body.quaternion, body.angles, body.matrix)) != 1:
        raise FileError(map_file, place, "one of quaternion, angles and matrix is needed")
    of_quaternion = body.order in {"xyzw", "wxyz"}
    if body.order is not None and (body.matrix or of_quaternion != (body.quaternion is not None)):
        what = 'order is "wxyz" or "xyzw" of a quaternion, and such as "XYZ", "xyz" or "vector" of angles'
        raise FileError(map_file, f"{place}, order", what)
    if body.angle_unit is not None and body.angles is None:
        raise FileError(map_file, f"{place}, angle_unit", "belongs to angles")


def _tracks(path: Path, body: BodyColumns, places: np.ndarray, turns: np.ndarray) -> Sequence[BodyTrack]:
    """The body in every way in which its rotations may be read: one, if the map says all."""
    if body.matrix:
        return [by_matrices(path, body.name, places, turns.reshape(-1, 3, 3))]
    if body.quaternion:
        found = by_quaternions_in(path, body.name, places, turns)
        return [found[body.order]] if body.order in found else list(found.values())
    units = {"deg": np.pi / 180.0, "rad": 1.0}
    orders = ANGLES if body.order is None else (body.order if body.order.isupper() else body.order[::-1].upper(),)
    if body.order == VECTOR:
        orders = (VECTOR,)
    return [
        replace(track, read_as=f"{track.read_as} in {unit}")
        for unit in ([body.angle_unit] if body.angle_unit else units)
        for track in by_angles(path, body.name, places, units[unit] * turns, orders)
    ]
