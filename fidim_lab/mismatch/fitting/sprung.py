"""Models with cables as springs, fitted to the same recordings as other models (spec/model.md §6).

Stretch that is more than a small correction moves the platform in ways that first order does not tell. So what
stretches cables is fitted with springs. Two ways lead there:

carried_on   from a fit that follows the motion without them, at the stiffness that its score proposes. Stiff cables
             ask for no more: the body is nearly right, the springs begin quiet, and two steps are enough.
grown        from the first 0.3 s on and from several stiffnesses (`identification.mle.starts.springs`), where no fit
             without springs follows.

Stiff springs are quiet (`model.sensitivity.stiff`): what they stretch is seen in the markers, how they ring is not.
Stretch to first order (`motion.equations`) would be cheaper, but what it leaves out, the square of (motion/stretch)²,
is small at any moment, adds up in phase, and hides the effect after 10 s wherever it can be seen at all.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Body
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.starts.springs import spring_prior, starts, stretches, with_springs
from fidim_lab.identification.mle.starts.start import Guess, first_guesses
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import ON_THE_WAY, ROUGH, Effort, optimise
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.identification.mle.trajectories.stages import FAR_PRIOR, HORIZONS, Journey, grow
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY, sprung
from fidim_lab.model.sensitivity.grid import FINE
from fidim_lab.model.sensitivity.integrate import RINGING
from fidim_lab.model.sensitivity.starts import quiet_springs, tied

STIFF = 300.0
"""rad/s, of the fastest oscillation on the springs: from here on they are quiet, at no higher price however
stiff"""

STIFFEST = 1e-7
"""m/N, and 1/N for a cable of a metre: a cable stiffer than that is fitted as rigid"""

AT_LAST = Effort(resolution=FINE, promise=0.1, rounds=10, damping=1e-6, creep=0.1, crawl=SHARED.crawl)
"""a third of a standard deviation: nearer, fast oscillations that no sample shows bend the sum of squares"""


def likelihood_with(likelihood: Likelihood, mechanism: Mechanism, shared: np.ndarray) -> Likelihood:
    """The same recordings with another mechanism, and what is known of its springs where it has any."""
    guesses = replace(likelihood.guesses, tensions=None)
    prior = spring_prior(mechanism, shared, guesses, likelihood.recordings)
    return replace(likelihood, mechanism=mechanism, guesses=guesses, springs=prior)


def guesses_of(
    mechanism: Mechanism, shared: np.ndarray, recordings: Sequence[FollowedSamples]
) -> tuple[Guess | RefusedError, ...]:
    """Where each recording begins; of cables that are springs to first order, which is as good and far sooner found."""
    made = Mechanism(mechanism.robot, mechanism.effects, mechanism.theta.tolist()) if mechanism.springs else mechanism
    return first_guesses(made, Body.from_vector(shared[:BODY]), recordings, shared[BODY:])


def begins_anew(mechanism: Mechanism, donor: Fit) -> bool:
    """Whether the mechanism has springs whose state the donor does not know."""
    return mechanism.springs and sprung(mechanism) != sprung(donor.likelihood.mechanism)


def are_stiff(mechanism: Mechanism, donor: Fit) -> bool:
    """Whether the springs of a mechanism are so stiff that their oscillations are too dear to follow at first."""
    low = stiffest(mechanism)
    shared = np.concatenate([donor.values[:BODY], np.maximum(mechanism.theta, low)])
    states = replace(donor.journey.optimum.point.states, tensions=None)
    return (
        donor.excess < SHARED.near and quiet_springs(mechanism, shared, states, donor.likelihood.begins).fastest > STIFF
    )


def left_at_first(leftovers: Sequence[Leftover]) -> bool:
    """Whether what is left is left of the first tenths of a second, where cables ring after a platform is let go."""
    early = [left.t - left.t[0] < RINGING for left in leftovers]
    first, then = (
        np.concatenate([left.values[use == which].ravel() for left, use in zip(leftovers, early, strict=True)])
        for which in (True, False)
    )
    rest = float(np.nanmean(then**2)) if np.isfinite(then).any() else 1.0
    seen = np.isfinite(first)
    return bool(seen.any()) and float(np.mean(first[seen] ** 2)) > rest * (1 + 4 * float(np.sqrt(2 / seen.sum())))


def carried_on(
    likelihood: Likelihood, donor: Fit, mechanism: Mechanism, start: Point, prior: Prior, free: np.ndarray
) -> tuple[Likelihood, Journey] | None:
    """The fit of a model with springs from a fit of the same recordings without; None where it gets no better.

    start: the donor's, with θ as proposed. The prior is in force at the optimum.
    """
    made = likelihood_with(likelihood, mechanism, start.shared)
    ends, point = donor.journey.ends, start
    nearby = prior.loosened(1 / FAR_PRIOR) if ends.max() > HORIZONS[2] + 1e-9 else prior
    for horizon in HORIZONS[1:3]:
        if horizon < ends.max():
            found = optimise(made, point, np.minimum(ends, horizon), nearby, ON_THE_WAY, free)
            point = point if found is None else found.point
    found = optimise(made, point, ends, prior, AT_LAST, free)
    if found is None or found.cost > donor.journey.optimum.cost:
        return None
    return made, replace(donor.journey, optimum=found)


def grown(
    likelihood: Likelihood, donor: Fit, mechanism: Mechanism, prior: Prior, free: np.ndarray
) -> tuple[Likelihood, Journey] | None:
    """The fit of a model with springs from first guesses, by growing horizons.

    mechanism: with θ as proposed; a compliance of 0 is looked for. The prior is in force at the optimum.
    """
    body, guesses = donor.start.vector, replace(likelihood.guesses, tensions=None)
    whole = max(recording.end for recording in likelihood.recordings) > HORIZONS[2] + 1e-9
    nearby = prior.loosened(1 / FAR_PRIOR) if whole else prior
    tries: list[tuple[float, Likelihood, Point]] = []
    for theta in _stiffnesses(mechanism):
        shared = np.concatenate([body, theta])
        made = likelihood_with(likelihood, with_springs(mechanism), shared)
        start = Point(shared, tied(made.mechanism, shared, guesses, made.begins))
        ends = np.minimum([recording.end for recording in made.recordings], HORIZONS[0])
        found = optimise(made, start, ends, nearby, ROUGH, free)
        if found is not None:
            tries.append((found.cost, made, found.point))
    if not tries:
        return None
    _, made, start = min(tries, key=lambda each: each[0])
    journey = grow(made, start, nearby, free, HORIZONS, AT_LAST)
    return None if journey is None else (made, journey)


def _stiffnesses(mechanism: Mechanism) -> list[np.ndarray]:
    """θ as proposed where it stretches something, and with compliances that are looked for."""
    low = stiffest(mechanism)
    unknown = Mechanism(
        mechanism.robot, mechanism.effects, np.where(low > 0, 0.0, mechanism.theta).tolist(), native=mechanism.native
    )
    proposed = [mechanism.theta] if (mechanism.theta > low).all() else []
    return [*proposed, *starts(unknown)]


def stiffest(mechanism: Mechanism) -> np.ndarray:
    """Lowest θ with which the cables are springs that do not drive themselves; −∞ for what stretches none."""
    low = [np.full(len(e.parameters), -np.inf) for e in mechanism.effects]
    for effect, part in zip(mechanism.effects, low, strict=True):
        if stretches(effect):
            part[:1], part[1:] = STIFFEST, 0.0  # a damping below 0, which the first second may like, blows up
    return np.concatenate([np.zeros(0), *low])


def bounded(prior: Prior, mechanism: Mechanism) -> Prior:
    """The prior with springs kept springs, as a bound within the fit."""
    if not mechanism.springs:
        return prior
    free = np.full(BODY, np.inf)
    low = stiffest(mechanism)
    return replace(prior, low=np.concatenate([-free, low]), high=np.full(BODY + len(low), np.inf))
