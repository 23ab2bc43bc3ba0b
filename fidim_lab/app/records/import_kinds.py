"""Which importer a KIND of `fidim import` means, the options each takes, and the files that a command names."""

import fnmatch
import glob
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fidim_lab.app.records.import_gyro import GYRO, GyroOptions, import_gyro_command
from fidim_lab.app.records.import_logs import match
from fidim_lab.app.records.import_periods import PERIODS, import_periods_command
from fidim_lab.app.records.import_recording import import_command
from fidim_lab.app.records.import_takes import JOURNAL, import_takes_command
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import refuse_taken
from fidim_lab.data.importers.c3d_file import read_c3d
from fidim_lab.data.importers.grab import read_grab
from fidim_lab.data.importers.gyro_csv import RATE_UNITS
from fidim_lab.data.importers.map_proposal import proposed_map
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.importers.motive_csv import read_motive
from fidim_lab.data.importers.qtm_mat import read_qtm_mat
from fidim_lab.data.importers.qtm_tsv import read_qtm
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.registry import READERS
from fidim_lab.data.importers.robot_log import read_robot_log
from fidim_lab.data.importers.ros_bag import read_bag
from fidim_lab.data.importers.takes import Asked, EncoderLog, Take, Takes
from fidim_lab.data.importers.trc import read_trc
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError, SetupError
from fidim_lab.say import counted

MARKER_READERS: Mapping[str, Callable[[Path], MarkerLog]] = MappingProxyType(
    {
        "vicon-text": read_trajectories,
        "vicon-csv": read_trajectories,
        "motive-csv": read_motive,
        "qtm-tsv": read_qtm,
        "qtm-mat": read_qtm_mat,
        "trc": read_trc,
        "c3d": read_c3d,
    }
)
"""kinds of which one file is one take"""
MAPPED, BAGS = "csv", ("mcap", "ros2-bag")
"""alike, by a column map; and by topics"""
VIRTUAL = 0.2
"""m, from the marker to two virtual ones along the body's axes where only poses were exported: as real ones are"""


@dataclass(frozen=True)
class ImportOptions:
    """What was said beside kind and files."""

    robot: Path | None = None
    takes: str | None = None
    """grab: numbers; else a pattern of file names"""
    map_file: Path | None = None
    logs: tuple[str, ...] = ()
    """patterns of robot logs"""
    log_map: Path | None = None
    topics: tuple[str, ...] = ()
    asked: Asked = field(default_factory=Asked)
    lengths: tuple[str, ...] = ()
    axes: str | None = None
    """of a gyroscope alone; lengths of periods, too"""


def import_kind_command(
    kind: str, sources: Sequence[Path], out: Path, options: ImportOptions, json_file: Path | None
) -> int:
    """Import by kind. Returns the exit code; raises FidimError."""
    if kind in (GYRO, PERIODS):
        return _import_pendulum(kind, sources, out, options, json_file)
    if options.lengths or options.axes is not None or options.asked.unit in RATE_UNITS:
        raise SetupError(
            f"--axes and units of angular rates belong to {GYRO}, --lengths to {GYRO} and {PERIODS}, not to {kind}."
        )
    if kind != MAPPED and options.map_file is not None:
        raise SetupError(f"--map belongs to {MAPPED}, not to {kind}.")
    if kind == MAPPED and options.map_file is None:
        raise _unmapped(_files(kind, sources, options.takes)[0])
    if options.topics and kind not in BAGS:
        raise SetupError(f"--topic belongs to {' and '.join(BAGS)}.")
    if kind in MARKER_READERS or kind == MAPPED or kind in BAGS:
        if options.robot is None:
            raise SetupError(f"{kind} needs --robot.", hint="--robot names a robot file.")
        refuse_taken(out, JOURNAL)
        return import_takes_command([read_files(kind, sources, options)], out, json_file)
    if options.robot is not None or options.logs or options.log_map is not None or options.asked != Asked():
        raise SetupError(
            f"{kind} brings its own geometry and logs: it takes no --robot, --log, --up, --unit, --rate, --order, "
            "--body, --cables."
        )
    if kind == "grab":
        if len(sources) != 1:
            raise SetupError("grab reads one folder.")
        wanted = None if options.takes is None else take_numbers(options.takes)
        refuse_taken(out, JOURNAL)
        return import_takes_command(read_grab(sources[0], lambda k: wanted is None or k in wanted), out, json_file)
    if options.takes is not None:
        raise SetupError("--takes can only be used with grab, and with kinds whose files are takes.")
    if kind not in READERS:
        known = ", ".join(sorted([*READERS, *MARKER_READERS, *BAGS, MAPPED, "grab", GYRO, PERIODS]))
        raise SetupError(f"No recording of kind {kind!r} is known.", hint=f"Known kinds: {known}.")
    return import_command(kind, list(sources), out, json_file)


