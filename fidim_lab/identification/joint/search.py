"""Levenberg–Marquardt on the windows of several campaigns with one set of shared parameters.

As `trajectories.optimise` does for one: each campaign has windows with unknowns of their own, more of them the fewer
its cables, and a model of its own that takes its part of the joint parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.joint.members import JointMember, Layout
from fidim_lab.identification.mle.judge import Remainder, remainder
from fidim_lab.identification.mle.trajectories.likelihood import Point, Simulation, simulate, stepped
from fidim_lab.identification.mle.trajectories.normal import Part, Prior, Tables, step_of_parts, tables_of
from fidim_lab.identification.mle.trajectories.optimise import (
    DAMPING,
    HOPELESS,
    Effort,
    Ending,
    hasty,
    relaxed,
    share_of_promise,
    stretched,
)
from fidim_lab.model.sensitivity.integrate import States


@dataclass(frozen=True, eq=False)
class JointOptimum:
    """The result of a joint search."""

    shared: Float[np.ndarray, " shared"]
    simulations: tuple[Simulation, ...]
    """of each campaign"""
    tables: tuple[Tables, ...]
    """each window's weighed by what it is worth"""
    cost: float
    """whole sum of squares, weighed and with the prior"""
    data_cost: float
    """the same without the prior on what is shared"""
    promise: float
    """what the linearised problem still promises to take off"""
    ending: Ending
    rounds: int

    @property
    def states(self) -> tuple[States, ...]:
        """Of the windows of each campaign."""
        return tuple(simulation.point.states for simulation in self.simulations)

    def negligible(self, effort: Effort) -> float:
        """The promise of a step that is not worth taking, as squares are weighed; larger where the model is wrong.

        Whether it is wrong is told by what windows leave before they are weighed: weighed they leave noise.
        """
        count = sum(simulation.count for simulation in self.simulations)
        left = sum(simulation.cost for simulation in self.simulations)
        return effort.promise * max(1.0, self.cost / count) * hasty(effort, left / count)

    def parts(self, members: Sequence[JointMember], layout: Layout) -> tuple[Part, ...]:
        """The linearised problem, campaign by campaign."""
        return parts_of(members, layout, self.tables)

    def remainders(self, members: Sequence[JointMember]) -> tuple[tuple[Remainder, ...], ...]:
        """The residual of every window."""
        return tuple(
            tuple(remainder(member.likelihood, simulation, w) for w in range(len(member.ends)))
            for member, simulation in zip(members, self.simulations, strict=True)
        )


def parts_of(members: Sequence[JointMember], layout: Layout, tables: Sequence[Tables]) -> tuple[Part, ...]:
    """The linearised problem, campaign by campaign."""
    each = zip(members, tables, layout.places, strict=True)
    return tuple(Part(of_one, member.likelihood.own, place) for member, of_one, place in each)


def search(
    members: Sequence[JointMember],
    layout: Layout,
    start: tuple[Float[np.ndarray, " shared"], Sequence[States]],
    horizon: float,
    prior: Prior,
    effort: Effort,
) -> JointOptimum | None:
    """The best point near `start` for the first `horizon` seconds of every recording.

    None where not even the start can be simulated.
    """
    free = np.ones(layout.size, dtype=bool)
    now = _at(members, _points(layout, *start), horizon, prior, start[0], effort)
    damping, stretch = effort.damping, 1.0
    while now is not None:
        parts, rows, room = now.parts(members, layout), prior.rows(now.shared), prior.room(now.shared)
        promise = now.cost - step_of_parts(parts, rows, DAMPING[0], free, room)[2]
        least = now.negligible(effort)
        now = replace(now, promise=promise)
        if promise < min(least, HOPELESS * now.cost):
            return replace(now, ending=Ending.CONVERGED)
        if now.rounds == effort.rounds:
            return now
        while True:
            own, wanted, foretold = step_of_parts(parts, rows, damping, free, room)
            move = stretch * wanted if room is None else np.clip(stretch * wanted, *room)
            points = _stepped(members, layout, now.simulations, [stretch * one for one in own], move)
            there = _at(members, points, horizon, prior, now.shared + move, effort, now)
            if there is not None:
                break
            damping, stretch = max(10 * damping, 1e-5), min(stretch, 1.0)
            if damping > DAMPING[1] or now.cost - foretold < least:
                return replace(now, ending=Ending.STUCK)
        gain = (now.cost - there.cost) / (now.cost - foretold) if now.cost > foretold else 1.0
        damping = relaxed(damping, gain / share_of_promise(stretch))
        stretch, now = stretched(stretch, gain), there
    return None


def linear_tables(member: JointMember, simulation: Simulation) -> Tables:
    """The linearised problem of one campaign, each window weighed by what it is worth."""
    tables = tables_of(member.likelihood, simulation)
    return tables * np.sqrt(member.worth)[:, np.newaxis, np.newaxis]


def _weighed(member: JointMember, simulation: Simulation) -> float:
    """Sum of squares; infinite where a motion could not be simulated."""
    costs = np.array([residual.rows @ residual.rows for residual in simulation.residuals])
    total = float(member.worth @ costs)
    return total if np.isfinite(total) else np.inf


def _points(layout: Layout, shared: np.ndarray, states: Sequence[States]) -> list[Point]:
    return [Point(shared[place], of_one) for place, of_one in zip(layout.places, states, strict=True)]


def _stepped(
    members: Sequence[JointMember],
    layout: Layout,
    simulations: Sequence[Simulation],
    own: Sequence[np.ndarray],
    move: np.ndarray,
) -> list[Point]:
    each = zip(members, simulations, own, layout.places, strict=True)
    return [stepped(member.likelihood, before, of_one, move[place]) for member, before, of_one, place in each]


def _at(
    members: Sequence[JointMember],
    points: Sequence[Point],
    horizon: float,
    prior: Prior,
    shared: np.ndarray,
    effort: Effort,
    before: JointOptimum | None = None,
) -> JointOptimum | None:
    """All campaigns at a point, linearised; None where they cannot be simulated, or no better than before."""
    simulations: list[Simulation] = []
    with np.errstate(invalid="ignore", over="ignore"):
        for member, point in zip(members, points, strict=True):
            if not np.isfinite(point.states.positions).all() or not np.isfinite(point.states.rotations).all():
                return None
            simulation = simulate(member.likelihood, point, member.up_to(horizon), effort.resolution)
            if simulation is None:
                return None
            simulations.append(simulation)
        data = sum(_weighed(member, simulation) for member, simulation in zip(members, simulations, strict=True))
        cost = data + prior.cost(shared)
        if not np.isfinite(cost) or (before is not None and cost >= before.cost):
            return None
        each = zip(members, simulations, strict=True)
        tables = [linear_tables(member, of_one) for member, of_one in each]
    if not all(np.isfinite(of_one).all() for of_one in tables):
        return None
    rounds = 0 if before is None else before.rounds + 1
    return JointOptimum(shared, tuple(simulations), tuple(tables), cost, data, np.inf, Ending.EXHAUSTED, rounds)
