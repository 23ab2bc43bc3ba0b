"""A fit gone on from its optimum with another model: `exchanged` puts another effect in the place of one of its own.

A model that is richer than one already fitted has its optimum near that of the poorer one; begun from nowhere it would
have to find its way again, and may miss it (spec/irma4u.md §6.5).
"""

from collections.abc import Sequence
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
    """An effect with where it begins and how far it is known beforehand; one entry for each of its θ."""

    effect: Effect
    start: Sequence[float]
    """of the search, and the mean of the prior"""
    sd: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


def exchanged(found: Fit, old: Effect, new: Newcomer) -> Fit | None:
    """The optimum at full length with `new` in the place of `old`; None where it cannot be simulated from there."""
    before, prior, place = found.likelihood, found.prior, found.place_of(old)
    mechanism = before.mechanism
    effects = tuple(new.effect if effect == old else effect for effect in mechanism.effects)

    def placed(values: np.ndarray, newcomer: Sequence[float]) -> np.ndarray:
        return np.concatenate([values[: place.start], newcomer, values[place.stop :]])

    shared = placed(found.values, new.start)
    made = Mechanism(
        mechanism.robot, effects, shared[BODY:].tolist(), native=mechanism.native, springs=mechanism.springs
    )
    low, high = prior.bounds
    known = Prior(
        placed(prior.mean, new.start),
        placed(prior.sd, new.sd),
        placed(low, new.low),
        placed(high, new.high),
        prior.firm,
    )
    begins = before.begins
    states = tied(made, shared, found.journey.optimum.point.states, begins)
    likelihood = replace(before, mechanism=made, guesses=tied(made, shared, before.guesses, begins))
    return gone_on(found, likelihood, Point(shared, states), known, placed(found.plausible, new.sd))


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
