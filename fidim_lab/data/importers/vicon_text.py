"""The text or CSV that Vicon Nexus and Tracker export: a block of trajectories, of objects, or both, one row a frame.

    Trajectories                                         or Objects, Segments: rigid bodies
    100                                                  rate, Hz
    <tab><tab>subject:marker1<tab><tab><tab>subject:marker2 …
    Frame  Sub Frame  X  Y  Z  X  Y  Z …                 bodies: RX RY RZ RW TX TY TZ
    <tab><tab>mm  mm  mm …
    1  0  80.3694  -39.55  806.314 …                     blank where a marker was not seen

Blocks begin with their name and end with an empty line; others (Devices, Model Outputs) are passed over. Every mistake
is a FileError with the line it is in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fidim_lab.data.importers.reading.cells import (
    LENGTH_UNITS,
    MIN_FRAMES,
    NO_HEADER,
    cells_of,
    decimal_of,
    delimiter_of,
    length_scale,
    number,
    read_export,
)
from fidim_lab.data.importers.reading.clock import ONE_TAKE, header_rate
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.reading.poses import by_angles, by_quaternions
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.errors import FileError

HEADER_LINES = 5
FRAME_COLUMNS = 2
"""Frame, Sub Frame"""
MARKERS, BODIES = "Trajectories", ("Objects", "Segments")
QUATERNION, ANGLES = ["RX", "RY", "RZ", "RW", "TX", "TY", "TZ"], ["RX", "RY", "RZ", "TX", "TY", "TZ"]
"""columns of a body"""
RADIANS = MappingProxyType({"rad": 1.0, "radians": 1.0, "deg": np.pi / 180, "degrees": np.pi / 180, "°": np.pi / 180})
"""in one unit of angles"""


@dataclass(frozen=True, eq=False)
class ExportBlock:
    """One block of an export."""

    path: Path
    top: int
    """lines of the file above it"""
    lines: Sequence[Sequence[str]]
    decimal: str
    added: int = 0
    """lines of units that the file does not have"""
    fewer: int = 0
    """columns of sub-frames that it does not have"""

    def line(self, number: int) -> str:
        """The place of its line, from 1, in the file."""
        return f"line {self.top + number - (self.added if number >= HEADER_LINES else 0)}"


@dataclass(frozen=True, eq=False)
class BlockRows:
    """The numbers of a block."""

    frames: np.ndarray
    """(N,) counted through sub-frames"""
    values: np.ndarray
    """(N, K) NaN where blank"""
    rate: float
    """Hz, of sub-frames where there are any"""


def read_trajectories(path: Path) -> MarkerLog:
    """Read one export. Raises FileError with line and column."""
    blocks = _blocks(path, read_export(path).splitlines())
    found = [(name, block) for name, block in blocks if name == MARKERS]
    bodies = [(name, block) for name, block in blocks if name in BODIES]
    if len(found) > 1:
        raise FileError(path, found[1][1].line(1), f"a second block {MARKERS}.", hint=ONE_TAKE)
    name, block = (found or bodies)[0]
    rate = _rate(block)
    if name != MARKERS:
        return _only_bodies(block, rate)
    block = _without_rates(block)
    names = _names(block)
    _check_axes(block, len(names))
    scale = _scale(block, len(names))
    rows = _rows(block, FRAME_COLUMNS + 3 * len(names), 3, rate)
    positions = scale * rows.values.reshape(-1, len(names), 3)
    labelled, positions, loose = apart(names, positions)
    lengths = f"lengths in {_units(block)[0]} and " if _units(block) else ""
    said = (f"{lengths}{rows.rate:g} Hz, as the header says",)
    t = (rows.frames - rows.frames[0]) / rows.rate
    known = bool(_units(block))
    beside = _bodies_beside(bodies, rows)
    return MarkerLog(path, labelled, rows.rate, t, positions, scale, "z", said, beside, loose, unit_said=known)


def _without_rates(block: ExportBlock) -> ExportBlock:
    """Without the columns of velocities (X') and accelerations (X'') that Nexus writes beside trajectories if asked."""
    rates = {k for k, cell in enumerate(block.lines[3]) if cell.strip().endswith("'")}
    if not rates:
        return block
    return replace(block, lines=[[cell for k, cell in enumerate(row) if k not in rates] for row in block.lines])


def _bodies_beside(blocks: Sequence[tuple[str, ExportBlock]], rows: BlockRows) -> tuple[BodyTrack, ...]:
    """Objects of the same frames as the trajectories; none where their rotations are no quaternions."""
    found: list[BodyTrack] = []
    for _, block in blocks:
        try:
            log = _only_bodies(block, _rate(block))
        except FileError:  # the trajectories are enough
            continue
        if len(log.t) == len(rows.frames) and log.rate == rows.rate:
            found += log.bodies
    return tuple(found)


def _blocks(path: Path, text: Sequence[str]) -> list[tuple[str, ExportBlock]]:
    """Blocks of markers and bodies by name, in order. Raises FileError where there is none."""
    found: list[tuple[str, ExportBlock]] = []
    for top, first in enumerate(text):
        name = first.strip(" \t;,").strip('"').capitalize()
        if name == MARKERS or name in BODIES:
            delimiter = delimiter_of(text[top + 2 : top + HEADER_LINES])
            end = next(
                (k for k in range(top + HEADER_LINES, len(text)) if not text[k].strip(" \t;,") and k > top + 5),
                len(text),
            )
            lines = [[cell.strip('"') for cell in cells_of(line, delimiter)] for line in text[top:end]]
            if len(lines) < HEADER_LINES:
                what = f"{len(lines)} lines; a trajectory export has {HEADER_LINES} before its first frame"
                raise FileError(path, "", what)
            block = ExportBlock(path, top, lines, decimal_of(text[top + 5 : top + 55], delimiter))
            found.append((name, _as_newer(block)))
    if not found:
        shown = text[0].split("\t")[0][:40] if text else ""
        raise FileError(
            path, "line 1", f"{shown!r} was found, 'Trajectories' (or 'Objects') was expected.", hint=NO_HEADER
        )
    return found


def _as_newer(block: ExportBlock) -> ExportBlock:
    """A block of Nexus 1, which begins rows with `Field #` and has neither sub-frames nor units, as of Nexus 2."""
    if block.lines[3][0].strip().lower() not in {"field #", "frame#"}:
        return block
    rows = [[row[0], "", *row[1:]] for row in block.lines]
    rows[3] = ["Frame", "Sub Frame", *block.lines[3][1:]]
    has_units = not rows[HEADER_LINES - 1][0].strip()
    header = rows[: HEADER_LINES - 1] if has_units else [*rows[: HEADER_LINES - 1], [""]]
    return replace(block, lines=[*header, *rows[HEADER_LINES - 1 :]], added=0 if has_units else 1, fewer=1)


def _rate(block: ExportBlock) -> float:
    rate = header_rate(block.path, block.top + 2, block.lines[1][0])
    if not 1.0 <= rate <= 1e4:
        text = block.lines[1][0].strip()
        raise FileError(block.path, block.line(2), f"a frame rate of {text!r} Hz; 1 to 10000 was expected")
    return rate


def _names(block: ExportBlock) -> tuple[str, ...]:
    names = [cell.strip() for cell in block.lines[2][FRAME_COLUMNS::3]]
    while names and not names[-1]:  # the exporter ends the line with tabs
        names.pop()
    if not names:
        what = "names no marker; they stand above every third column from the third on"
        raise FileError(block.path, block.line(3), what)
    for index, name in enumerate(names):
        if not name:
            column = FRAME_COLUMNS + 1 + 3 * index
            raise FileError(block.path, f"{block.line(3)}, column {column}", "a marker without a name")
    return tuple(names)


def _check_axes(block: ExportBlock, markers: int) -> None:
    found = [cell.strip() for cell in block.lines[3] if cell.strip()]
    if found != ["Frame", "Sub Frame"] + ["X", "Y", "Z"] * markers:
        raise FileError(
            block.path,
            block.line(4),
            f"{len(found)} columns ({' '.join(found)[:60]}); "
            f"Frame, Sub Frame and X, Y, Z for each of {markers} markers were expected",
        )


def _units(block: ExportBlock) -> list[str]:
    return [cell.strip() for cell in block.lines[4] if cell.strip()]


def _scale(block: ExportBlock, markers: int) -> float:
    """Metres in one unit of the header; 1 where it has a row of units that is empty."""
    units = _units(block)
    if not units:
        return 1.0
    if len(units) != 3 * markers or len(set(units)) != 1:
        raise FileError(
            block.path,
            block.line(5),
            f"units {' '.join(sorted(set(units)))[:40]!r} for {len(units)} columns; "
            f"one unit {3 * markers} times was expected",
        )
    return length_scale(block.path, block.line(5), units[0])


def _only_bodies(block: ExportBlock, rate: float) -> MarkerLog:
    """Rigid bodies of Tracker's and Nexus' export, whose rotations are quaternions or three angles."""
    axes = [cell.strip() for cell in block.lines[3]][FRAME_COLUMNS:]
    while axes and not axes[-1]:
        axes.pop()
    kind = next((one for one in (QUATERNION, ANGLES) if axes and axes == one * (len(axes) // len(one))), None)
    if kind is None:
        what = f"columns {' '.join(axes)[:60]}; {' '.join(QUATERNION)} for each object were expected."
        raise FileError(block.path, block.line(4), what, hint="Export rotations as quaternions, or as three angles.")
    width = len(kind)
    names = [cell.strip() for cell in block.lines[2][FRAME_COLUMNS::width]][: len(axes) // width]
    if len(set(names)) < len(names) or not all(names):
        raise FileError(block.path, block.line(3), "an object without a name, or one name twice")
    units = {cell.strip().lower() for cell in block.lines[4] if cell.strip()}
    lengths, angles = units & LENGTH_UNITS.keys(), units & RADIANS.keys()
    if len(lengths) != 1:
        raise FileError(block.path, block.line(5), "no unit of length, or two; mm or m was expected")
    if kind is ANGLES and len(angles) != 1:
        raise FileError(block.path, block.line(5), "no unit of angles, or two; deg or rad was expected")
    (unit,) = lengths
    scale = LENGTH_UNITS[unit]
    rows = _rows(block, FRAME_COLUMNS + len(axes), width, rate)
    parts = rows.values.reshape(len(rows.values), len(names), width)
    bodies: list[BodyTrack] = []
    for k, name in enumerate(names):
        places, turns = scale * parts[:, k, width - 3 :], parts[:, k, : width - 3]
        if kind is QUATERNION:
            bodies.append(by_quaternions(block.path, name, places, turns))
        else:
            bodies += by_angles(block.path, name, places, turns * RADIANS[next(iter(angles))])
    t = (rows.frames - rows.frames[0]) / rows.rate
    said = (f"objects in {unit} at {rows.rate:g} Hz, as the header says",)
    return MarkerLog(block.path, (), rows.rate, t, np.zeros((len(t), 0, 3)), scale, "z", said, tuple(bodies))


def _rows(block: ExportBlock, width: int, group: int, rate: float) -> BlockRows:
    """The numbers below the header; sub-frames count as frames of a higher rate."""
    rows: list[list[float]] = []
    first = block.top + HEADER_LINES + 1 - block.added
    for line, cells in enumerate(block.lines[HEADER_LINES:], start=first):
        if not any(cell.strip() for cell in cells):
            continue
        cells = _with_trailing_blanks(cells, width, group)
        if len(cells) != width:
            what = f"{len(cells)} columns, the header has {width}; is the file truncated?"
            raise FileError(block.path, f"line {line}", what)
        row = [
            number(block.path, line, max(1, k - block.fewer), cell, decimal=block.decimal)
            for k, cell in enumerate(cells, start=1)
        ]
        _check_frame(block.path, line, row, rows[-1] if rows else None)
        rows.append(row)
    if len(rows) < MIN_FRAMES:
        raise FileError(block.path, "", f"{len(rows)} frames; a recording has at least {MIN_FRAMES}")
    table = np.array(rows)
    sub = np.nan_to_num(table[:, 1])
    each = int(sub.max()) + 1
    return BlockRows(table[:, 0] * each + sub, table[:, FRAME_COLUMNS:], rate * each)


def _with_trailing_blanks(cells: Sequence[str], width: int, group: int) -> Sequence[str]:
    """The cells of one row, without blanks beyond the header, and with those that the exporter left out at its end.

    It leaves out whole markers that were not seen: a row that ends within a marker stays short, for it was cut off.
    """
    filled = max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)
    whole = filled <= FRAME_COLUMNS or (filled - FRAME_COLUMNS) % group == 0
    return [*cells[:filled], *[""] * (width - filled)] if whole else cells[:filled]


def _check_frame(path: Path, line: int, row: Sequence[float], before: Sequence[float] | None) -> None:
    frame, sub = row[0], np.nan_to_num(row[1])
    if not float(frame).is_integer():  # NaN too
        raise FileError(path, f"line {line}, column 1", "a frame without its number")
    if not (float(sub).is_integer() and 0.0 <= sub < 100.0):
        raise FileError(path, f"line {line}, column 2", f"a sub-frame of {sub:g}; 0 to 99 was expected")
    if before is not None and (frame, sub) <= (before[0], np.nan_to_num(before[1])):
        raise FileError(
            path, f"line {line}, column 1", f"frame {frame:.0f} comes after frame {before[0]:.0f}.", hint=ONE_TAKE
        )
