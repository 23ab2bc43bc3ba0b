"""Which windows the runs of `benchmarks.excite` are made at, and the run of each number, always the same.

Places that obey all limits when let go by hand, parts of their displacements, and those of plans for winches.
"""

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.excite.runs import Tries, Window, carried, one, possible, window_at, window_of
from benchmarks.excite.strokes import LIMITS
from fidim_lab.data.plan_file import read_plan
from fidim_lab.data.records import PlannedWindow
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.model.mechanism import Mechanism

WINDOWS = 30
"""where a hand may swing the platform"""
SESSION = 6
"""windows"""
PARTS_WANTED = (1.0, 0.7, 0.5, 0.35)
"""of the swing that a hand may give"""
SEEDS, TWELVE = (1, 2, 3), 12
"""of designs, and windows of each"""
DESIGN = ("--by-winches", f"--winch-speed={LIMITS.speed:g}", f"--winch-acceleration={LIMITS.acceleration:g}")
PLANS = Path("build/excite-by-winches")
FIDIM = str(Path(sys.executable).parent / "fidim")


@cache
def window_numbered(number: int, part: float = 1.0) -> Window:
    """A window of the page, and the part of its displacement that is wanted; each process makes those that it meets."""
    mechanism = _mechanism()
    return window_of(mechanism, _drawn()[number], part)


@cache
def _mechanism() -> Mechanism:
    return DesignTask(read_robot(PAPERS_ROBOT)).mechanism()


@cache
def _drawn() -> np.ndarray:
    task = DesignTask(read_robot(PAPERS_ROBOT))
    return pool.draw(_mechanism(), task, WINDOWS, np.random.default_rng(5), lambda _: None).z


def numbered(run: int) -> Tries:
    """The run of this number, always the same."""
    return one(run, window_numbered(run % WINDOWS))


def part_numbered(run: int) -> Tries:
    """The run of this number, always the same."""
    return one(*_body_and_part(run))


def _body_and_part(run: int) -> tuple[int, Window]:
    """Each hidden body meets all parts of a window's swing, one after the other."""
    body, which = divmod(run, len(PARTS_WANTED))
    return body, window_numbered(body % WINDOWS, PARTS_WANTED[which])


def session_numbered(run: int) -> list[Tries]:
    """The session of this number, always the same: so many different windows in an order of its own."""
    order = np.random.default_rng([run, 9]).choice(WINDOWS, SESSION, replace=False)
    return carried(run, [window_numbered(int(number)) for number in order])


def possible_of(run: int) -> tuple[float, str]:
    """Of the run of this number of `gentle`."""
    return possible(*_body_and_part(run))


def planned_by_winches(seed: int) -> tuple[PlannedWindow, ...]:
    """The windows of a plan as a user makes it; kept in build/."""
    folder = PLANS / f"seed-{seed}"
    if not (folder / "plan.toml").exists():
        subprocess.run([FIDIM, "design", *DESIGN, "--seed", str(seed), "--out", str(folder)], check=True)
    return read_plan(folder / "plan.toml", read_robot(PAPERS_ROBOT).n).windows


@cache
def window_by_winches(number: int) -> Window:
    """A window of all plans."""
    windows = [window for seed in SEEDS for window in planned_by_winches(seed)]
    window = windows[number % len(windows)]
    return window_at(ExcitationPlace.at(_mechanism(), np.asarray(window.lengths)), np.asarray(window.displacement))


def designed_numbered(run: int) -> Tries:
    """The run of this number, always the same."""
    return one(run, window_by_winches(run % (len(SEEDS) * TWELVE)))
