"""`fidim simulate`: a campaign from a simulated world, with its truth beside it, without bus, cameras or procedure.

Plan, hidden world and noise each have a random stream of the seed; two runs with the same options write the same bytes.
A campaign appears whole or not at all: it is written beside its place and then moved there.
"""

import shutil
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table

from fidim_lab.app import compose
from fidim_lab.app.analysis.possible_robot import require_possible
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import INDEX, refuse_taken, write_campaign
from fidim_lab.data.design_file import read_plan_or_design
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Campaign, Plan, Robot, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import SetupError, of_file
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan
from fidim_lab.units import millimetres
from sim_backends.mujoco_world.plant import MujocoPlant
from sim_backends.plant.hidden import KNOWN, HiddenEffect
from sim_backends.plant.own_sensors import OwnNoise
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import World
from sim_backends.simulate import (
    RecordedWindow,
    Sampling,
    SimulatedPlatform,
    can_rest,
    displaced_less,
    simulate_campaign,
)

FORMAT = "fidim-simulation/1"
TRUTH = "truth.json"
PLAN = "plan.toml"
MILDER = 3
"""times that a window whose tensions left their limits (Eq. 42) is displaced less; then it stays, and is told of"""


@dataclass(frozen=True)
class SimulateOptions:
    """As on the command line."""

    robot: Path
    out: Path
    hide: tuple[str, ...] = ()
    backend: str = "native"
    noise: float | None = None
    """m, of a marker component; None: as the robot file says"""
    seed: int = 1
    equilibria: int = 12
    validation: int = 6
    plan: Path | None = None
    """windows to record, as they are; None: random ones"""
    own_sensors: bool = False
    """record swivel encoders and an inclinometer too"""
    json_file: Path | None = None


@dataclass(frozen=True, eq=False)
class Simulated:
    """All that goes into the folder."""

    plan: Plan
    campaign: Campaign
    truth: dict[str, object]
    recorded: tuple[RecordedWindow, ...]


def simulate_command(options: SimulateOptions) -> int:
    """Simulate, write, print a table; returns the exit code. Raises as `run_simulate`."""
    done, world = run_simulate(options)
    console.out.print(_table(done))
    for line in _closing(done, world, options.out):
        console.out.print(line, markup=False)
    write_answer(options.json_file, FORMAT, _answer(done, options))
    return 0


def run_simulate(options: SimulateOptions) -> tuple[Simulated, World]:
    """Simulate and write the campaign folder; returns what is in it, and the world that was simulated.

    Raises SetupError for options that cannot be, FileError for a wrong robot file, InfeasibleError where the robot
    cannot swing as asked. Nothing is left behind then, nor after Ctrl-C.
    """
    robot = _declared(read_robot(options.robot), options.noise)
    if options.robot != PAPERS_ROBOT:
        require_possible(options.robot, robot)
    world = compose.simulated_world(robot, options.seed, options.hide)
    platform = _platform(world, options.backend)
    with _new_folder(options.out) as part:
        done = _simulate(robot, platform, options)
        write_campaign(part, done.campaign, robot_comment=_comment(options))
        write_plan(part / PLAN, done.plan)
        write_json(part / TRUTH, done.truth)
    return done, world


def _answer(done: Simulated, options: SimulateOptions) -> dict[str, object]:
    windows = [
        {"id": r.window.id, "role": r.window.role.value, "slack": bool(r.slack), "tension": list(r.tension)}
        for r in done.recorded
    ]
    return {"folder": str(options.out), "seed": options.seed, "hidden": list(options.hide), "windows": windows}


def _declared(robot: Robot, noise: float | None) -> Robot:
    """The robot whose file states the noise that its campaign has; a file cannot state none."""
    return robot if not noise else replace(robot, sensors=replace(robot.sensors, marker_noise=noise))


def _platform(world: World, backend: str) -> SimulatedPlatform:
    return MujocoPlant(world) if backend == "mujoco" else Plant(world)


def _simulate(robot: Robot, platform: SimulatedPlatform, options: SimulateOptions) -> Simulated:
    if options.plan is not None:
        with of_file(options.plan):
            return _recorded(robot, read_plan_or_design(options.plan, robot.n), platform, options)
    wanted = options.equilibria + options.validation
    name = options.out.resolve().name
    with _Progress("planning equilibria with room to swing", wanted) as shown:
        numbers = (options.equilibria, options.validation, options.seed)
        plan = random_plan(robot, name, *numbers, taste=WITHIN_LIMITS, progress=shown.reached, trial=can_rest(platform))
    done = _recorded(robot, plan, platform, options)
    for _ in range(MILDER):
        outside = _outside(done)
        if not outside:
            break
        console.warn([f"tensions leave their limits in {', '.join(outside)}; recorded again, displaced less"])
        done = _recorded(robot, displaced_less(done.plan, outside), platform, options)
    return done


