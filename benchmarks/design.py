"""Design of excitation on the paper's problem: C, time of a start against SciPy with finite differences, workers.

    python -m benchmarks.design criterion --starts 100      C, share of starts below 10, seconds of a start
    python -m benchmarks.design peers --gradients 3         one start against SLSQP and trust-constr
    python -m benchmarks.design workers --starts 20         1 and 2 processes, a dask cluster of two, same results?
    python -m benchmarks.design disagree                    what designs by C, A and D are worth by each criterion

Times are CPU seconds, except of the workers, which are wall seconds.
"""

import argparse
from collections.abc import Callable, Iterable
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.design_peers import peers, quiet
from benchmarks.page import table, write_section
from fidim_lab.app.terminal.spread_out import workers
from fidim_lab.data.records import Pose
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.design import information, pool
from fidim_lab.identification.design.limits import KINDS, worst_of_kinds
from fidim_lab.identification.design.search import Design, DesignFound, DesignStart, begin_at, design
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.model.motion import conditioning, marker_selector
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import make_world

PAPER, GOAL = 5.94, 10.0
OFTEN = 500.0
"""Hz, at which another simulator is looked at"""


def timed(start: DesignStart) -> tuple[DesignFound, float]:
    """A start, and its CPU seconds."""
    begin = process_time()
    return begin_at(start), process_time() - begin


def criterion(options: argparse.Namespace) -> str:
    task = DesignTask(read_robot(PAPERS_ROBOT))
    spent: list[float] = []

    def run(_: Callable[[DesignStart], DesignFound], starts: Iterable[DesignStart]) -> Iterable[DesignFound]:
        with workers(options.processes) as spread:
            for one, seconds in spread(timed, starts):
                spent.append(seconds)
                yield one

    begin, clock = process_time(), perf_counter()
    found = design(task, options.starts, 1, run, quiet)
    clock = perf_counter() - clock
    alone = process_time() - begin - (sum(spent) if options.processes == 1 else 0.0)
    values = np.array([one.value for one in found.starts])
    spare = worst_of_kinds(found.motions).max(axis=0)
    lines = [
        ("C of the best design", f"{found.C:.3f} (the paper: {PAPER})"),
        ("starts with C < 10", f"{100 * float((values < GOAL).mean()):.0f} % of {len(values)}"),
        ("C of the starts: least, median, largest", ", ".join(f"{v:.2f}" for v in np.quantile(values, (0, 0.5, 1)))),
        ("CPU time of a start, median and largest", f"{np.median(spent):.2f} s, {np.max(spent):.2f} s"),
        ("… of random windows, exchange and polish beside them", f"{alone:.1f} s"),
        (f"all of it by the clock, {options.processes} processes", f"{clock:.0f} s"),
        *((f"{kind}: to spare", f"{-100 * v:.2f} %") for kind, v in zip(KINDS, spare, strict=True)),
        *_by_another_simulator(found),
    ]
    return f"n_e = {task.equilibria}, {task.samples} samples, conditioning ≤ {task.conditioning:g}.\n\n" + table(
        ["", ""], lines
    )


def _by_another_simulator(found: Design) -> list[tuple[str, str]]:
    """The design carried out by `sim_backends`, which has a formulation and an integrator of its own."""
    task = found.task
    robot = task.robot
    plant = Plant(replace(make_world(robot, np.random.default_rng(1), body=robot.nominal), mass=robot.mass))
    tensions, aside, poses, slack = [], [], list[Pose](), 0
    for lengths, displacement in zip(found.z[:, : robot.n], found.z[:, robot.n :], strict=True):
        rest = plant.rest(lengths)
        plant.place(rest, lengths)
        still = plant.markers()[0]
        plant.place(plant.rest(lengths, plant.pose, displacement), lengths)
        for t in np.arange(round(task.seconds * OFTEN) + 1) / OFTEN:
            plant.advance(t)
            tensions.append(plant.tensions)
            aside.append(plant.markers()[0] - still)
            poses.append(plant.pose)
        slack += len(plant.slack)
    rotations = np.array([pose.rotation for pose in poses])
    xi = task.mechanism().structure_matrix(np.array([pose.position for pose in poses]), rotations)
    worst = conditioning(xi, marker_selector(rotations, robot.marker, task.axes)).max()
    most = np.abs(aside).max(axis=0)[: len(task.axes)]
    return [
        (f"another simulator, {OFTEN:g} Hz: tensions", f"{np.min(tensions):.2f} to {np.max(tensions):.2f} N"),
        ("… cables that were slack", str(slack)),
        ("… largest displacements of the marker", ", ".join(f"{1e3 * v:.2f} mm" for v in most)),
        ("… conditioning, at the poses that it says", f"{worst:.2f} at most"),
    ]


