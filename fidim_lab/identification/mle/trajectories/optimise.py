"""Levenberg–Marquardt on the unknowns of a trajectory fit, at one horizon."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.identification.mle.trajectories.likelihood import (
    Likelihood,
    Point,
    Simulation,
    simulate,
    stepped,
)
from fidim_lab.identification.mle.trajectories.normal import Prior, Tables, step, tables_of
from fidim_lab.model.sensitivity.grid import FINE, QUICK, Resolution

DAMPING = (1e-9, 1e8)
"""smallest and largest"""
STRETCHES = (0.3, 2.0)
"""shortest and longest share of a step"""
MISFIT, MISFIT_HASTE = 1.5, 100.0
"""beyond this χ²/dof a tenth of the (then larger) standard deviation is enough"""

EDGE = 0.1
"""with springs: share of the whole below which a promise that no step keeps is an edge of the model, a cable that gets
slack or dry friction that turns, on which the optimum lies; beyond it something is wrong"""
PATIENCE, REACH = 5, 3.0
"""rounds after which, and times what is promised beyond which, a sum of squares that is wanted is out of reach"""
FORETELLING = 4
"""rounds that must agree on what will be left: one far from its optimum promises too much or too little"""
ASTRAY, LOOKED_BACK = 5.0, 2
"""χ²/dof beyond which a fit is far astray, and rounds over which its pace is taken"""
HOPELESS = 1e-3
"""a promise of more than this share of the whole is always followed up, however large the misfit"""


class Ending(Enum):
    """Why the iteration ended."""

    CONVERGED = "No step promises a better fit."
    EDGE = (
        "It ended on an edge of the model, a cable that gets slack or dry friction that turns: what the derivatives "
        "still promise (under a tenth of the misfit) no step keeps."
    )
    STUCK = "No step, however short, gives a better fit, though the derivatives promise one."
    EXHAUSTED = "The fit was still getting better after the most iterations allowed."
    IMPOSSIBLE = "The motion cannot be simulated from the start: no such body, or a singular pose."

    @property
    def settled(self) -> bool:
        """Whether nothing better is near."""
        return self in (Ending.CONVERGED, Ending.EDGE)


@dataclass(frozen=True)
class Effort:
    """How hard to try."""

    resolution: Resolution
    promise: float
    """converged when the linearised problem promises less than this, in units of χ² for χ²/dof = 1: sd² of a shift"""
    rounds: int
    damping: float
    """at the start"""
    wanted: float = np.inf
    """sum of squares that is of any use: what will hardly come so far is given up (`Ending.EXHAUSTED`)"""
    haste: float = MISFIT_HASTE
    """times the promise that is negligible where the model is wrong (beyond `MISFIT`)"""
    creep: float = 0.0
    """share of the whole that a round must take off a fit that is far astray (`ASTRAY`), else it is given up"""
    crawl: float = 0.0
    """the same of one that is less astray, and still misses more than noise (`MISFIT`)"""
    stroll: float = 0.0
    """the same of one that misses hardly more than noise; what is only on its way may end in a flat valley"""
    idle: float = 0.0
    """what `LOOKED_BACK` rounds must take away together, in units of χ² for χ²/dof = 1, to be worth a further one"""
    hopeless: float = np.inf
    """χ²/dof that is of no use: where `FORETELLING` rounds, one after the other, promise no better, it is given up"""


ROUGH = Effort(resolution=QUICK, promise=1.0, rounds=25, damping=1e-3)
"""the first horizon, from a guess"""
ON_THE_WAY = Effort(resolution=QUICK, promise=1.0, rounds=25, damping=1e-9)
FINAL = Effort(resolution=FINE, promise=1e-4, rounds=30, damping=1e-9)
"""to a hundredth of a standard deviation"""
ON_TRIAL = replace(FINAL, haste=1e4)
"""the same only as far as the model may be right: of one that is wrong nobody asks for so much"""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where an optimisation ended."""

    simulation: Simulation
    tables: Tables
    """at that point; without columns of what is shared where every window went its own way"""
    cost: float
    """whole sum of squares, prior included"""
    ending: Ending
    rounds: int
    costs: tuple[float, ...] = ()
    """of each round, from the start on; none where every window went its own way"""
    foretold: tuple[float, ...] = ()
    """what each of these promised to leave, to first order"""

    @property
    def point(self) -> Point:
        """The unknowns."""
        return self.simulation.point

    @property
    def misfit(self) -> float:
        """χ²/dof, about."""
        return self.cost / self.simulation.count


def optimise(
    likelihood: Likelihood,
    start: Point,
    ends: Float[np.ndarray, " W"],
    prior: Prior,
    effort: Effort,
    free: Bool[np.ndarray, " shared"],
) -> Optimum | None:
    """The best point near `start` for the recordings up to `ends`; only shared parameters that are `free` move.

    None where not even the start can be simulated (`Ending.IMPOSSIBLE`).
    """
    now = _try(likelihood, start, ends, prior, effort)
    tables = None if now is None else _tables(likelihood, now[0])
    if now is None or tables is None:
        return None
    begun = Optimum(now[0], tables, now[1], Ending.EXHAUSTED, 0, (now[1],))
    return carry_on(likelihood, begun, prior, effort, free)