def _import_pendulum(
    kind: str, sources: Sequence[Path], out: Path, options: ImportOptions, json_file: Path | None
) -> int:
    """A phone's recordings, or periods. Raises FidimError."""
    rest = replace(options, robot=None, takes=None, lengths=())
    if kind == GYRO:
        rest = replace(rest, axes=None, asked=replace(rest.asked, unit=None))
    if rest != ImportOptions() or options.robot is None:
        needs = f"{GYRO} needs --robot and --lengths, and takes --axes, --unit and --takes beside them alone."
        raise SetupError(needs if kind == GYRO else f"{kind} needs --robot, and takes --lengths and --takes alone.")
    files = _files(kind, sources, options.takes)
    if kind == PERIODS:
        return import_periods_command(files, out, options.robot, options.lengths, json_file)
    return import_gyro_command(
        files, out, GyroOptions(options.robot, options.lengths, options.axes, options.asked.unit), json_file
    )


def _unmapped(path: Path) -> SetupError:
    """That a table needs a map, and how to write one: a proposal for it is printed. Raises FileError for no table."""
    console.out.print(proposed_map(path), end="", markup=False, highlight=False, soft_wrap=True)
    return SetupError(
        f"{MAPPED} needs --map: a file that says which column is what. Above is one for {path.name}.",
        hint="Save it as map.toml (or end the same command with > map.toml), correct it, and add --map map.toml.",
    )


def read_files(kind: str, sources: Sequence[Path], options: ImportOptions) -> Takes:
    """The takes of single files and one robot file. Raises FileError, SetupError.

    One file that cannot be read is an error; of several, those that cannot be read are named in `unread`.
    """
    files = _files(kind, sources, options.takes)
    names = [_id(path.stem) for path in files]
    for name in names:
        if names.count(name) > 1:
            raise SetupError(f"Two files are named {name}: their windows would have the same name.")
    if options.robot is None:
        raise SetupError(f"{kind} needs --robot.")
    robot = read_robot(options.robot)
    _check_cables(options.asked.cables, robot.n, options.logs)
    takes: list[Take] = []
    unread: dict[str, str] = {}
    for name, path in zip(names, files, strict=True):
        try:
            takes.append(Take(name, _reader(kind, options)(path)))
        except FidimError as error:
            if len(files) == 1:
                raise
            unread[name] = str(error)
    if not takes:
        raise SetupError(f"None of {len(files)} files could be read; the first: {next(iter(unread.values()))[:300]}")
    logs, unread_logs = _logs(options, robot.n)
    matched, left = match(takes, logs)
    unread |= unread_logs | left
    return Takes(
        kind, _id(options.robot.stem), _with_markers(robot, takes), options.robot, matched, unread, options.asked
    )  # fmt: skip


def _reader(kind: str, options: ImportOptions) -> Callable[[Path], MarkerLog]:
    if options.map_file is not None:
        return partial(read_mapped, map_file=options.map_file)
    return partial(read_bag, topics=options.topics) if kind in BAGS else MARKER_READERS[kind]


