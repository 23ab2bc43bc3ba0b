"""Design of excitation on the paper's problem: C, time of a start against SciPy with finite differences, workers.

    python -m benchmarks.design criterion --starts 100      C, share of starts below 10, seconds of a start
    python -m benchmarks.design peers --gradients 3         one start against SLSQP and trust-constr
    python -m benchmarks.design workers --starts 20         1 and 2 processes, a dask cluster of two, same results?
    python -m benchmarks.design disagree                    what designs by C, A and D are worth by each criterion

Times are CPU seconds, except of the workers, which are wall seconds.
"""

import argparse
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import perf_counter, process_time
from typing import Any

import numpy as np
from scipy import optimize

from benchmarks.page import table, write_section
from fidim_lab.app.spread_out import workers
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import cost, information, pool
from fidim_lab.identification.design.limits import KINDS, worst_of_kinds
from fidim_lab.identification.design.motions import simulate
from fidim_lab.identification.design.refine import refine
from fidim_lab.identification.design.search import STEPS, Design, Found, Start, begin_at, design
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import Placed, place
from fidim_lab.model.mechanism import Mechanism

PAPER, GOAL = 5.94, 10.0


def quiet(_: object) -> None:
    """Says nothing."""


def criterion(options: argparse.Namespace) -> str:
    task = DesignTask(read_robot(PAPERS_ROBOT))
    with workers(options.processes) as run:
        found = design(task, options.starts, 1, run, quiet)
    values = np.array([one.value for one in found.starts])
    spare = worst_of_kinds(found.motions).max(axis=0)
    lines = [
        ("C of the best design", f"{found.C:.3f} (the paper: {PAPER})"),
        ("starts with C < 10", f"{100 * float((values < GOAL).mean()):.0f} % of {len(values)}"),
        ("C of the starts: least, median, largest", ", ".join(f"{v:.2f}" for v in np.quantile(values, (0, 0.5, 1)))),
        ("time of a start, median", f"{np.median([one.seconds for one in found.starts]):.2f} s wall"),
        ("everything, with the random windows and the polish", f"{found.seconds:.1f} s wall"),
        *((f"{kind}: to spare", f"{-100 * v:.2f} %") for kind, v in zip(KINDS, spare, strict=True)),
    ]
    return f"n_e = {task.equilibria}, {task.samples} samples, conditioning ≤ {task.conditioning:g}.\n\n" + table(
        ["", ""], lines
    )


class EnoughError(Exception):
    """The baseline has had its evaluations."""


@dataclass
class Plain:
    """Eq. 41–42 as SciPy is given it: a value and limits of 72 unknowns, by the same fast simulation as ours."""

    mechanism: Mechanism
    task: DesignTask
    begin: np.ndarray
    most: int
    near: tuple[Placed, ...]
    evaluations: int = 0
    best: float = np.inf
    known: dict[bytes, tuple[float, np.ndarray]] = field(default_factory=dict[bytes, tuple[float, np.ndarray]])

    def at(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        key = x.tobytes()
        if key in self.known:
            return self.known[key]
        if self.evaluations >= self.most:
            raise EnoughError
        self.evaluations += 1
        try:
            z = x.reshape(self.begin.shape)
            placed = [
                place(self.mechanism, self.task, one, near.resting) for one, near in zip(z, self.near, strict=True)
            ]
            motions = simulate(self.mechanism, self.task, placed)
            value = cost.criterion(motions.regressors[:, motions.sampled].reshape(-1, 10))
            beyond = worst_of_kinds(motions).ravel()
        except (InfeasibleError, np.linalg.LinAlgError):
            value, beyond = 1e3, np.full(4 * len(self.begin), 1.0)
        if beyond.max() <= 1e-6:
            self.best = min(self.best, value)
        self.known = {key: (value, beyond)} if len(self.known) > 500 else self.known | {key: (value, beyond)}
        return value, beyond

    def value(self, x: np.ndarray) -> float:
        return self.at(x)[0]

    def spare(self, x: np.ndarray) -> np.ndarray:
        return -self.at(x)[1]


def peers(options: argparse.Namespace) -> str:
    task = DesignTask(read_robot(PAPERS_ROBOT))
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, 60, np.random.default_rng([1, 0]), quiet)
    z = pool.exchange(drawn, task.equilibria, pool.paper_criterion, np.random.default_rng(1))
    refine(mechanism, task, z, most=2)  # loads compiled loops for both
    begin = process_time()
    ours = refine(mechanism, task, z, most=STEPS)
    mine = process_time() - begin
    near = tuple(place(mechanism, task, one) for one in z)
    first = Plain(mechanism, task, z, 10, near).value(z.ravel())
    rows: list[list[object]] = [
        ["ours", ours.evaluations, f"{mine:.2f}", f"{mine / ours.evaluations:.3f}", f"{ours.value:.2f}", "1", "1"]
    ]
    for name, run in _baselines().items():
        problem = Plain(mechanism, task, z, options.gradients * (z.size + 1), near)
        begin = process_time()
        with suppress(EnoughError):
            run(problem)
        spent = process_time() - begin
        gradients = problem.evaluations / (z.size + 1)
        each = spent / gradients
        ratios = [f"{each / (mine / ours.evaluations):.0f}", f"{spent / mine:.0f}"]
        rows.append([name, f"{gradients:.1f}", f"{spent:.1f}", f"{each:.2f}", f"{problem.best:.2f}", *ratios])
    return (
        f"One start from the same exchanged windows (C = {first:.2f}), {z.size} unknowns; ours with its whole descent, "
        f"SciPy stopped after {options.gradients} gradients by finite differences ({z.size + 1} evaluations each, by "
        "the same compiled simulation and Newton's method as ours, objective and limits sharing one evaluation: with "
        "simulations of its own it would be slower). The paper's starts took 36 s.\n\n"
        + table(
            ["method", "gradients", "CPU s", "CPU s a gradient", "C reached", "gradient / ours", "so far / our start"],
            rows,
        )
    )


def _baselines() -> dict[str, Callable[[Plain], object]]:
    def slsqp(problem: Plain) -> object:
        limits: Any = {"type": "ineq", "fun": problem.spare}
        return optimize.minimize(problem.value, problem.begin.ravel(), method="SLSQP", constraints=limits)

    def trust(problem: Plain) -> object:
        limits = optimize.NonlinearConstraint(problem.spare, 0, np.inf)
        return optimize.minimize(problem.value, problem.begin.ravel(), method="trust-constr", constraints=limits)

    return {"SLSQP": slsqp, "trust-constr": trust}


def spread(options: argparse.Namespace) -> str:
    from distributed import LocalCluster

    task = DesignTask(read_robot(PAPERS_ROBOT))
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, 120, np.random.default_rng([1, 0]), quiet)
    starts = [Start(task, drawn, (1, 1 + k)) for k in range(options.starts)]
    begin_at(starts[0])  # compiled kernels are in the cache from here on
    rows: list[list[object]] = []
    reference: list[bytes] = []
    alone = 0.0

    def measure(name: str, run: Callable[..., Any]) -> None:
        nonlocal reference, alone
        begin = perf_counter()
        found: list[Found] = list(run(begin_at, starts))
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
