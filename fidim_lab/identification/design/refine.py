"""Descent from a set of windows to a local optimum of Eq. 41 under Eq. 42.

Sequential quadratic programming with exact gradients in a trust region; IPOPT solves each subproblem. The plain problem
given to IPOPT takes steps after which cables hang slack; the trust region keeps a design where its motions exist. A
subproblem holds limits with a slack that costs, so that a start a little outside is led back in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design import cost
from fidim_lab.identification.design.information import Cost
from fidim_lab.identification.design.limits import LimitExcess, linearised
from fidim_lab.identification.design.motions import Sensitive, simulate
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import ReleasedWindow, place
from fidim_lab.model.making import MAKING
from fidim_lab.model.mechanism import Mechanism

SIZES = {"position": 0.1, "rotation": 0.3, "tension": 2.0, "displacement": 0.02}
"""m, rad, N/kg, m: changes of a window that matter alike; the trust region is counted in them"""
FIRST_RADIUS, LEAST_RADIUS = 0.3, 0.01
PENALTY = 20.0
"""of a window's worst limit exceeded by its whole span, in units of the criterion"""
MARGIN = 0.004
"""of the span: how far inside its limits a step stays, for peaks between nodes"""
NEAR = 32
"""limits of each window that a step minds: the nearest to being exceeded"""
ENOUGH = 2e-3
"""relative gain over three steps below which the descent ends"""
QUIET = {"print_time": False, "error_on_fail": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-5}

Objective = Callable[[Mechanism, Sensitive], Cost]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A set of windows with its value, its limits, and derivatives."""

    placed: tuple[ReleasedWindow, ...]
    cost: Cost
    limits: LimitExcess

    @property
    def merit(self) -> float:
        """The merit function that a step must lower."""
        return self.cost.value + PENALTY * float(np.maximum(self.limits.worst + MARGIN, 0).sum())


@dataclass(frozen=True, eq=False)
class Refined:
    """The result of a descent."""

    z: Float[np.ndarray, "W z"]
    value: float
    evaluations: int


def evaluate(
    mechanism: Mechanism,
    task: DesignTask,
    z: Float[np.ndarray, "W z"],
    near: tuple[ReleasedWindow, ...] | None,
    objective: Objective = cost.excitation,
) -> Evaluation:
    """Everything about a set of windows. Raises InfeasibleError where one cannot rest, be displaced or be simulated."""
    neighbours = (None,) * len(z) if near is None else tuple(one.resting for one in near)
    placed = tuple(place(mechanism, task, one, other) for one, other in zip(z, neighbours, strict=True))
    motions = simulate(mechanism, task, placed)
    if not np.isfinite(motions.regressors).all() or not np.isfinite(motions.tensions).all():
        raise InfeasibleError("The free motion of a window breaks down.")
    sensitive = Sensitive.of(mechanism, motions)
    worth, limits = objective(mechanism, sensitive), linearised(mechanism, sensitive)
    if not (np.isfinite(worth.gradient).all() and np.isfinite(limits.by).all()):
        raise InfeasibleError("The derivatives of a window's motion break down.")
    return Evaluation(placed, worth, limits)


def refine(
    mechanism: Mechanism,
    task: DesignTask,
    begin: Float[np.ndarray, "W z"],
    objective: Objective = cost.excitation,
    most: int = 10,
) -> Refined:
    """The local optimum near `begin`, or the best set within the limits that was met in `most` evaluations.

    Its value is infinite where no set within the limits was met. Raises InfeasibleError where `begin` cannot be
    simulated.
    """
    here, found = begin, evaluate(mechanism, task, begin, None, objective)
    with MAKING:
        subproblem = _subproblem(*begin.shape, sizes=len(_sizes(task)))
    curvature, radius, merits = np.eye(begin.size), FIRST_RADIUS, [found.merit]
    best, count = _better(Refined(begin, np.inf, 1), begin, found), 1
    while count < most and radius > LEAST_RADIUS:
        step, promised = _step(subproblem, task, found, curvature, radius)
        count += 1
        try:
            tried = evaluate(mechanism, task, here + step, found.placed, objective)
        except InfeasibleError:
            radius *= 0.4
            continue
        gained = found.merit - tried.merit
        if gained <= 0.05 * promised:
            radius *= 0.4
            continue
        curvature = _updated(curvature, step.ravel(), (tried.cost.gradient - found.cost.gradient).ravel())
        radius = 1.6 * radius if gained > 0.6 * promised else radius
        here, found = here + step, tried
        best = _better(best, here, found)
        merits.append(found.merit)
        if len(merits) > 3 and merits[-4] - merits[-1] < ENOUGH * abs(merits[-1]):
            break
    return Refined(best.z, best.value, count)


def _better(best: Refined, z: np.ndarray, found: Evaluation) -> Refined:
    if found.limits.worst.max() > 0 or found.cost.value >= best.value:
        return best
    return Refined(z, found.cost.value, best.evaluations)


def _sizes(task: DesignTask) -> np.ndarray:
    """Of each row of the trust region's metric for one window."""
    parts = [(3, "position"), (3, "rotation"), (task.robot.n, "tension"), (len(task.axes), "displacement")]
    return np.concatenate([np.full(count, SIZES[name]) for count, name in parts])


