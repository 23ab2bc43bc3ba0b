"""A fit continued from its optimum with another model: effects added, removed, or exchanged.

A model that is richer than one already fitted has its optimum near that of the poorer one; begun from nowhere it would
have to find its way again, and may miss it (spec/irma4u.md §6.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.fit import Fit, names_of
from fidim_lab.identification.mle.judge import remainder
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import FINAL, Effort, optimise
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.starts import tied
from fidim_lab.model.slots import Effect


@dataclass(frozen=True, eq=False)
class Newcomer:
    """An effect with the start values and prior sd of its parameters, one entry for each θ."""

    effect: Effect
    start: Sequence[float]
    """of the search"""
    sd: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]
    mean: Sequence[float] | None = None
    """of the prior; the start unless given"""


def exchanged(found: Fit, old: Effect, new: Newcomer) -> Fit | None:
    """The optimum at full length with `new` in the place of `old`; None where it cannot be simulated from there."""
    return rearranged(found, [new if effect == old else effect for effect in found.likelihood.mechanism.effects])


def rearranged(found: Fit, wanted: Sequence[Effect | Newcomer], effort: Effort = FINAL) -> Fit | None:
    """The optimum at full length with these effects, in this order; None where it cannot be simulated from there.

    An effect that the fit has keeps its θ and its prior; a newcomer begins where it says; others are left out.
    """
    before, prior = found.likelihood, found.prior
    low, high = prior.bounds

    def placed(values: np.ndarray, of: Callable[[Newcomer], Sequence[float]]) -> np.ndarray:
        parts = [of(one) if isinstance(one, Newcomer) else values[found.place_of(one)] for one in wanted]
        return np.concatenate([values[:BODY], *parts])

    effects = tuple(one.effect if isinstance(one, Newcomer) else one for one in wanted)
    shared = placed(found.values, lambda one: one.start)
    mechanism = before.mechanism
    made = Mechanism(
        mechanism.robot, effects, shared[BODY:].tolist(), native=mechanism.native, springs=mechanism.springs
    )
    known = Prior(
        placed(prior.mean, lambda one: one.start if one.mean is None else one.mean),
        placed(prior.sd, lambda one: one.sd),
        placed(low, lambda one: one.low),
        placed(high, lambda one: one.high),
        prior.firm,
    )
    begins = before.begins
    states = tied(made, shared, found.journey.optimum.point.states, begins)
    likelihood = replace(before, mechanism=made, guesses=tied(made, shared, before.guesses, begins))
    plausible = placed(found.plausible, lambda one: one.sd)
    return gone_on(found, likelihood, Point(shared, states), known, plausible, effort)


def gone_on(
    found: Fit,
    likelihood: Likelihood,
    start: Point,
    prior: Prior,
    plausible: Float[np.ndarray, " shared"],
    effort: Effort = FINAL,
) -> Fit | None:
    """The same recordings as far as `found` used them, fitted from `start` with the mechanism of `likelihood`.

    None where it cannot be simulated from there.
    """
    free = np.ones(len(start.shared), dtype=bool)
    optimum = optimise(likelihood, start, found.journey.ends, prior, effort, free)
    if optimum is None:
        return None
    return replace(
        found,
        likelihood=likelihood,
        journey=replace(found.journey, optimum=optimum),
        remainders=tuple(remainder(likelihood, optimum.simulation, w) for w in range(len(likelihood.recordings))),
        prior=prior,
        plausible=plausible,
        names=names_of(likelihood.mechanism),
    )
