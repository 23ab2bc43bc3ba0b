"""`fidim reproduce --recordings DIR`: the paper's equations from its own data, and maximum likelihood beside them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.reproduce import paper, recordings_words
from benchmarks.reproduce.processed import Processed, read_bodies, read_processed
from benchmarks.reproduce.recordings_file import FORMAT, to_json
from benchmarks.reproduce.recordings_found import ByCables, FromRecordings
from benchmarks.reproduce.recordings_tables import everything
from benchmarks.reproduce.takes import (
    SAMPLES,
    by_free_coordinates,
    by_full_pose,
    cross_validated,
)
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.records.import_takes import find_windows
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working
from fidim_lab.data.importers.grab import FITTED, GROUPS, VALIDATED, read_grab
from fidim_lab.data.importers.takes import Takes
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import SetupError
from fidim_lab.identification.joint.fit import FRICTION, alone, fit_jointly, fit_some
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.sharing import in_common
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.model.native import compiler
from fidim_lab.say import Say

SPAN = (8.0, 18.005)
"""s of each take that the laboratory used (frames 801 to 1801)"""
WINDOWS = 12
"""that the paper says it identified from"""
SHORTEST = 3.0
"""s of free motion within that; less is not fitted"""


def reproduce_recordings_command(folder: Path, json_file: Path | None) -> int:
    """Compute, print, write; returns the exit code. Raises FileError or SetupError for a folder of another kind."""
    with Working("reproducing from recordings") as status:
        found = reproduce_recordings(folder, status.update)
    write_answer(json_file, FORMAT, to_json(found))
    for table in everything(found):
        console.out.print(table)
    for sentence in recordings_words.sentences(found):
        console.out.print(f"• {sentence}", markup=False)
    return 0


def reproduce_recordings(folder: Path, says: Say) -> FromRecordings:
    """The whole of it; `says` is told what goes on."""
    begin = perf_counter()
    says("reading the takes …")
    groups = read_grab(folder)
    four = next((group for group in groups if group.robot.n == 4), None)
    if four is None:
        raise SetupError(f"{folder / 'vicon'}: no take of four cables; the paper's equations are about these.")
    fitted, missing = _processed(folder, sorted(FITTED))
    checked, absent = _processed(folder, sorted(VALIDATED))
    if not fitted:
        raise SetupError(
            f"{folder / 'processed'}: none of the takes that the paper fitted ({', '.join(map(str, sorted(FITTED)))}).",
            hint="fidim import grab and fidim identify work on any takes of this robot.",
        )
    says("Eq. 46, 47, 49, Fig. 3 …")
    full, free = by_full_pose(four.robot, fitted), by_free_coordinates(four.robot, fitted)
    says("maximum likelihood …")
    bodies = _bodies(groups)
    return FromRecordings(
        full=full,
        decimated=by_full_pose(four.robot, fitted[:WINDOWS], SAMPLES),
        free=free,
        checked=cross_validated(four.robot, checked, paper.FREE.body),
        laboratory=read_bodies(folder),
        bodies=bodies,
        missing=(*missing, *absent),
        seconds=perf_counter() - begin,
    )


def _processed(folder: Path, numbers: Sequence[int]) -> tuple[list[Processed], list[str]]:
    found = [read_processed(folder, number) for number in numbers]
    lacking = [str(number) for number, one in zip(numbers, found, strict=True) if one is None]
    said = [f"The folder has no filtered poses of takes {', '.join(lacking)}."] if lacking else []
    return [one for one in found if one is not None], said


def _bodies(groups: Sequence[Takes]) -> tuple[ByCables, ...]:
    """By each number of cables, and by all."""
    campaigns = [campaign for group in groups if (campaign := _campaign(group)) is not None]
    if not campaigns:
        return ()
    native = compiler() is not None
    common = in_common(campaigns)
    whole = fit_jointly(common, alone(common, native=native), FRICTION, native=native)
    if len(campaigns) == 1:
        return (_by(whole),)
    each = [fit_some(common, whole, (k,), native=native) for k in range(len(campaigns))]
    return (*(_by(one) for one in each), _by(whole))


def _campaign(group: Takes) -> Campaign | None:
    """The takes that the paper fitted, and all of fewer cables, cut as the laboratory cut them."""
    fitted = {f"k{number:02d}" for number in FITTED}
    chosen = tuple(take for take in group.takes if group.robot.n != GROUPS[0].cables or take.id in fitted)
    windows = [
        cut for one in find_windows(replace(group, takes=chosen)) for w in one.windows if (cut := _cut(w)) is not None
    ]
    if not windows:
        return None
    return Campaign(group.name, group.robot, 100.0, tuple(windows))


def _cut(window: Window) -> Window | None:
    rows = (window.t >= SPAN[0]) & (window.t <= SPAN[1])
    if not rows.any() or np.ptp(window.t[rows]) < SHORTEST:
        return None
    t, markers = window.t[rows], window.markers[rows]
    return replace(window, role=Role.IDENTIFY, t=t, markers=markers, lengths=None, currents=None)


def _by(found: JointFit) -> ByCables:
    figures = figures_of(found, found.start)
    left = [one.rms for of_one in found.remainders for one in of_one]
    cables = tuple(member.campaign.robot.n for member in found.members)
    return ByCables(cables, found.body, figures.spread, float(np.sqrt(np.mean(np.square(left)))), len(left))