def spread(options: argparse.Namespace) -> str:
    from distributed import LocalCluster

    task = DesignTask(read_robot(PAPERS_ROBOT))
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, 120, np.random.default_rng([1, 0]), quiet)
    starts = [DesignStart(task, drawn, (1, 1 + k)) for k in range(options.starts)]
    begin_at(starts[0])  # compiled kernels are in the cache from here on
    rows: list[list[object]] = []
    reference: list[bytes] = []
    alone = 0.0

    def measure(name: str, run: Callable[..., Any]) -> None:
        nonlocal reference, alone
        begin = perf_counter()
        found: list[DesignFound] = list(run(begin_at, starts))
        seconds = perf_counter() - begin
        ends = [one.z.tobytes() for one in found]
        reference, alone = reference or ends, alone or seconds
        rows.append([name, f"{seconds:.1f}", f"{alone / seconds:.2f}", "yes" if ends == reference else "NO"])

    for count in (1, 2):
        with workers(count) as run:
            measure(f"{count} local process{'es' * (count - 1)}", run)
    cluster: Any = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0")
    with cluster, workers(scheduler=cluster.scheduler_address) as run:
        measure("dask, 2 workers", run)
    each = alone / len(starts)
    text = f"{len(starts)} starts, wall seconds with starting the workers and loading their models.\n\n"
    return (
        text
        + table(["where", "s", "speed-up", "same designs to the bit"], rows)
        + (
            f"\n\nWith 100 workers 100 starts take as long as one: {each:.1f} s, after {_draw_seconds(task):.1f} s for "
            "the random windows and before the polish, which one process does."
        )
    )


def _draw_seconds(task: DesignTask) -> float:
    begin = process_time()
    pool.draw(task.mechanism(), task, 120, np.random.default_rng([2, 0]), quiet)
    return process_time() - begin


def disagree(options: argparse.Namespace) -> str:
    robot = read_robot(PAPERS_ROBOT)
    rows: list[list[object]] = []
    with workers(options.processes) as run:
        for by in Criterion:
            found = design(DesignTask(robot, criterion=by), options.starts, 1, run, quiet)
            rows.append([by.value, f"{found.C:.2f}", *(f"{_worth(found, other):.3g}" for other in "AD")])
            rows[-1] += [f"{sd:.1e}" for sd in found.predicted_sd]
    names = ["s_x", "s_y", "s_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz"]
    return (
        f"{options.starts} starts each. A, D: a typical sd in parts of what a parameter may plausibly be off; then the "
        "predicted sd (m, m²).\n\n" + table(["designed by", "C", "A", "D", *names], rows)
    )


def _worth(found: Design, by: str) -> float:
    task = replace(found.task, criterion=Criterion(by))
    each = information.information(task.mechanism(), task, found.motions.placed)
    return float(information.judged(task, each.sum(axis=0)[np.newaxis])[0])


PARTS = {
    "criterion": ("The paper's problem", criterion),
    "peers": ("A start against SciPy", peers),
    "workers": ("Workers", spread),
    "disagree": ("Where C, A and D disagree", disagree),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--gradients", type=int, default=3)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    title, measure = PARTS[options.part]
    text = measure(options)
    print(text)
    size = f"--gradients {options.gradients}" if options.part == "peers" else f"--starts {options.starts}"
    write_section("design", title, f"python -m benchmarks.design {options.part} {size}", text)


if __name__ == "__main__":
    main()
