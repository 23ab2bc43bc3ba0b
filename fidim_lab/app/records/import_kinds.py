"""Which importer a KIND of `fidim import` means, and the options each takes."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType

from fidim_lab.app.records.import_recording import import_command
from fidim_lab.app.records.import_takes import import_takes_command
from fidim_lab.data.campaign import refuse_taken
from fidim_lab.data.importers.grab import read_grab
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.importers.motive_csv import read_motive
from fidim_lab.data.importers.qtm_tsv import read_qtm
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.registry import READERS
from fidim_lab.data.importers.takes import Take, Takes
from fidim_lab.data.importers.trc import read_trc
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import SetupError

MARKER_READERS: Mapping[str, Callable[[Path], MarkerLog]] = MappingProxyType(
    {
        "vicon-text": read_trajectories,
        "vicon-csv": read_trajectories,
        "motive-csv": read_motive,
        "qtm-tsv": read_qtm,
        "trc": read_trc,
    }
)
"""kinds of which one file is one take"""
MAPPED = "csv"
"""alike, by a column map"""


def import_kind_command(
    kind: str,
    sources: list[Path],
    out: Path,
    robot: Path | None,
    takes: str | None,
    json_file: Path | None,
    map_file: Path | None = None,
) -> int:
    """Import by kind. Returns the exit code; raises FidimError."""
    wanted = None if takes is None else take_numbers(takes)
    if (kind == MAPPED) != (map_file is not None):
        raise SetupError(f"--map belongs to {MAPPED}, which needs it.")
    if kind in MARKER_READERS or kind == MAPPED:
        if robot is None or wanted is not None:
            raise SetupError(f"{kind} needs --robot and takes no --takes.", hint="--robot names a robot file.")
        refuse_taken(out)
        return import_takes_command([read_files(kind, sources, robot, map_file)], out, json_file)
    if robot is not None:
        raise SetupError(f"{kind} brings its own geometry: it takes no --robot.")
    if kind == "grab":
        if len(sources) != 1:
            raise SetupError("grab reads one folder.")
        refuse_taken(out)
        return import_takes_command(read_grab(sources[0], lambda k: wanted is None or k in wanted), out, json_file)
    if wanted is not None:
        raise SetupError("--takes belongs to grab.")
    if kind not in READERS:
        known = ", ".join(sorted([*READERS, *MARKER_READERS, MAPPED, "grab"]))
        raise SetupError(f"No recording of kind {kind!r} is known.", hint=f"Known kinds: {known}.")
    return import_command(kind, sources, out, json_file)


def read_files(kind: str, sources: Sequence[Path], robot: Path, map_file: Path | None = None) -> Takes:
    """The takes of single files and one robot file. Raises FileError, SetupError."""
    names = [source.stem for source in sources]
    for name in names:
        if names.count(name) > 1:
            raise SetupError(f"Two files are named {name}: their windows would have the same name.")
    known = read_robot(robot)
    if len(known.markers) < 3:
        raise SetupError(f"{robot} names {len(known.markers)} markers; a pose needs three.", hint="Add extra_markers.")
    read = MARKER_READERS[kind] if map_file is None else partial(read_mapped, map_file=map_file)
    takes = tuple(Take(_id(path.stem), read(path)) for path in sources)
    return Takes(kind, _id(robot.stem), known, robot, takes)


def _id(stem: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", stem)


def take_numbers(text: str) -> frozenset[int]:
    """Numbers of "1-36,40". Raises SetupError."""
    numbers: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]{1,4})\s*(?:-\s*([0-9]{1,4})\s*)?", part)
        if not match or int(match.group(2) or match.group(1)) < int(match.group(1)):
            raise SetupError(f"--takes {text!r} is not numbers and ranges, such as 1-36,40.")
        numbers.update(range(int(match.group(1)), int(match.group(2) or match.group(1)) + 1))
    return frozenset(numbers)