def _files(kind: str, sources: Sequence[Path], pattern: str | None) -> Sequence[Path]:
    """Files that are named, found by a pattern, or stand in a named folder; a folder may be a bag itself."""
    found: list[Path] = []
    for source in sources:
        if source.is_dir() and (pattern is not None or kind not in BAGS):
            found += [path for path in sorted(source.iterdir()) if fnmatch.fnmatchcase(path.name, pattern or "[!.]*.*")]
        elif not source.exists() and glob.has_magic(str(source)):
            found += [Path(path) for path in sorted(glob.glob(str(source)))]  # noqa: PTH207 - a pattern with its folder
        elif pattern is None or fnmatch.fnmatchcase(source.name, pattern):
            found.append(source)
    if not found:
        raise SetupError(f"No file matches {', '.join(map(str, sources))[:200]} {pattern or ''}".rstrip() + ".")
    return found


def _logs(options: ImportOptions, cables: int) -> tuple[list[EncoderLog], dict[str, str]]:
    """The robot logs that could be read, and why the others could not."""
    paths = [Path(path) for pattern in options.logs for path in sorted(glob.glob(pattern)) or [pattern]]  # noqa: PTH207
    logs: list[EncoderLog] = []
    unread: dict[str, str] = {}
    for path in dict.fromkeys(paths):
        try:
            logs.append(_reordered(read_robot_log(path, cables, options.log_map), options.asked.cables))
        except FidimError as error:
            if len(paths) == 1:
                raise
            unread[path.name] = str(error)
    if paths and not logs:
        raise SetupError(f"None of {len(paths)} logs could be read; the first: {next(iter(unread.values()))[:300]}")
    return logs, unread


def _check_cables(cables: Sequence[int], n: int, logs: Sequence[str]) -> None:
    """Raises SetupError where --cables is no order of n cables, or there is no log that it could be about."""
    if cables and not logs:
        raise SetupError("--cables is about the cables of a robot log.", hint="--log names the log.")
    if cables and sorted(cables) != list(range(1, n + 1)):
        what = f"--cables {','.join(map(str, cables))[:60]} is not an order of the numbers 1 to {n}."
        raise SetupError(what, hint="It names the log's cables in the robot file's order, each once.")


def _reordered(log: EncoderLog, cables: Sequence[int]) -> EncoderLog:
    """The log's columns in the order that was asked for."""
    if not cables:
        return log
    at = [k - 1 for k in cables]
    swivels, currents = (None if columns is None else columns[:, at] for columns in (log.swivels, log.currents))
    words = f"the robot file's cables 1 to {len(at)} are the log's {', '.join(map(str, cables))}, as requested"
    return replace(log, lengths=log.lengths[:, at], swivels=swivels, currents=currents, decided=(*log.decided, words))


def _with_markers(robot: Robot, takes: Sequence[Take]) -> Robot:
    """The robot with two virtual markers more, where it names too few and only poses were exported."""
    if len(robot.markers) >= 3:
        return robot
    if any(not take.markers.bodies for take in takes):
        what = f"The robot file names {counted(len(robot.markers), 'marker')}; a pose needs three."
        raise SetupError(what, hint="Add extra_markers, or export a rigid body.")
    return replace(robot, extra_markers=tuple(robot.marker + VIRTUAL * axis for axis in np.eye(3)[:2]))


def _id(stem: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", stem)


def cable_numbers(text: str) -> tuple[int, ...]:
    """Numbers of "2,1,3,4". Raises SetupError."""
    if not re.fullmatch(r"\s*[0-9]{1,2}\s*(,\s*[0-9]{1,2}\s*)*", text):
        raise SetupError(f"--cables {text[:60]!r} is not numbers, such as 2,1,3,4.")
    return tuple(int(number) for number in text.split(","))


def take_numbers(text: str) -> frozenset[int]:
    """Numbers of "1-36,40". Raises SetupError."""
    numbers: set[int] = set()
    for part in text.split(","):
        match_ = re.fullmatch(r"\s*([0-9]{1,4})\s*(?:-\s*([0-9]{1,4})\s*)?", part)
        if not match_ or int(match_.group(2) or match_.group(1)) < int(match_.group(1)):
            raise SetupError(f"--takes {text!r} is not numbers and ranges, such as 1-36,40.")
        numbers.update(range(int(match_.group(1)), int(match_.group(2) or match_.group(1)) + 1))
    return frozenset(numbers)
