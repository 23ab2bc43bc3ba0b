"""A robot controller's log as text, by a map "fidim-log/1"; without one the names of our own windows are taken.

    format = "fidim-log/1"
    time = 2                       time_unit = "s"           a column by name, or by number from 1
    actuator = 3                                             where each row is one actuator's; its values in [[cable]]
    [[cable]]
    actuator = 0
    length = 8                     length_unit = "m"         or counts = 5 and metres_per_count = 1e-6
    swivel = 11                    swivel_unit = "rad"       or swivel_unit = "counts" and swivel_counts_per_turn
    current = 7                                              A

Lengths and swivel angles count from an unknown zero. Logs padded with NUL bytes, and a last line that was cut off, are
read. Every mistake is a FileError with file and place.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.importers.reading.cells import length_scale
from fidim_lab.data.importers.reading.clock import SECONDS, unit_by_steps
from fidim_lab.data.importers.reading.columns import Column, TableMap, read_columns
from fidim_lab.data.importers.takes import EncoderLog
from fidim_lab.errors import FileError

FORMAT = "fidim-log/1"
FEWEST = 50
"""samples that all cables have in common"""
COUNTERS = (2.0**16, 2.0**32)
"""counts after which a counter begins anew"""
FASTEST = 20.0
"""m/s of cable: winches wind at a few"""
SLOWEST = 1.0
"""s between samples: platforms swing with 0.2 Hz and more, so that a longer step is one in a smaller unit"""


class CableColumns(Table):
    """`[[cable]]`, in the robot file's order."""

    actuator: int | None = None
    length: Column | None = None
    length_unit: str = "m"
    counts: Column | None = None
    metres_per_count: float | None = None
    swivel: Column | None = None
    swivel_unit: Literal["rad", "deg", "counts"] = "rad"
    swivel_counts_per_turn: Annotated[float, Field(gt=0.0)] | None = None
    current: Column | None = None


class LogMap(TableMap):
    """The whole of a log's map."""

    format: Literal["fidim-log/1"]
    actuator: Column | None = None
    cable: Annotated[tuple[CableColumns, ...], Field(min_length=1)]


def read_robot_log(path: Path, cables: int, map_file: Path | None) -> EncoderLog:
    """Read one log of a robot with `cables` cables. Raises FileError with line and column."""
    said = _own_names(cables) if map_file is None else read_toml(map_file, LogMap, FORMAT)
    if map_file is not None:
        _check(map_file, said, cables)
    wanted: list[Column] = [said.time, *([] if said.actuator is None else [said.actuator])]
    for cable in said.cable:
        wanted += [c for c in (_counted(cable), cable.swivel, cable.current) if c is not None]
    own = f"Without --log-map a log has columns t and l1 to l{cables}; a map says which column is what."
    read = read_columns(path, said, wanted, own if map_file is None else f"{map_file.name} names it.")
    table = dict(zip(wanted, read.values.T, strict=True))
    parts = [_rows(path, said, cable, table) for cable in said.cable]
    t = parts[0][0]
    for other, _ in parts[1:]:
        t = np.intersect1d(t, other)
    if len(t) < FEWEST:
        raise FileError(path, "time", f"{len(t)} samples are common to all cables; {FEWEST} are needed")
    in_seconds = read.dated or float(np.median(np.diff(t))) <= SLOWEST
    unit = "s" if read.dated else said.time_unit or (None if in_seconds else unit_by_steps(t)) or "s"
    picked = [{name: column[np.searchsorted(at, t)] for name, column in found.items()} for at, found in parts]
    t = t * SECONDS[unit]
    lengths = [_length(map_file or path, cable, found) for cable, found in zip(said.cable, picked, strict=True)]
    return EncoderLog(
        path,
        t,
        np.column_stack(lengths),
        _all([_swivel(cable, found) for cable, found in zip(said.cable, picked, strict=True)]),
        _all([found.get("current") for found in picked]),
        (*read.decided, f"times of logs are in {unit}", *_jumps(t, lengths)),
    )


