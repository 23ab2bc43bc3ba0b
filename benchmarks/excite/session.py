"""A whole session by hand and by winches, in the same world, by the same plan: windows an hour, and accuracy.

    python -m benchmarks.excite session --runs 6        so many windows to identify from; two CPU minutes a session

Simulated drives and cameras through their real bytes, on a clock that jumps. The simulated person needs no time, so
what the procedure reckons with for one (`prompt_estimate`) is added for each question. Nothing damps the platform: the
winches have to take every swing away, and the model that is fitted is right.
"""

import argparse
import itertools
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.excite.strokes import LIMITS
from benchmarks.excite.windows import DESIGN, SEEDS, planned_by_winches
from benchmarks.page import table
from fidim_lab.app import compose
from fidim_lab.app.session.dry_run import SIMULATED_DAY
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Plan, Robot, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan
from fidim_lab.model.mechanism import Mechanism
from procedures.events import Event, StepFinished
from procedures.protocols.catalogue import experiment
from procedures.run import run_procedure
from procedures.settings import ExciteSettings, MotionSettings, RecordSettings, Settings
from procedures.steps import Ask, Reject

WORLDS = (4, 5, 6)
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


def held(kind: Kind, robot: Robot, plan: Plan, seed: int) -> Session:
    """Carry a session of this kind out in this world, identify by maximum likelihood, compare with the truth."""
    with TemporaryDirectory() as folder:
        return _held_in(kind, robot, plan, seed, Path(folder) / "run")


def _held_in(kind: Kind, robot: Robot, plan: Plan, seed: int, folder: Path) -> Session:
    motion = MotionSettings(length_limits=compose.length_limits(plan))
    settings = Settings(motion=motion, record=RecordSettings(seconds=kind.seconds), excite=kind.excite)
    world = compose.simulated_world(robot, seed, ())
    done: list[StepFinished] = []

    def listen(event: Event) -> None:
        if isinstance(event, StepFinished):
            done.append(event)

    async def run() -> float:
        able = kind.excite.acceleration
        async with compose.simulated_rig(robot, plan, world, seed, acceleration=able) as simulated:
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
    """All kinds of session, in several worlds."""
    robot, usual = read_robot(PAPERS_ROBOT), ExciteSettings()
    by_hand = random_plan(robot, "session", options.runs, 0, WORLDS[0], WITHIN_LIMITS)
    for_winches = Plan("session", planned_by_winches(SEEDS[0])[: options.runs])
    cases = [(kind, robot, for_winches if kind.designed else by_hand, seed) for kind in KINDS for seed in WORLDS]
    with ProcessPoolExecutor(options.jobs) as processes:
        every = iter(list(processes.map(held, *zip(*cases, strict=True))))
    of_kind = {kind.name: list(itertools.islice(every, len(WORLDS))) for kind in KINDS}
    text = (
        f"The paper's robot, {len(WORLDS)} worlds (hidden bodies), {options.runs} windows in each session; a plan "
        f"whose swings keep all limits by hand, winches up to {usual.speed:g} m/s and {usual.acceleration:g} m/s²; "
        f"plans for winches are those of `fidim design {' '.join(DESIGN)} --seed {SEEDS[0]}`, with as much. By the "
        "clock of simulated drives and cameras, and 15 s for each question to a person. Nothing damps the platform: "
        "winches take every swing away, and the maximum-likelihood model is right. Means are arithmetic, of standard "
        "deviations geometric.\n\n"
    )
    return text + _times(of_kind) + "\n\n" + _accuracies(of_kind)


def _times(of_kind: dict[str, list[Session]]) -> str:
    """How long sessions of each kind take."""

    def mean(values: Iterable[float]) -> str:
        return f"{np.mean(list(values)):.0f}"

    rows = [
        [
            name,
            sum(one.windows for one in sessions),
            sum(one.repeated for one in sessions),
            mean(one.seconds for one in sessions),
            f"{mean(one.asked for one in sessions)}: {mean(one.waited for one in sessions)}",
            mean(one.rate for one in sessions),
            mean(1e3 * one.swing for one in sessions),
        ]
        for name, sessions in of_kind.items()
    ]
    head = [
        "",
        "windows",
        "repeated",
        "simulated s of a session",
        "questions: s reckoned for them",
        "windows an hour",
        "swing, mm (median)",
    ]
    return table(head, rows)


def _accuracies(of_kind: dict[str, list[Session]]) -> str:
    """What sessions of each kind tell of the body, beside those of the first kind."""
    hand = of_kind[KINDS[0].name]
    sd = np.exp(np.mean([np.log(one.sd) for one in hand], axis=0))
    rows: list[list[object]] = [[f"{KINDS[0].name}: stated sd, m or m²", *(f"{value:.1e}" for value in sd), ""]]
    for name, sessions in of_kind.items():
        over = np.exp(np.mean([np.log(one.sd / by.sd) for one, by in zip(sessions, hand, strict=True)], axis=0))
        off = np.sqrt(np.mean([(one.error / one.sd) ** 2 for one in sessions], axis=0))
        rows.append([f"{name}: sd over a hand's", *(f"{value:.2f}" for value in (*over, np.exp(np.log(over).mean())))])
        rows.append(["… error over sd, rms", *(f"{value:.1f}" for value in (*off, np.sqrt((off**2).mean())))])
    return table(["", *NAMES, "all"], rows)
