"""Any table of marker places or poses, by a column map "fidim-columns/1":

    format = "fidim-columns/1"
    time = "stamp"                 time_unit = "ms"          s, ms, us or ns, from any zero; found where left out,
                                                             as are dates and times of day (ISO 8601)
    delimiter = ";"                decimal = ","             found where left out
    unit = "mm"                    up = "z"                  found by the robot file where left out
    [[marker]]
    name = "A"                     columns = ["ax", "ay", "az"]
    [[body]]
    name = "platform"              position = ["x", "y", "z"]
    quaternion = ["qw", "qx", "qy", "qz"]                    order = "wxyz"

The first line names the columns; numbers from 1 stand for columns without names. Every mistake is a FileError with
file and place.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.importers.reading.cells import EPOCH, length_scale
from fidim_lab.data.importers.reading.clock import SECONDS, check_time_unit, even_times, time_unit_of
from fidim_lab.data.importers.reading.columns import Column, TableMap, read_columns
from fidim_lab.data.importers.reading.poses import by_quaternions
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.errors import FileError

FORMAT = "fidim-columns/1"


class MarkerColumns(Table):
    """`[[marker]]`."""

    name: Annotated[str, Field(min_length=1)]
    columns: tuple[Column, Column, Column]


class BodyColumns(Table):
    """`[[body]]`."""

    name: Annotated[str, Field(min_length=1)]
    position: tuple[Column, Column, Column]
    quaternion: tuple[Column, Column, Column, Column]
    order: Literal["xyzw", "wxyz"]


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
    wanted += [column for body in said.body for column in (*body.position, *body.quaternion)]
    read = read_columns(path, said, wanted, f"{map_file.name} names it.")
    values = read.values
    unit = "s" if read.dated else said.time_unit or time_unit_of(path, values[:, 0])
    if said.time_unit and not read.dated:
        check_time_unit(map_file, said.time_unit, values[:, 0])
    seconds = values[:, 0] * SECONDS[unit]
    t, rate = even_times(path, (values[:, 0] - values[0, 0]) * SECONDS[unit])
    scale = 1.0 if said.unit is None else length_scale(map_file, "unit", said.unit)
    count = 1 + 3 * len(said.marker)
    positions = scale * values[:, 1:count].reshape(len(values), -1, 3)
    bodies = tuple(
        by_quaternions(
            path, body.name, scale * part[:, :3], part[:, [3, 4, 5, 6] if body.order == "xyzw" else [4, 5, 6, 3]]
        )
        for body, part in zip(said.body, np.split(values[:, count:], max(len(said.body), 1), axis=1), strict=False)
    )
    decided = [f"{rate:.4g} Hz by the stamps, which are in {unit}"]
    decided += [f"lengths in {said.unit} by {map_file.name}"] if said.unit else []
    decided += [f"{said.up} upwards by {map_file.name}"] if said.up else []
    decided += read.decided
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
        began=float(seconds[0]) if seconds[0] > EPOCH else None,
    )
