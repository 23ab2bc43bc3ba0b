"""Window files in MCAP, `windows/ID.mcap`: the rows of `windows/ID.csv` at full precision, beside all else seen.

`read_window_mcap` for a finished window, `read_unfinished` for what a crash left (never silently the same thing),
`add_rows` for writing one. The topics of a recorded window are listed in docs/files.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.input_file import MIB, unseen
from fidim_lab.data.files.mcap_encoder import McapEncoder, nanoseconds
from fidim_lab.data.files.mcap_file import McapContents, read_mcap
from fidim_lab.data.files.mcap_schemas import ROW, messages
from fidim_lab.data.window_csv import FARTHEST, MIN_SAMPLES, WindowColumns
from fidim_lab.errors import FileError

ROWS = "/window"
"""topic of the rows"""
PROFILE = "fidim-window/1"
LIMIT = 64 * MIB
"""bytes; ten minutes of window with all that was seen beside it have 20 MiB"""
FURTHER = "further"
"""key of the channel's metadata with the names of further columns"""


@dataclass(frozen=True, eq=False)
class UnfinishedWindow:
    """What is left of a window whose recording was broken off: to be looked at, not to be fitted."""

    columns: WindowColumns
    problem: str
    """why it is incomplete, for a person"""


def read_window_mcap(path: Path, cables: int) -> WindowColumns:
    """Read one finished window of a robot with `cables` cables.

    Raises FileError with file and row: also for a file without its end, which is not a window (`read_unfinished`).
    """
    contents = read_mcap(path, LIMIT)
    if not contents.complete:
        hint = "Record the window again; fidim export --unfinished shows the remainder."
        raise FileError(path, "", f"{contents.problem}.", hint=hint)
    columns = _columns(contents, cables)
    if len(columns.t) < MIN_SAMPLES:
        raise FileError(path, "", f"{len(columns.t)} samples; a window needs at least {MIN_SAMPLES} to be of use")
    return columns


def read_unfinished(path: Path, cables: int) -> UnfinishedWindow:
    """The whole rows of a window that was cut off. Raises FileError for a file that has none, or is no such file."""
    contents = read_mcap(path)
    if not contents.of(ROWS):
        raise FileError(path, "", f"{contents.problem or 'there is nothing in it'}; it has no row.")
    return UnfinishedWindow(_columns(contents, cables), contents.problem)


def add_row_channel(encoder: McapEncoder, further: Sequence[str] = ()) -> int:
    """Register the topic of the rows; `further`: names of the columns beyond markers, lengths and currents."""
    return encoder.add_channel(ROWS, messages().schema(ROW), "protobuf", {FURTHER: ",".join(further)})


def encode_row(row: int, t: float, values: Sequence[Sequence[float]], **source: Any) -> bytes:
    """One row: markers (3 M), lengths (n), currents (n), NaN where missing; `source`: other fields by name."""
    markers, lengths, currents = values
    return messages().encode(ROW, row=row, t=t, markers=markers, lengths=lengths, currents=currents, **source)


def window_as_mcap(columns: WindowColumns) -> bytes:
    """A window file of rows alone (for campaigns that were not recorded here)."""
    encoder = McapEncoder(profile=PROFILE)
    channel = add_row_channel(encoder, list(columns.further))
    empty = np.zeros((len(columns.t), 0))
    lengths = empty if columns.lengths is None else columns.lengths
    currents = empty if columns.currents is None else columns.currents
    begin = float(columns.t[0])
    for k, t in enumerate(columns.t.tolist()):
        values = (columns.markers[k].ravel().tolist(), lengths[k].tolist(), currents[k].tolist())
        further = [float(series[k]) for series in columns.further.values()]
        line = encode_row(k, t, values, host_time=math.nan, device_time=math.nan, further=further)
        encoder.add(channel, nanoseconds(t - begin), line)
    return encoder.finish()


def _columns(contents: McapContents, cables: int) -> WindowColumns:
    rows = [message.value for message in contents.of(ROWS) if message.schema == ROW]
    if not rows:
        raise FileError(contents.path, f"topic {ROWS}", f"there are no messages of the type {ROW}")
    path = contents.path
    _check_types(path, rows[0].DESCRIPTOR)
    t = np.array([row.t for row in rows], dtype=float)
    for k in np.flatnonzero(~np.isfinite(t)):
        raise FileError(path, f"row {k + 1}", "a sample without its time")
    for k in np.flatnonzero(np.diff(t) <= 0):
        raise FileError(path, f"row {k + 2}", f"time {t[k + 1]:g} s is not after {t[k]:g} s of the row before")
    markers = _series(path, rows, "markers")
    if markers is None or markers.shape[1] % 3:
        raise FileError(path, f"topic {ROWS}", "markers are x, y, z of each; at least the main one is needed")
    lengths, currents = _series(path, rows, "lengths"), _series(path, rows, "currents")
    for name, series in (("lengths", lengths), ("currents", currents)):
        if series is not None and series.shape[1] != cables:
            raise FileError(path, f"topic {ROWS}, {name}", f"{series.shape[1]} values for a robot of {cables} cables")
    further = _series(path, rows, "further")
    names = contents.channels[ROWS].get(FURTHER, "").split(",")
    if any(unseen(name) for name in names):
        raise FileError(path, f"topic {ROWS}", "the name of a further column holds a control character")
    if further is not None and further.shape[1] != len(names):
        raise FileError(path, f"topic {ROWS}", f"{further.shape[1]} further columns, named are {', '.join(names)}")
    kept = {} if further is None else dict(zip(names, further.T, strict=True))
    return WindowColumns(t, markers.reshape(len(t), -1, 3), lengths, currents, kept)


def _check_types(path: Path, descriptor: Any) -> None:
    """Raises FileError where a row of our name has other fields than ours."""
    for name in ("t", "markers", "lengths", "currents", "further"):
        field = descriptor.fields_by_name.get(name)
        if field is None or field.type != field.TYPE_DOUBLE or field.is_repeated != (name != "t"):
            numbers = "a number of 64 bits" if name == "t" else "a list of numbers of 64 bits"
            raise FileError(path, f"topic {ROWS}, {name}", f"{'is missing' if field is None else 'is not'} {numbers}")


def _series(path: Path, rows: Sequence[Any], name: str) -> np.ndarray | None:
    """(N, C) of a repeated field; None where it is empty in every row."""
    values = [list(getattr(row, name)) for row in rows]
    width = len(values[0])
    for k, row in enumerate(values):
        if len(row) != width:
            raise FileError(path, f"row {k + 1}, {name}", f"{len(row)} values, the first row has {width}")
    table = np.array(values, dtype=float).reshape(len(rows), width)
    if (np.abs(table) > FARTHEST).any():
        raise FileError(path, name, f"a value above {FARTHEST:g} or infinite; a missing sample is NaN")
    return table if width else None