def _subproblem(windows: int, width: int, sizes: int) -> Any:
    """min gᵀs + ½ sᵀBs + penalty Σ slack, subject to c + J s ≤ slack of the window, |A s| ≤ radius in each row."""
    s, slack = ca.MX.sym("s", width, windows), ca.MX.sym("slack", windows)
    g, B = ca.MX.sym("g", width * windows), ca.MX.sym("B", width * windows, width * windows)
    c, J = ca.MX.sym("c", NEAR, windows), ca.MX.sym("J", NEAR, width * windows)
    A = ca.MX.sym("A", sizes, width * windows)
    rows, changes = [], []
    for k in range(windows):
        own = slice(k * width, (k + 1) * width)
        rows.append(c[:, k] + J[:, own] @ s[:, k] - slack[k])
        changes.append(A[:, own] @ s[:, k])
    flat = ca.vec(s)
    problem = {
        "x": ca.vertcat(flat, slack),
        "p": ca.vertcat(g, ca.vec(B), ca.vec(c), ca.vec(J), ca.vec(A)),
        "f": ca.dot(g, flat) + 0.5 * ca.bilin(B, flat, flat) + PENALTY * ca.sum1(slack),
        "g": ca.vertcat(*rows, *changes),
    }
    return ca.nlpsol("step", "ipopt", problem, QUIET)


def _step(
    subproblem: Any, task: DesignTask, found: Evaluation, curvature: np.ndarray, radius: float
) -> tuple[Float[np.ndarray, "W z"], float]:
    """The best step within the trust region, and what it promises to gain of the merit."""
    g = found.cost.gradient
    windows, width = g.shape
    near = np.argsort(-found.limits.values, axis=1)[:, :NEAR]
    c = np.take_along_axis(found.limits.values, near, axis=1) + MARGIN
    J = np.take_along_axis(found.limits.by, near[..., np.newaxis], axis=1)
    aside = np.hstack([np.zeros((len(task.axes), task.robot.n)), np.eye(len(task.axes))])
    A = np.array([np.vstack([one.rest_by, aside]) for one in found.placed]) / _sizes(task)[:, np.newaxis]
    parameters = [g.ravel(), curvature.ravel(), c.ravel(), *(x.transpose(0, 2, 1).ravel() for x in (J, A))]
    beyond, changed = np.full(c.size, -np.inf), np.full(A.shape[0] * A.shape[1], radius)
    answer = subproblem(
        x0=np.concatenate([np.zeros(g.size), np.maximum(c.max(axis=1), 0) + 1e-3]),
        p=np.concatenate(parameters),
        lbx=np.concatenate([np.full(g.size, -np.inf), np.zeros(windows)]),
        lbg=np.concatenate([beyond, -changed]),
        ubg=np.concatenate([np.zeros(c.size), changed]),
    )
    step = np.asarray(answer["x"]).ravel()[: g.size].reshape(windows, width)
    flat = step.ravel()
    after = (c + np.einsum("wkz,wz->wk", J, step)).max(axis=1)
    limits = float(np.maximum(found.limits.worst + MARGIN, 0).sum() - np.maximum(after, 0).sum())
    return step, PENALTY * limits - float(g.ravel() @ flat + 0.5 * flat @ curvature @ flat)


def _updated(curvature: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """BFGS with Powell's damping: stays positive definite."""
    pushed = curvature @ step
    along, real = float(step @ pushed), float(step @ change)
    share = 1.0 if real >= 0.2 * along else 0.8 * along / (along - real)
    damped = share * change + (1 - share) * pushed
    return curvature + np.outer(damped, damped) / float(step @ damped) - np.outer(pushed, pushed) / along
