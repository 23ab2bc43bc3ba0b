"""One start of a design against SciPy's SLSQP and trust-constr with finite differences, on the same problem.

python -m benchmarks.design peers --gradients 20
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from time import process_time
from typing import Any

import numpy as np
from scipy import optimize

from benchmarks.page import table
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import cost, pool
from fidim_lab.identification.design.limits import worst_of_kinds
from fidim_lab.identification.design.motions import simulate
from fidim_lab.identification.design.refine import refine
from fidim_lab.identification.design.search import STEPS
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import ReleasedWindow, place
from fidim_lab.model.mechanism import Mechanism


def quiet(_: object) -> None:
    """Says nothing."""


class EnoughError(Exception):
    """The baseline has had its evaluations."""


@dataclass
class Plain:
    """Eq. 41–42 as SciPy is given it: a value and limits of 72 unknowns, by the same fast simulation as ours."""

    mechanism: Mechanism
    task: DesignTask
    begin: np.ndarray
    most: int
    near: tuple[ReleasedWindow, ...]
    goal: float = 0.0
    """the value at which it has done enough"""
    evaluations: int = 0
    best: float = np.inf
    known: dict[bytes, tuple[float, np.ndarray]] = field(default_factory=dict[bytes, tuple[float, np.ndarray]])

    def at(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        key = x.tobytes()
        if key in self.known:
            return self.known[key]
        if self.evaluations >= self.most:
            raise EnoughError(f"{self.most} evaluations")
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
        if self.arrived:
            raise EnoughError("as good as ours")
        self.known = {key: (value, beyond)} if len(self.known) > 500 else self.known | {key: (value, beyond)}
        return value, beyond

    @property
    def arrived(self) -> bool:
        """Whether it is as good as it need be."""
        return self.best <= self.goal

    def value(self, x: np.ndarray) -> float:
        return self.at(x)[0]

    def spare(self, x: np.ndarray) -> np.ndarray:
        return -self.at(x)[1]


def peers(options: argparse.Namespace) -> str:
    task = DesignTask(read_robot(PAPERS_ROBOT))
    mechanism = task.mechanism()
    drawn = pool.draw(mechanism, task, 60, np.random.default_rng([1, 0]), quiet)
    z = drawn.z[pool.exchange(drawn, task.equilibria, pool.paper_criterion, np.random.default_rng(1))]
    refine(mechanism, task, z, most=2)  # loads compiled loops for both
    begin = process_time()
    ours = refine(mechanism, task, z, most=STEPS)
    mine = process_time() - begin
    near = tuple(place(mechanism, task, one) for one in z)
    first = Plain(mechanism, task, z, 10, near).value(z.ravel())
    each = mine / ours.evaluations
    rows: list[list[object]] = [
        ["ours", ours.evaluations, f"{mine:.2f}", f"{each:.3f}", f"{ours.value:.2f}", "its own end", "1", "1"]
    ]
    for name, run in _baselines().items():
        problem = Plain(mechanism, task, z, options.gradients * (z.size + 1), near, ours.value)
        begin, end = process_time(), "its own end"
        try:
            run(problem)
        except EnoughError as reason:
            end = str(reason)
        spent = process_time() - begin
        gradients = problem.evaluations / (z.size + 1)
        ratios = [f"{spent / gradients / each:.0f}", ("" if problem.arrived else "> ") + f"{spent / mine:.0f}"]
        rows.append(
            [name, f"{gradients:.1f}", f"{spent:.1f}", f"{spent / gradients:.2f}", f"{problem.best:.2f}", end, *ratios]
        )
    head = ["method", "gradients", "CPU s", "CPU s a gradient", "C reached", "ended by"]
    return (
        f"One start from the same exchanged windows (C = {first:.2f}), {z.size} unknowns, with its whole descent; "
        "SciPy on the same problem by finite differences, until it is as good as ours, ends by itself, or has had "
        f"{options.gradients} gradients ({z.size + 1} evaluations each, by the same compiled simulation and Newton's "
        "method as ours, objective and limits sharing one evaluation: with simulations of its own it would be "
        "slower). The paper's starts took 36 s.\n\n" + table([*head, "gradient / ours", "start / ours"], rows)
    )


def _baselines() -> dict[str, Callable[[Plain], object]]:
    def slsqp(problem: Plain) -> object:
        limits: Any = {"type": "ineq", "fun": problem.spare}
        return optimize.minimize(problem.value, problem.begin.ravel(), method="SLSQP", constraints=limits)

    def trust(problem: Plain) -> object:
        limits = optimize.NonlinearConstraint(problem.spare, 0, np.inf)
        return optimize.minimize(problem.value, problem.begin.ravel(), method="trust-constr", constraints=limits)

    return {"SLSQP": slsqp, "trust-constr": trust}
