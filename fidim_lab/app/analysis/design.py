"""`fidim design`: the excitation that tells most (paper §4), as a plan, a table, JSON and a picture."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app.analysis.design_study import study_command
from fidim_lab.app.analysis.possible_robot import doubting, require_possible
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.spread_out import workers
from fidim_lab.app.terminal.windows_table import windows_table
from fidim_lab.app.terminal.working import Working
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import PARAMETER_NAMES, Plan, PlannedWindow, Robot, Role
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import SetupError
from fidim_lab.identification.design.limits import KINDS, worst_of_kinds
from fidim_lab.identification.design.search import Design, design
from fidim_lab.identification.design.task import ByWinches, Criterion, DesignTask
from fidim_lab.identification.excitation.place import WinchLimits
from fidim_lab.model.motion import conditioning, marker_selector

WRONG = 0.05
"""relative size of the wrong CAD values against which --robust designs"""
PAPER_C = 5.94


@dataclass(frozen=True)
class DesignOptions:
    """As on the command line."""

    robot: Path | None = None
    equilibria: int = 12
    samples: int = 100
    starts: int = 8
    criterion: str = "C"
    robust: int = 0
    seed: int = 1
    out: Path | None = None
    json_file: Path | None = None
    processes: int | None = None
    scheduler: str | None = None
    study: bool = False
    by_winches: bool = False
    damping: float = 0.08
    winch_speed: float = 0.5
    winch_acceleration: float = 1.0


def design_command(options: DesignOptions) -> int:
    """Design, write and print; returns the exit code. Raises as `run_design`."""
    if not options.study:
        _print(run_design(options), options)
        return 0
    path, robot, task = _task(options)
    with doubting(path, robot):
        return _studied(task, options)


def run_design(options: DesignOptions) -> Design:
    """Design one plan, and write it where the options say.

    Raises FileError for a robot file that cannot be meant, SetupError for what cannot be designed, InfeasibleError
    where no design obeys the limits.
    """
    path, robot, task = _task(options)
    with (
        doubting(path, robot),
        Working("designing", options.starts * options.equilibria) as shown,
        workers(options.processes, options.scheduler) as run,
    ):
        found = design(task, options.starts, options.seed, run, lambda text: shown.update(f"designing: {text}"))
    _write(found, options)
    return found


def _task(options: DesignOptions) -> tuple[Path, Robot, DesignTask]:
    """The robot file, the robot, and what is asked of it; raises as `run_design`."""
    path = options.robot or PAPERS_ROBOT
    robot = read_robot(path)
    require_possible(path, robot)
    task = DesignTask(
        robot,
        equilibria=options.equilibria,
        samples=options.samples,
        criterion=Criterion(options.criterion),
        winches=ByWinches(WinchLimits(options.winch_speed, options.winch_acceleration), options.damping)
        if options.by_winches
        else None,
        bodies=_wrong_bodies(robot, options.robust, options.seed),
    )
    if options.robust and options.criterion == Criterion.C:
        raise SetupError("--robust averages A or D over bodies; C does not use a body.", hint="Add --criterion A or D.")
    if options.study and options.by_winches:
        raise SetupError(
            "--study compares displacements by hand; --by-winches designs one plan.", hint="Give one of them."
        )
    if options.out is not None and options.out.exists() and any(options.out.iterdir()):
        raise SetupError(f"{options.out} is not empty; it was not changed.", hint="Choose another --out.")
    return path, robot, task


def _studied(task: DesignTask, options: DesignOptions) -> int:
    return study_command(
        task,
        starts=options.starts,
        seed=options.seed,
        out=options.out,
        json_file=options.json_file,
        processes=options.processes,
        scheduler=options.scheduler,
    )


def _write(found: Design, options: DesignOptions) -> None:
    told = as_json(found)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        write_plan(options.out / "plan.toml", as_plan(found))
        write_json(options.out / "design.json", told)
        write_picture(found, options.out / "equilibria.svg")
    if options.json_file is not None:  # may lie in the folder
        write_json(options.json_file, told)


def as_plan(found: Design) -> Plan:
    """What `fidim run` and `fidim simulate` take."""
    n = found.task.robot.n
    return Plan(
        name=f"design-{found.task.criterion}" + ("-by-winches" if found.task.winches else ""),
        windows=tuple(
            PlannedWindow(f"i{k:02d}", Role.IDENTIFY, z[:n], _aside(found, k - 1), rest)
            for k, (z, rest) in enumerate(zip(found.z, found.rests, strict=True), start=1)
        ),
    )


def as_json(found: Design) -> dict[str, object]:
    """As spec/formats.md fixes it, "fidim-design/1"."""
    n, tensions, bad = found.task.robot.n, found.motions.tensions, _conditionings(found)
    return {
        "format": "fidim-design/1",
        "criterion": found.task.criterion.value,
        "C": found.C,
        "value": found.value,
        "starts": [
            {
                "C" if found.task.criterion is Criterion.C else "value": one.value,
                "seconds": round(one.seconds, 3),
            }
            for one in found.starts
        ],
        "pool": found.pool,
        "seconds": round(found.seconds, 3),
        "equilibria": [
            {
                "lengths": [round(float(v), 5) for v in z[:n]],
                "displacement": [round(float(v), 5) for v in _aside(found, k)],
                "position": [round(float(v), 5) for v in found.rests[k]],
                "tension": [round(float(tensions[k].min()), 2), round(float(tensions[k].max()), 2)],
                "conditioning": round(float(bad[k]), 2),
            }
            for k, z in enumerate(found.z)
        ],
        "predicted_sd": {name: float(sd) for name, sd in zip(PARAMETER_NAMES, found.predicted_sd, strict=True)},
    }


def _wrong_bodies(robot: Robot, count: int, seed: int) -> tuple[np.ndarray, ...]:
    """Bodies around the CAD values, for a design that does not rest on them."""
    rng, nominal = np.random.default_rng([seed, 7]), robot.nominal.vector
    moved = WRONG * np.maximum(np.abs(nominal), 0.1 * np.abs(nominal[:6]).max())
    return tuple(nominal + moved * rng.uniform(-1, 1, 9) for _ in range(count))


def _aside(found: Design, k: int) -> np.ndarray:
    """Displacement of the marker's x and y at the start, m."""
    return found.motions.placed[k].marker_at(found.task.robot.marker)[1]


