"""Levenberg–Marquardt where nothing is shared: every window by itself, all side by side.

As `optimise` for each window alone (its own damping, its own end), but simulated together: far sooner than one after
the other, and a window that cannot be followed does not hold the others up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from fidim_lab.identification.mle.trajectories.likelihood import (
    Likelihood,
    Point,
    Simulation,
    SpringPrior,
    simulate,
)
from fidim_lab.identification.mle.trajectories.normal import Tables, own_steps, tables_of
from fidim_lab.identification.mle.trajectories.optimise import (
    DAMPING,
    HOPELESS,
    Effort,
    Ending,
    Optimum,
    creeps,
    edge,
    negligible,
    relaxed,
    share_of_promise,
    stretched,
)
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.starts import linearised_starts, moved

SEVEREST = (Ending.EXHAUSTED, Ending.STUCK, Ending.EDGE, Ending.CONVERGED)
"""what is said of several windows: the first of these with which one ended"""


@dataclass(eq=False)
class _Search:
    """How far each window is; not frozen, for that is what changes."""

    states: States
    costs: Float[np.ndarray, " W"]
    tables: Tables
    damping: Float[np.ndarray, " W"]
    stretch: Float[np.ndarray, " W"]
    endings: list[Ending | None]
    counts: Int[np.ndarray, " W"]
    """of residuals"""
    promises: Float[np.ndarray, " W"]
    """what the linearised problem promises to take away"""
    courses: list[list[float]]
    """costs of each, round by round"""

    def accept(self, w: int, cost: float, predicted: float, states: States, place: int) -> None:
        """A better state of a window, found at a place among others."""
        promised, stretch = float(self.costs[w]) - predicted, float(self.stretch[w])
        gain = (float(self.costs[w]) - cost) / promised if promised > 0 else 1.0  # rounding may leave no promise
        self.damping[w] = relaxed(float(self.damping[w]), gain / share_of_promise(stretch))
        self.stretch[w] = stretched(stretch, gain)
        self.costs[w], self.states = cost, self.states.with_one(w, states, place)

    def damped(self, w: int) -> float:
        """The damping of a window after a step that made it worse."""
        self.damping[w], self.stretch[w] = max(4 * self.damping[w], 1e-6), min(self.stretch[w], 1.0)
        return float(self.damping[w])


def optimise_apart(
    likelihood: Likelihood, start: Point, ends: Float[np.ndarray, " W"], effort: Effort
) -> Optimum | None:
    """The best initial state of every recording up to its end, near `start`, whose shared parameters are held.

    None where one of them cannot even be simulated from there.
    """
    first = _simulated(likelihood, start, ends, effort)
    if first is None or not np.isfinite(_costs(first)).all():
        return None
    count = len(ends)
    tables = tables_of(likelihood, first, held=True)
    search = _Search(
        states=start.states,
        costs=_costs(first),
        tables=tables,
        damping=np.full(count, effort.damping),
        stretch=np.ones(count),
        endings=[None] * count,
        counts=np.zeros(count, dtype=int),
        promises=np.zeros(count),
        courses=[[] for _ in range(count)],
    )
    rounds, ours, simulation = 0, _Part(likelihood, np.arange(count), ends), first
    while True:
        _settle(search, ours, simulation, last=rounds == effort.rounds, effort=effort)
        ours = ours.of([w for w in ours.members if search.endings[w] is None])
        better = _improved(search, ours, start.shared, effort)
        ours = ours.of([w for w in ours.members if search.endings[w] is None])
        if not len(ours.members):
            break
        rounds += 1
        simulation = better or ours.simulated(search.states.of(ours.members), start.shared, effort)
        if simulation is None:  # not to be expected: all of these have been simulated in `_improved`
            return None
        search.tables[ours.members] = tables_of(ours.likelihood, simulation, held=True)
    whole = _simulated(likelihood, Point(start.shared, search.states), ends, effort)
    ending = next(one for one in SEVEREST if one in search.endings)
    return None if whole is None else Optimum(whole, search.tables, float(search.costs.sum()), ending, rounds)


@dataclass(frozen=True, eq=False)
class _Part:
    """Some of the recordings."""

    likelihood: Likelihood
    """of these alone"""
    members: Int[np.ndarray, " P"]
    """which they are among all"""
    ends: Float[np.ndarray, " P"]

    def of(self, members: Sequence[int]) -> "_Part":
        """Fewer of them."""
        if len(members) == len(self.members):
            return self
        chosen = np.flatnonzero(np.isin(self.members, members))
        known, likelihood = self.likelihood.springs, self.likelihood
        if known is not None:
            parts = (known.tensions, known.tension_sd, known.rate_sd)
            known = SpringPrior(*(part[chosen] for part in parts))
        recordings = tuple(likelihood.recordings[k] for k in chosen)
        likelihood = replace(likelihood, recordings=recordings, guesses=likelihood.guesses.of(chosen), springs=known)
        return _Part(likelihood, self.members[chosen], self.ends[chosen])

    def simulated(self, states: States, shared: np.ndarray, effort: Effort) -> Simulation | None:
        """From these states."""
        return _simulated(self.likelihood, Point(shared, states), self.ends, effort)


def _settle(search: _Search, ours: _Part, simulation: Simulation, *, last: bool, effort: Effort) -> None:
    """Say how those windows ended that promise nothing better; in the last round, all."""
    smallest = np.full(len(ours.members), DAMPING[0])
    promised = search.costs[ours.members] - own_steps(search.tables[ours.members], ours.likelihood.own, smallest)[1]
    for k, w in enumerate(ours.members):
        cost, residual = float(search.costs[w]), simulation.residuals[k]
        count = residual.count
        search.counts[w], search.promises[w] = count, promised[k]
        search.courses[w].append(cost)
        if promised[k] < min(negligible(effort, cost / count), HOPELESS * cost):
            search.endings[w] = Ending.CONVERGED
        elif last or creeps(search.courses[w], count, effort):
            search.endings[w] = edge(ours.likelihood, count, float(promised[k]), cost) or Ending.EXHAUSTED


def _improved(search: _Search, ours: _Part, shared: np.ndarray, effort: Effort) -> Simulation | None:
    """A better state for each of these windows, damped until it is one, or an ending where none is found.

    Returns the simulation of the better states where one trial gave a better one for each.
    """
    members, mechanism, begins = ours.members, ours.likelihood.mechanism, ours.likelihood.begins
    if not len(members):
        return None
    here = search.states.of(members)
    starts = linearised_starts(mechanism, shared, here, begins)
    waiting, trials = np.ones(len(members), dtype=bool), 0
    there: Simulation | None = None
    while waiting.any():
        steps, predicted = own_steps(search.tables[members], ours.likelihood.own, search.damping[members])
        steps = np.where(waiting[:, np.newaxis], search.stretch[members, np.newaxis] * steps, 0.0)
        states = moved(mechanism, shared, here, starts, steps, begins)
        there, trials = ours.simulated(states, shared, effort), trials + 1
        costs = np.full(len(members), np.inf) if there is None else _costs(there)
        for k in np.flatnonzero(waiting):
            w = int(members[k])
            if costs[k] < search.costs[w]:
                search.accept(w, float(costs[k]), float(predicted[k]), states, int(k))
                waiting[k] = False
            elif search.damped(w) > DAMPING[1]:
                waiting[k] = False
                cost, promise = float(search.costs[w]), float(search.promises[w])
                search.endings[w] = edge(ours.likelihood, int(search.counts[w]), promise, cost) or Ending.STUCK
    return there if trials == 1 and all(search.endings[w] is None for w in members) else None


def _simulated(likelihood: Likelihood, point: Point, ends: np.ndarray, effort: Effort) -> Simulation | None:
    if not np.isfinite(point.states.positions).all() or not np.isfinite(point.states.rotations).all():
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        return simulate(likelihood, point, ends, effort.resolution)


def _costs(simulation: Simulation) -> Float[np.ndarray, " W"]:
    """Sum of squares of each window; infinite where its motion could not be simulated."""
    costs = np.array([float(residual.rows @ residual.rows) for residual in simulation.residuals])
    return np.where(np.isfinite(costs), costs, np.inf)