def _own_names(cables: int) -> LogMap:
    """The columns of our own windows: t, l1…, and where they are there, nothing more is asked for."""
    named = [{"length": f"l{cable}"} for cable in range(1, cables + 1)]
    return LogMap.model_validate({"format": FORMAT, "time": "t", "cable": tuple(named)})


def _check(map_file: Path, said: LogMap, cables: int) -> None:
    if len(said.cable) != cables:
        raise FileError(map_file, "cable", f"{len(said.cable)} cables; the robot file has {cables}")
    for number, cable in enumerate(said.cable, start=1):
        place = f"cable {number}"
        if (cable.length is None) == (cable.counts is None):
            raise FileError(map_file, place, "either length or counts is needed")
        if (cable.counts is None) != (cable.metres_per_count is None):
            raise FileError(map_file, place, "counts and metres_per_count belong together")
        if (cable.actuator is None) != (said.actuator is None):
            raise FileError(map_file, place, "actuator is the column above, and its value in each cable, or neither")
        if (cable.swivel_unit == "counts") != (cable.swivel_counts_per_turn is not None):
            raise FileError(map_file, place, 'swivel_counts_per_turn belongs to swivel_unit = "counts"')
        length_scale(map_file, f"{place}, length_unit", cable.length_unit)


def _counted(cable: CableColumns) -> Column | None:
    return cable.counts if cable.length is None else cable.length


def _rows(
    path: Path, said: LogMap, cable: CableColumns, table: dict[Column, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times of one cable's rows, each once, and its columns there."""
    mine = np.isfinite(table[said.time])
    if said.actuator is not None:
        mine &= table[said.actuator] == cable.actuator
    t, first = np.unique(table[said.time][mine], return_index=True)
    if (np.diff(table[said.time][mine]) < 0.0).any():
        raise FileError(path, "time", "goes back")
    named = {"length": _counted(cable), "swivel": cable.swivel, "current": cable.current}
    return t, {name: table[column][mine][first] for name, column in named.items() if column is not None}


def _length(path: Path, cable: CableColumns, found: dict[str, np.ndarray]) -> np.ndarray:
    if cable.counts is None:
        return found["length"] * length_scale(path, "length_unit", cable.length_unit)
    return _gone_on(found["length"]) * float(cable.metres_per_count or 1.0)


def _gone_on(counts: np.ndarray) -> np.ndarray:
    """Counts of a counter that began anew when it was full, as if it had gone on."""
    known = np.isfinite(counts)
    for full in COUNTERS:
        if known.sum() > 1 and np.ptp(counts[known]) < full and np.abs(np.diff(counts[known])).max() > full / 2:
            counts = counts.copy()
            counts[known] = np.unwrap(counts[known], period=full)
            break
    return counts


def _jumps(t: np.ndarray, lengths: list[np.ndarray]) -> list[str]:
    """What is told of cables that no winch can wind so fast: a window with such a place is no use with this log."""
    said: list[str] = []
    for number, length in enumerate(lengths, start=1):
        known = np.isfinite(length)
        steps, at = np.diff(length[known]), t[known][1:]
        far = np.flatnonzero(np.abs(steps) > FASTEST * np.diff(t[known]))
        if len(far):
            k = far[np.argmax(np.abs(steps[far]))]
            places = f", {len(far)} such places" if len(far) > 1 else ""
            said.append(
                f"cable {number} jumps by {steps[k]:+.3g} m within a sample, {at[k] - t[0]:.2f} s after the log's "
                f"begin{places}: its counter was reset, or readings are wrong there"
            )
    return said


def _swivel(cable: CableColumns, found: dict[str, np.ndarray]) -> np.ndarray | None:
    if "swivel" not in found:
        return None
    turn = {"rad": 2.0 * np.pi, "deg": 360.0, "counts": cable.swivel_counts_per_turn}[cable.swivel_unit]
    angle = found["swivel"] * 2.0 * np.pi / float(turn or 1.0)
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known])  # a missing reading would spread to all that follow
    return angle


def _all(columns: list[np.ndarray | None]) -> np.ndarray | None:
    """Side by side, or none where one cable has none."""
    known = [column for column in columns if column is not None]
    return np.column_stack(known) if len(known) == len(columns) else None