def _conditionings(found: Design) -> np.ndarray:
    """Worst of each window, over its whole motion."""
    motions, robot = found.motions, found.task.robot
    mechanism = found.task.mechanism()
    worst: list[float] = []
    for k in range(len(motions.placed)):
        positions, rotations = motions.trajectories.positions[k], motions.trajectories.rotations[k]
        xi = mechanism.structure_matrix(positions, rotations)
        worst.append(float(conditioning(xi, marker_selector(rotations, robot.marker, found.task.axes)).max()))
    return np.array(worst)


def _print(found: Design, options: DesignOptions) -> None:
    title = f"{found.task.equilibria} equilibria, {found.task.samples} samples each"
    numbers = [str(k) for k in range(1, len(found.z) + 1)]
    notes = [
        (f"{tensions.min():.1f} – {tensions.max():.1f}", f"{conditioning_:.1f}")
        for tensions, conditioning_ in zip(found.motions.tensions, _conditionings(found), strict=True)
    ]
    table = windows_table(title, numbers, as_plan(found).windows, notes, ("k", "tension, N", "cond."))
    console.out.print(table)
    for line in _lines(found, options):
        console.out.print(line, markup=False)


def _lines(found: Design, options: DesignOptions) -> list[str]:
    values = np.array([one.value for one in found.starts])
    good = values[np.isfinite(values)]
    worst = worst_of_kinds(found.motions).max(axis=0)
    below = f"{100 * float((values < 10).mean()):.0f} % with C < 10; " if found.task.criterion is Criterion.C else ""
    lines = [
        f"C           {found.C:.3f}   (the paper reached {PAPER_C} on its robot; it needs bounded conditioning: "
        f"at most {found.task.conditioning:g} here)",
        f"starts      {len(good)} of {len(values)} within the limits; {below}"
        f"best {good.min():.3g}, median {np.median(good):.3g}; "
        f"{np.mean([one.seconds for one in found.starts]):.2f} s a start",
        "limits      " + ", ".join(f"{name}: {-100 * v:.1f} % to spare" for name, v in zip(KINDS, worst, strict=True)),
        "predicted sd  "
        + ", ".join(f"{name} {sd:.1e}" for name, sd in zip(PARAMETER_NAMES, found.predicted_sd, strict=True)),
        *_by_winches(found),
        f"time        {found.seconds:.1f} s; {found.pool} random windows as a start",
    ]
    if options.out is not None:
        lines.append(f"written     {options.out / 'plan.toml'}, design.json, equilibria.svg")
        how = " --procedure excite --unattended" if options.by_winches else ""
        lines.append(f"next        fidim run {options.out / 'plan.toml'} --rig RIG.toml{how}")
    return lines


def _by_winches(found: Design) -> list[str]:
    winches = found.task.winches
    if winches is None:
        return []
    ways = [1e3 * float(np.linalg.norm(_aside(found, k))) for k in range(len(found.z))]
    can = f"{winches.limits.speed:g} m/s and {winches.limits.acceleration:g} m/s², {100 * winches.damping:g} % damping"
    return [f"winches     displacements of {min(ways):.0f} to {max(ways):.0f} mm in their reach: up to {can}"]


def write_picture(found: Design, path: Path) -> None:
    """Anchors, equilibria with their numbers, and the paths of the marker."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "fidim"
    from matplotlib import pyplot

    robot, motions = found.task.robot, found.motions
    paths = motions.trajectories.positions + motions.trajectories.rotations @ robot.marker
    anchors = np.array([cable.d for cable in robot.cables])
    figure, views = pyplot.subplots(1, 2, figsize=(10, 5), layout="constrained")
    for view, (a, b), title in zip(views, ((0, 1), (0, 2)), ("from above", "from the side"), strict=True):
        view.plot(anchors[:, a], anchors[:, b], "s", color="0.2", label="anchors")
        for k, path_of in enumerate(paths):
            view.plot(path_of[:, a], path_of[:, b], lw=0.6, color="C0")
            view.plot(*found.rests[k][[a, b]], ".", color="C3", ms=4)
            view.annotate(str(k + 1), found.rests[k][[a, b]], fontsize=8, xytext=(3, 3), textcoords="offset points")
        view.set(xlabel="xyz"[a] + " / m", ylabel="xyz"[b] + " / m", title=title, aspect="equal")
    figure.suptitle(f"{found.task.equilibria} equilibria, C = {found.C:.2f}")
    figure.savefig(path, format="svg", metadata={"Date": None})
    pyplot.close(figure)
