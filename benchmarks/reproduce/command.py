"""What `fidim reproduce` does: simulate the paper's experiment, identify in its form and in ours, print, write.

Truth is the body that the paper identified (Eq. 46), nominal its CAD body (Eq. 43), the robot its Table 1. Twice: on
the optimised windows of Tables 2 and 3, and on twelve places drawn at random, which is what §5.2 says that the
experiment used. Marker noise is the stated ±0.2 mm, read as two standard deviations.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.reproduce import paper, simulated, tables
from benchmarks.reproduce.file import FORMAT, to_json
from benchmarks.reproduce.simulated import IdentifiedRun, Places, Reproduction, read
from benchmarks.reproduce.words import sentences
from fidim_lab.app import compose
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working
from fidim_lab.data.records import Campaign, Plan, Robot, Role
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import SetupError
from fidim_lab.identification.random_plan import Taste, random_plan
from fidim_lab.identification.results.validation import expected_sigma_perp
from fidim_lab.say import Say

EXTRA_MARKERS = ((0.14, 0.0, 0.10), (-0.10, 0.12, 0.10), (-0.10, -0.12, 0.10))
"""m, body frame; the paper does not say where its additional markers were"""
SMALL = (0.025,)
"""m of displacement of the random windows: "oscillates with small amplitude" (§5.2, footnote), as large as Table 3's"""


@dataclass(frozen=True)
class ReproduceOptions:
    """As on the command line."""

    seed: int
    noise: float
    """m, one standard deviation of a marker coordinate"""
    validation: int
    json_file: Path | None


def reproduce_command(options: ReproduceOptions) -> int:
    """Simulate, identify, print, write; returns the exit code. Raises SetupError for options that cannot be."""
    if options.seed < 0:
        raise SetupError(f"--seed {options.seed}: a seed is a whole number from 0 on.")
    with Working("reproducing the paper's experiment") as status:
        found = reproduce(options, status.update)
    write_answer(options.json_file, FORMAT, to_json(found))
    for shown in tables.everything(found):
        console.out.print(shown)
    for sentence in sentences(found):
        console.out.print(f"• {sentence}", markup=False)
    return 0


def reproduce(options: ReproduceOptions, says: Say) -> Reproduction:
    """The whole of it; `says` is told what goes on."""
    begin = perf_counter()
    robot = papers_robot(options.noise)
    says("Tables 2 and 3 …")
    optimised = simulated.optimised_windows(robot)
    table2 = Plan("Table 2", tuple(w.planned for w in optimised))
    says("drawing random places …")
    drawn = random_plan(robot, "random", len(optimised), options.validation, options.seed, Taste(amplitudes=SMALL))
    says("simulating the windows of Table 2 …")
    first = compose.simulated_campaign(robot, table2, paper.FREE.body, options.seed)
    says("simulating windows at random places …")
    second = compose.simulated_campaign(robot, drawn, paper.FREE.body, options.seed)
    says("identifying …")
    random = _places(robot, drawn, second, options.seed)
    free = random.free if isinstance(random.free, IdentifiedRun) else None
    return Reproduction(
        optimised=optimised,
        cost=simulated.cost(optimised),
        table2=_places(robot, table2, first, options.seed),
        full_without=read(first, simulated.FULL, simulated.hopeless(optimised)),
        random=random,
        sigma_perps={} if free is None else simulated.sigma_perps(second, free.body),
        expected=None if free is None else expected_sigma_perp(free.sigma_W, free.body, robot.freedoms),
        noise=options.noise,
        seconds=perf_counter() - begin,
    )


def papers_robot(noise: float) -> Robot:
    """Table 1 and Eq. 43 with markers for the full pose; `noise` is one standard deviation, m."""
    robot = read_robot(PAPERS_ROBOT)
    extra = tuple(np.array(place) for place in EXTRA_MARKERS)
    return replace(robot, extra_markers=extra, sensors=replace(robot.sensors, marker_noise=noise))


def _places(robot: Robot, plan: Plan, campaign: Campaign, seed: int) -> Places:
    found = tuple(w for w in plan.windows if w.role is Role.IDENTIFY)
    ideal = compose.simulated_campaign(robot, replace(plan, windows=found), paper.FREE.body, seed, noisy=False)
    one = simulated.main_marker_only(campaign)
    return Places(
        free=read(one, simulated.FREE),
        full=read(campaign, simulated.FULL),
        ours=read(one, simulated.OURS),
        noise_free=read(simulated.main_marker_only(ideal), simulated.FREE),
        noise_free_tidy=read(simulated.main_marker_only(ideal), simulated.TIDY),
    )
