"""A whole session by hand and by winches, in the same world, by the same plan: windows an hour, and accuracy.

    python -m benchmarks.excite session --runs 6        so many windows to identify from; 20 CPU seconds a window

Simulated drives and cameras through their real bytes, on a clock that jumps. The simulated person needs no time, so
what the procedure reckons with for one (`prompt_estimate`) is added for each question. Nothing damps the platform: the
winches have to take every swing away, and the model that is fitted is right.
"""

import argparse
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.excite_strokes import LIMITS
from benchmarks.excite_windows import DESIGN, SEEDS, planned_by_winches
from benchmarks.page import table
from fidim_lab.app import compose
from fidim_lab.app.dry_run import SIMULATED_DAY, UNTOUCHED
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Plan, Robot, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.mechanism import Mechanism
from procedures.catalogue import experiment
from procedures.events import Event, StepFinished
from procedures.run import run_procedure
from procedures.settings import ExciteSettings, MotionSettings, RecordSettings, Settings
from procedures.steps import Ask, Reject

SEED = 4
STRONGER = ExciteSettings(speed=LIMITS.speed, acceleration=LIMITS.acceleration)
"""what plans for winches are designed for"""
NAMES = ("s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")


@dataclass(frozen=True)
class Kind:
    """A kind of session."""

    name: str
    procedure: str
    seconds: float
    """of each window"""
    excite: ExciteSettings = field(default=ExciteSettings())
    designed: bool = False
    """whether its plan is one for winches"""


KINDS = (
    Kind("by hand", "identify", 10.0),
    Kind("by winches", "excite", 10.0),
    Kind("by winches, windows of 20 s", "excite", 20.0),
    Kind("by a plan for winches", "excite", 10.0, STRONGER, designed=True),
    Kind("by a plan for winches, windows of 20 s", "excite", 20.0, STRONGER, designed=True),
)


@dataclass(frozen=True, eq=False)
class Session:
    """One session, recorded and identified from."""

    windows: int
    repeated: int
    seconds: float
    """by the simulated clock"""
    asked: int
    waited: float
    """s that a person is reckoned with for the questions"""
    swing: float
    """m, median over the windows of how far the marker swings to each side"""
    error: np.ndarray
    """of the nine parameters, m and m²"""
    sd: np.ndarray
    """as stated"""

    @property
    def rate(self) -> float:
        """Windows an hour."""
        return 3600 * self.windows / (self.seconds + self.waited)


def held(kind: Kind, robot: Robot, plan: Plan, folder: Path) -> Session:
    """Carry a session of this kind out, identify by maximum likelihood, compare with the truth."""
    motion = MotionSettings(length_limits=compose.length_limits(plan))
    settings = Settings(motion=motion, record=RecordSettings(seconds=kind.seconds), excite=kind.excite)
    world = compose.simulated_world(robot, SEED, ())
    done: list[StepFinished] = []

    def listen(event: Event) -> None:
        if isinstance(event, StepFinished):
            done.append(event)

    async def run() -> float:
        able = kind.excite.acceleration
        async with compose.simulated_rig(robot, plan, world, SEED, acceleration=able) as simulated:
            made = experiment(kind.procedure, plan, robot, settings)
            report = await run_procedure(
                made, simulated.rig, folder, wall_time=lambda: SIMULATED_DAY, listeners=(listen,)
            )
            return report.seconds

    took = compose.run_loop(run(), real_time=False)
    questions = [event.step for event in done if isinstance(event.step, Ask)]
    windows = read_campaign(folder).windows
    found = fit(Mechanism(robot, native=True), windows)
    return Session(
        windows=len(windows),
        repeated=sum(isinstance(event.step, Reject) for event in done),
        seconds=took,
        asked=len(questions),
        waited=sum(step.estimate for step in questions),
        swing=float(np.median([_far(window) for window in windows])),
        error=found.body.vector - world.body.vector,
        sd=np.sqrt(np.diag(found.covariance))[:9],
    )


def _far(window: Window) -> float:
    """Half of the largest way to and fro of any coordinate in the first three seconds, m."""
    first = window.markers[window.t <= window.t[0] + 3.0, 0]
    return float((np.nanmax(first, axis=0) - np.nanmin(first, axis=0)).max() / 2)


def session(options: argparse.Namespace) -> str:
    """All kinds of session."""
    robot, usual = read_robot(PAPERS_ROBOT), ExciteSettings()
    by_hand = random_plan(robot, "session", options.runs, 0, SEED, UNTOUCHED)
    for_winches = Plan("session", planned_by_winches(SEEDS[0])[: options.runs])
    rows: list[list[object]] = []
    errors: list[list[object]] = []
    for kind in KINDS:
        with TemporaryDirectory() as folder:
            one = held(kind, robot, for_winches if kind.designed else by_hand, Path(folder) / "run")
        rows.append(
            [
                kind.name,
                f"{one.windows} ({one.repeated} repeated)",
                f"{one.seconds:.0f}",
                f"{one.asked}: {one.waited:.0f}",
                f"{one.rate:.0f}",
                f"{1e3 * one.swing:.0f}",
            ]
        )
        errors.append([f"{kind.name}: error", *(f"{value:+.1e}" for value in one.error)])
        errors.append(["… stated sd", *(f"{value:.1e}" for value in one.sd)])
    head = ["", "windows", "simulated s", "questions: s reckoned for them", "windows an hour", "swing, mm (median)"]
    text = (
        "The paper's robot, a plan whose swings keep all limits by hand, the same hidden body and places; winches go "
        f"up to {usual.speed:g} m/s and {usual.acceleration:g} m/s²; plans for winches are those of `fidim design "
        f"{' '.join(DESIGN)} --seed {SEEDS[0]}`, with as much. By the clock of simulated drives and cameras, "
        "and 15 s for each question to a person. Nothing damps the platform: winches take every swing away, and the "
        "maximum-likelihood model is right.\n\n"
    )
    return text + table(head, rows) + "\n\n" + table(["m, m²", *NAMES], errors)
