"""Campaign folders, "fidim-campaign/1": campaign.toml, robot.toml and one file a window."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
import tomli_w
from pydantic import Field

from fidim_lab.arrays import PerCable
from fidim_lab.data.files.toml_file import Name, Table, read_toml
from fidim_lab.data.own_sensors import RATES
from fidim_lab.data.period_table import PeriodMistake, PeriodTable, as_tables, period_of
from fidim_lab.data.records import Alignment, Campaign, Period, Role, Window
from fidim_lab.data.rigs.alignment_file import NAME as ALIGNMENT
from fidim_lab.data.rigs.alignment_file import at_exposures, read_alignment
from fidim_lab.data.robot_file import read_robot, write_robot
from fidim_lab.data.window_csv import WindowColumns, read_window_csv, write_window_csv
from fidim_lab.data.window_mcap import read_window_mcap, window_as_mcap
from fidim_lab.errors import FileError, SetupError

FORMAT = "fidim-campaign/1"
INDEX = "campaign.toml"
ROBOT = "robot.toml"
OFF_RATE = 1.5
"""times may samples be farther apart, or closer, than campaign.toml says; of those that bunch up most we saw 1.26"""
COVERED = 0.5
"""part of a window's time that its samples must fill: with less, more is missing than there. It is 1 in all 1218
windows that we have; cost alone would allow 0.003, an hour's gap: `identify` takes 0.5 GB then, 2.9 GB for ten hours"""
READERS: Mapping[str, Callable[[Path, int], WindowColumns]] = MappingProxyType(
    {".csv": read_window_csv, ".mcap": read_window_mcap}
)
"""(file, cables of the robot) → its columns, by suffix"""


NO_RATE = 0.0
"""Hz, of a campaign without windows"""
_FEW = 3
"""campaigns that a message names"""
WANTED = (
    "Give a run or campaign folder: fidim dry-run makes one on simulators, fidim import one of another lab's recording."
)


class WindowTable(Table):
    """`[[window]]`."""

    id: Name
    file: str
    role: Role
    equilibrium: tuple[float, float, float] | None = None
    lengths: Literal["encoders", "poses"] = "encoders"
    encoder_zeros: tuple[float, ...] | None = None


class CampaignTable(Table):
    """The whole of campaign.toml."""

    format: Literal["fidim-campaign/1"]
    name: str
    robot: str
    sample_rate: Annotated[float, Field(gt=0)] | None = None
    window: tuple[WindowTable, ...] = ()
    period: tuple[PeriodTable, ...] = ()


@dataclass(frozen=True, eq=False)
class IndexEntry:
    """One window as campaign.toml lists it."""

    id: str
    role: Role
    equilibrium: np.ndarray | None
    suffix: str = ".csv"
    """of the window's file: .csv or .mcap"""
    lengths_by_poses: bool = False
    """as `Window` has it"""
    encoder_zeros: PerCable | None = None
    """as `Window` has it"""

    @property
    def file(self) -> str:
        """Where the window lies, relative to the campaign folder."""
        return f"windows/{self.id}{self.suffix}"


def read_campaign(folder: Path, *, periods: bool = False) -> Campaign:
    """Read a campaign folder whole. Raises FileError with file, key or line.

    periods: whether one that holds periods in place of windows is of use; else it is a SetupError.
    Where it has an alignment.toml, lengths and currents are those of the instants at which the markers were seen.
    """
    index = folder / INDEX
    if not folder.is_dir():
        what = "is a file; a campaign is a folder." if folder.exists() else "no such folder."
        near = [folder.parent] if folder.exists() and (folder.parent / INDEX).exists() else []
        raise FileError(folder, "", what, hint=_meant(near))
    if not index.exists():
        inside = sorted(one.parent for one in folder.glob(f"*/{INDEX}"))
        raise FileError(index, "", "no such file.", hint=_meant(inside))
    table = read_toml(index, CampaignTable, FORMAT)
    if table.period and not table.window:
        return _of_periods(folder, index, table, wanted=periods)
    if not table.window:
        raise FileError(index, "window", "the campaign lists no windows")
    if table.period:
        what = "stands beside windows; a campaign holds one of both"
        raise FileError(index, "period", what, hint="Make two campaigns of them.")
    if table.sample_rate is None:
        raise FileError(index, "sample_rate", "is missing")
    _check_windows(index, table.window)
    robot = read_robot(folder / table.robot, named_by=index)
    alignment = read_alignment(folder / ALIGNMENT)
    windows = [_read_window(folder, w, robot.n, len(robot.markers)) for w in table.window]
    for window in windows:
        _check_rate(index, window, table.sample_rate)
    for entry, window in zip(table.window, windows, strict=True):
        _check_covered(folder / entry.file, window.t, table.sample_rate)
    return Campaign(
        name=table.name,
        robot=robot,
        sample_rate=table.sample_rate,
        windows=tuple(windows if alignment is None else (_aligned(window, alignment) for window in windows)),
        alignment=alignment,
    )