def carry_on(
    likelihood: Likelihood, known: Optimum, prior: Prior, effort: Effort, free: Bool[np.ndarray, " shared"]
) -> Optimum:
    """From where an optimisation of the same recordings ended, for as many further rounds as `effort` has."""
    now, tables, costs = (known.simulation, known.cost), known.tables, list(known.costs)
    foretold = list(known.foretold[:-1])  # that of the last round is said again
    damping, stretch = effort.damping, 1.0
    while True:
        simulation, cost = now
        rounds = len(costs) - 1
        rows, room = prior.rows(simulation.point.shared), prior.room(simulation.point.shared)
        foretold.append(step(tables, likelihood.own, rows, DAMPING[0], free, room).predicted)
        promise, count = cost - foretold[-1], simulation.count
        if promise < min(negligible(effort, cost / count), HOPELESS * cost):
            return Optimum(simulation, tables, cost, Ending.CONVERGED, rounds, tuple(costs), tuple(foretold))
        beyond = rounds >= PATIENCE and cost - REACH * promise > effort.wanted
        done = rounds - known.rounds == effort.rounds
        if done or beyond or creeps(costs, count, effort) or is_hopeless(foretold, count, effort):
            ending = edge(likelihood, count, promise, cost) or Ending.EXHAUSTED
            return Optimum(simulation, tables, cost, ending, rounds, tuple(costs), tuple(foretold))
        while True:
            wanted = step(tables, likelihood.own, rows, damping, free, room)
            shared = stretch * wanted.shared if room is None else np.clip(stretch * wanted.shared, *room)
            point = stepped(likelihood, simulation, stretch * wanted.own, shared)
            there = _try(likelihood, point, simulation.ends, prior, effort)
            following = None if there is None or there[1] >= cost else _tables(likelihood, there[0])
            if there is not None and following is not None:
                break
            damping, stretch = _damped(likelihood, damping), min(stretch, 1.0)
            if damping > DAMPING[1]:
                ending = edge(likelihood, count, promise, cost) or Ending.STUCK
                return Optimum(simulation, tables, cost, ending, rounds, tuple(costs), tuple(foretold))
        promised = cost - wanted.predicted
        gain = (cost - there[1]) / promised if promised > 0 else 1.0  # rounding may leave nothing of a promise
        damping = relaxed(damping, gain / share_of_promise(stretch))
        stretch = stretched(stretch, gain)
        now, tables = there, following
        costs.append(now[1])


def creeps(costs: list[float], count: int, effort: Effort) -> bool:
    """Whether a fit of this many residuals improves too slowly to reach what could still be gained."""
    if len(costs) <= LOOKED_BACK:
        return False
    gained, misfit = costs[-1 - LOOKED_BACK] - costs[-1], costs[-1] / count
    pace = effort.creep if misfit > ASTRAY else effort.crawl if misfit > MISFIT else effort.stroll
    return gained < LOOKED_BACK * pace * costs[-1] or gained < effort.idle * max(1.0, misfit)


def is_hopeless(foretold: Sequence[float], count: int, effort: Effort) -> bool:
    """Whether the last rounds of a fit of this many residuals agree that its remainder will stay too large."""
    return len(foretold) >= FORETELLING and min(foretold[-FORETELLING:]) > effort.hopeless * count


def _damped(likelihood: Likelihood, damping: float) -> float:
    """More damping after a step that did not keep its promise.

    Fast oscillations of springs bend the sum of squares along directions of which the data say little: there a
    millionth changes nothing, and each try is dear.
    """
    return max(4 * damping, 1e-6) if likelihood.springs is None else max(10 * damping, 1e-4)


def edge(likelihood: Likelihood, count: int, promise: float, cost: float) -> Ending | None:
    """What a promise that no step keeps means with springs: less than a standard deviation is nothing, more an edge.

    count: of residuals.
    """
    if likelihood.springs is None or promise >= EDGE * cost:
        return None
    return Ending.CONVERGED if promise < max(1.0, cost / count) else Ending.EDGE


def negligible(effort: Effort, misfit: float) -> float:
    """The promise of a step that is not worth taking; larger where the model is wrong and the sd mean little."""
    return effort.promise * max(1.0, misfit) * hasty(effort, misfit)


def hasty(effort: Effort, misfit: float) -> float:
    """Times the promise that is negligible at this χ²/dof."""
    return effort.haste if misfit > MISFIT else 1.0


def relaxed(damping: float, gain: float) -> float:
    """Less damping where the linearised problem predicted the gain, more where it did not."""
    if gain > 0.5:
        return max(damping / 5, DAMPING[0])
    return damping if gain > 0.1 else max(4 * damping, 1e-6)


def share_of_promise(stretch: float) -> float:
    """Share of the promise that a step of this length should keep."""
    part = min(stretch, 1.0)
    return 2 * part - part**2


def stretched(stretch: float, gain: float) -> float:
    """How far to go along the next step, as a share of it.

    Where large residuals bend the sum of squares more than its linearised form has it, Gauss–Newton steps overshoot to
    and fro and converge slowly. A step of length α gains 2 α − κ α² of what the linearised problem promises, κ being
    the true curvature over the linearised one; 1/κ is the best length for the next.
    """
    curvature = (2 * stretch - gain) / stretch**2
    return float(np.clip(1 / max(curvature, 1e-3), *STRETCHES))


def _tables(likelihood: Likelihood, simulation: Simulation) -> Tables | None:
    """The linearised problem; None where no derivatives are finite: motion that runs away hardly begun is no answer."""
    with np.errstate(invalid="ignore", over="ignore"):
        tables = tables_of(likelihood, simulation)
    return tables if np.isfinite(tables).all() else None


def _try(
    likelihood: Likelihood, point: Point, ends: np.ndarray, prior: Prior, effort: Effort
) -> tuple[Simulation, float] | None:
    """The simulation at a point and its whole sum of squares; None where there is none."""
    if not np.isfinite(point.states.positions).all() or not np.isfinite(point.states.rotations).all():
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        simulation = simulate(likelihood, point, ends, effort.resolution)
    if simulation is None:
        return None
    cost = simulation.cost + prior.cost(point.shared)
    return (simulation, cost) if np.isfinite(cost) else None