def _outside(done: Simulated) -> list[str]:
    """The windows in which the true tensions left the robot's limits at some time of the free motion."""
    low, high = done.campaign.robot.limits.tension
    return sorted(r.window.id for r in done.recorded if r.slack or r.tension[0] < low or r.tension[1] > high)


def _recorded(robot: Robot, plan: Plan, platform: SimulatedPlatform, options: SimulateOptions) -> Simulated:
    noise = Noise.of(robot)
    if options.noise is not None:
        noise = replace(noise, marker=options.noise)
    recorded: list[RecordedWindow] = []
    with _Progress("simulating", len(plan.windows)) as shown:

        def watch(window: RecordedWindow) -> None:
            recorded.append(window)
            shown.reached(len(recorded))

        rng = np.random.default_rng([options.seed, 1])
        recording = Sampling(own_sensors=OwnNoise() if options.own_sensors else None)
        campaign, truth = simulate_campaign(
            robot, plan, platform.world, rng, noise, recording, platform=platform, watch=watch
        )
    about = {"seed": options.seed, "backend": options.backend, "marker_noise": noise.marker}
    return Simulated(plan, campaign, truth | about, tuple(recorded))


def _comment(options: SimulateOptions) -> str:
    """The head of the campaign's robot file."""
    return (
        f"What is known of the robot of a simulated campaign (fidim simulate, backend {options.backend}, "
        f"seed {options.seed}).\nIts true body, and what else is hidden, is in {TRUTH}."
    )


@contextmanager
def _new_folder(out: Path) -> Generator[Path]:
    """A folder to write to that becomes `out` at the end; gone where the end is not reached."""
    refuse_taken(out)
    there = out.resolve()
    part = there.with_name(f".{there.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        yield part
        _move(part, there)
    except OSError as error:
        raise SetupError(
            f"{out} cannot be written: {error.strerror or error}.", hint="Choose another --out, or make room."
        ) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _move(part: Path, out: Path) -> None:
    """`part` becomes `out`; an empty folder that is there already may be somebody's working directory, and stays."""
    if not out.exists():
        part.replace(out)
        return
    for item in sorted(part.iterdir(), key=lambda item: item.name == INDEX):
        item.replace(out / item.name)


class _Progress:
    """A bar on a terminal, one line elsewhere; on standard error."""

    def __init__(self, what: str, wanted: int) -> None:
        self._what, self._wanted = what, wanted
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=console.err, transient=True, disable=not console.err.is_terminal)
        self._task = TaskID(0)

    def __enter__(self) -> "_Progress":
        if not console.err.is_terminal:
            console.err.print(f"{self._what}: {self._wanted} windows …", markup=False)
        self._bar.start()
        self._task = self._bar.add_task(self._what, total=self._wanted)
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def reached(self, done: int, wanted: int | None = None) -> None:
        """So many windows are done."""
        self._bar.update(self._task, completed=done)


def _table(done: Simulated) -> Table:
    """One row a window."""
    rows: list[tuple[str, ...]] = []
    for recorded in done.recorded:
        window, (low, high) = recorded.window, recorded.tension
        slack = "".join(f"cable {i.cable}" for i in recorded.slack[:1])
        moves = f"{millimetres(_amplitude(window)):.0f}"
        rest = ", ".join(f"{value:.3f}" for value in _place(window))
        rows.append((window.id, window.role.value, rest, moves, f"{low:.1f} – {high:.1f}", slack))
    names = ("window", "role", "equilibrium, m", "amplitude, mm", "tension, N", "slack")
    return console.table(f"Simulated campaign {done.campaign.name}", names, rows, left=2)


def _place(window: Window) -> np.ndarray:
    return np.full(3, np.nan) if window.equilibrium is None else window.equilibrium


def _amplitude(window: Window) -> float:
    """Largest distance of the main marker from its equilibrium, m."""
    return float(np.nanmax(np.linalg.norm(window.markers[:, 0] - _place(window), axis=1)))


def _closing(done: Simulated, world: World, out: Path) -> Iterable[str]:
    slack = [recorded.window.id for recorded in done.recorded if recorded.slack]
    yield "hidden      " + ("; ".join(_says(effect) for effect in world.hidden) or "nothing but the body")
    if outside := _outside(done):
        low, high = done.campaign.robot.limits.tension
        yield f"limits      tensions leave {low:g} to {high:g} N in {', '.join(outside)}: Eq. 42 does not hold there"
    if slack:
        yield f"slack       a cable goes slack in {', '.join(slack)}: no model of free motion holds there"
    yield f"truth       {out / TRUTH}"
    yield f"campaign    {out}"
    yield f"next        fidim identify {out}"


def _says(effect: HiddenEffect) -> str:
    """An effect with its size."""
    where = "" if effect.cable is None else f" of cable {effect.cable}"
    keys = KNOWN[effect.id].keys
    sizes = ", ".join(f"{name} = {value:g} {keys[name].unit}" for name, value in effect.parameters if value)
    return f"{effect.id}{where} ({sizes})"