def _of_periods(folder: Path, index: Path, table: CampaignTable, *, wanted: bool) -> Campaign:
    if not wanted:
        raise SetupError(
            f"{folder} holds periods, which show no motion over time: this command has nothing to work on.",
            hint=f"fidim identify {folder} tells what they show of the body; record rates or markers for the rest.",
        )
    robot = read_robot(folder / table.robot, named_by=index)
    periods: list[Period] = []
    for k, one in enumerate(table.period, start=1):
        found = period_of(one, robot.n)
        if isinstance(found, PeriodMistake):
            raise FileError(index, f"period {k}, {found.key}", found.what, hint=found.hint)
        periods.append(found)
    return Campaign(table.name, robot, NO_RATE, (), periods=tuple(periods))


def _meant(campaigns: Sequence[Path]) -> str:
    """What to give instead: the campaigns that are near, where there are any."""
    if not campaigns:
        return WANTED
    more = " …" if len(campaigns) > _FEW else ""
    return f"Campaign folders near it: {', '.join(map(str, campaigns[:_FEW]))}{more}."


def _aligned(window: Window, alignment: Alignment) -> Window:
    """With lengths and currents as they were when the cameras saw the markers beside them."""

    def seen(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else at_exposures(window.t, values, alignment.lag)

    return replace(window, lengths=seen(window.lengths), currents=seen(window.currents))


def _check_windows(index: Path, windows: Sequence[WindowTable]) -> None:
    """Raises FileError for an id or file that occurs twice, and for a file outside the folder."""
    ids: set[str] = set()
    files: set[PurePosixPath] = set()
    for number, window in enumerate(windows, start=1):
        file = PurePosixPath(window.file)
        if window.id in ids:
            raise FileError(index, f"window {number}, id", f"{window.id!r} occurs twice")
        if file in files:
            raise FileError(index, f"window {number}, file", f"{window.file!r} occurs twice")
        if file.is_absolute() or ".." in file.parts:
            raise FileError(index, f"window {number}, file", f"{window.file!r} is not inside the campaign folder")
        ids.add(window.id)
        files.add(file)


def _check_rate(index: Path, window: Window, rate: float) -> None:
    """Raises FileError where the times of a window are not those of the rate: in another unit, or of another camera.

    By the median and the mean step alike: packets that come in bunches spoil the one, gaps the other.
    """
    steps = np.array([np.median(np.diff(window.t)), np.ptp(window.t) / (len(window.t) - 1)]) * rate
    if (steps > OFF_RATE).all() or (steps < 1.0 / OFF_RATE).all():
        found = f"{rate:g} Hz, but the samples of window {window.id} are {steps[0] / rate:.4g} s apart"
        raise FileError(index, "sample_rate", found, hint=_unit(float(steps[0])) + "Times are in s, rates in Hz.")


def _check_covered(path: Path, t: np.ndarray, rate: float) -> None:
    """Raises FileError where less than `COVERED` of a window's time has samples: no one motion goes through it all.

    Every step of that time is computed, so it also bounds what a file of ours may cost.
    """
    span, sampled = float(np.ptp(t)), len(t) / rate
    if sampled < COVERED * span:
        row = int(np.argmax(np.diff(t)))
        what = (
            f"no sample for {t[row + 1] - t[row]:.2f} s after t = {t[row]:.2f} s; of the window's {span:.2f} s only "
            f"{sampled:.2f} s have samples, and half must"
        )
        raise FileError(path, f"sample {row + 2}, t", what, hint="Make a window of each recording.")


def _unit(ratio: float) -> str:
    """Which unit of time makes the samples as many times too far apart; a blank where none does."""
    units = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds", 1 / 60: "minutes"}
    for times, name in units.items():
        if times / OFF_RATE < ratio < times * OFF_RATE:
            return f"The times of the windows look like {name}. "
    return ""


def _check_seen(path: Path, columns: WindowColumns) -> None:
    """Raises FileError where nothing shows a motion: no marker, swivel or gyroscope; or a length is not above zero."""
    if np.isnan(columns.markers).any(axis=2).all() and not {"s1", *RATES} & {*columns.further}:
        raise FileError(path, "x, y, z", "no marker is in any sample")
    lengths = columns.lengths
    if lengths is not None and (lengths <= 0.0).any():
        row, cable = np.argwhere(lengths <= 0.0)[0]
        what = f"a length of {lengths[row, cable]:g} m; above 0 is allowed"
        raise FileError(path, f"sample {row + 1}, l{cable + 1}", what)


def _read_window(folder: Path, entry: WindowTable, cables: int, markers: int) -> Window:
    path = folder / entry.file
    read = READERS.get(path.suffix)
    if read is None:
        raise FileError(folder / INDEX, f"window {entry.id}, file", f"{entry.file!r} is not a .csv or .mcap file")
    _check_zeros(folder / INDEX, entry, cables)
    columns = read(path, cables)
    _check_seen(path, columns)
    found = columns.markers.shape[1]
    if found > markers:
        raise FileError(path, "line 1", f"{found} markers, the robot file has {markers} (platform, extra_markers)")
    return Window(
        id=entry.id,
        role=entry.role,
        t=columns.t,
        markers=columns.markers,
        lengths=columns.lengths,
        currents=columns.currents,
        equilibrium=None if entry.equilibrium is None else np.array(entry.equilibrium),
        further=columns.further,
        lengths_by_poses=entry.lengths == "poses",
        encoder_zeros=None if entry.encoder_zeros is None else np.array(entry.encoder_zeros),
    )


def _check_zeros(index: Path, entry: WindowTable, cables: int) -> None:
    """Raises FileError for zeros that are not one number for each cable, or stand beside lengths that have theirs."""
    zeros, where = entry.encoder_zeros, f"window {entry.id}, encoder_zeros"
    if zeros is None:
        return
    if entry.lengths != "poses":
        raise FileError(index, where, 'only a window with lengths = "poses" has zeros of its own')
    if len(zeros) != cables or not np.isfinite(zeros).all():
        what = f"{len(zeros)} numbers; {cables} finite ones are expected, m, one for each cable"
        raise FileError(index, where, what)


def refuse_taken(out: Path, replaceable: str = "") -> None:
    """Raises SetupError where a campaign would be written over something: `out` is a file, or holds any.

    replaceable: a file that does not count where it is alone, such as the reasons why an import found no window.
    """
    if out.exists() and (not out.is_dir() or any(path.name != replaceable for path in out.iterdir())):
        raise SetupError(f"{out} exists already; nothing in it was touched.", hint="Choose another --out.")


def write_campaign(
    folder: Path, campaign: Campaign, *, robot_comment: str = "", suffix: Literal[".csv", ".mcap"] = ".csv"
) -> None:
    """Write a campaign folder that `read_campaign` reads back; its alignment is in the windows already."""
    (folder / "windows" if campaign.windows else folder).mkdir(parents=True, exist_ok=True)
    (folder / ALIGNMENT).unlink(missing_ok=True)
    write_robot(folder / ROBOT, campaign.robot, comment=robot_comment)
    entries = [
        IndexEntry(w.id, w.role, w.equilibrium, suffix, w.lengths_by_poses, w.encoder_zeros) for w in campaign.windows
    ]
    for window, entry in zip(campaign.windows, entries, strict=True):
        columns = WindowColumns(window.t, window.markers, window.lengths, window.currents, window.further)
        if suffix == ".csv":
            write_window_csv(folder / entry.file, columns)
        else:
            (folder / entry.file).write_bytes(window_as_mcap(columns))
    write_index(folder, campaign.name, campaign.sample_rate, entries, campaign.periods)


def write_index(
    folder: Path, name: str, sample_rate: float, entries: Sequence[IndexEntry], periods: tuple[Period, ...] = ()
) -> None:
    """Write campaign.toml whole or not at all: a run keeps it current after each accepted window."""
    windows = {"sample_rate": sample_rate, "window": [_entry_table(entry) for entry in entries]}
    table = {
        "format": FORMAT,
        "name": name,
        "robot": ROBOT,
        **({"period": as_tables(periods)} if periods else windows),
    }
    part = folder / (INDEX + ".part")
    part.write_text(tomli_w.dumps(table), encoding="utf-8")
    part.replace(folder / INDEX)


def _entry_table(entry: IndexEntry) -> dict[str, object]:
    table: dict[str, object] = {"id": entry.id, "file": entry.file, "role": entry.role.value}
    if entry.equilibrium is not None:
        table["equilibrium"] = [round(float(v), 6) for v in entry.equilibrium]
    if entry.lengths_by_poses:
        table["lengths"] = "poses"
    if entry.encoder_zeros is not None:
        table["encoder_zeros"] = [round(float(v), 7) for v in entry.encoder_zeros]
    return table
