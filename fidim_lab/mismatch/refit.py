"""Fit a completed model: body, every window's start, and the parameters of the effects within their bounds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import PARAMETER_NAMES, Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import OurBugError, RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import remainder
from fidim_lab.identification.mle.likelihood import Likelihood, Point
from fidim_lab.identification.mle.normal import Prior
from fidim_lab.identification.mle.recordings import prepare
from fidim_lab.identification.mle.stages import FAR_PRIOR, Journey, grow
from fidim_lab.mismatch.hypotheses import BROAD, Hypothesis
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY, refuse_unknown
from fidim_lab.model.sensitivity.starts import tied

HORIZONS = (3.0, 10.0)
"""s; the start is that of a good fit, so the strides may be long"""
ROUNDS = 3
"""how often parameters may be put back on their bounds"""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well windows that no fit has seen are predicted, only their start being fitted."""

    chi2: float
    dof: int
    rms: float
    """m"""
    refused: dict[str, str]
    """window → why it could not be predicted"""

    @property
    def chi2_per_dof(self) -> float:
        """1 says: nothing but noise is left."""
        return self.chi2 / max(1, self.dof)


@dataclass(frozen=True, eq=False)
class Completed:
    """A fitted model with some effects (none: the baseline)."""

    tried: tuple[Hypothesis, ...]
    fit: Fit
    at_bound: tuple[bool, ...]
    """of each entry of θ: held at a bound"""
    log_evidence: float
    """less the baseline's, by χ² at full length; 0 for the baseline"""

    @property
    def mechanism(self) -> Mechanism:
        """With the effects."""
        return self.fit.likelihood.mechanism

    @property
    def excess(self) -> float:
        """χ²/dof for the noise that the residuals show."""
        return self.fit.excess

    @property
    def chi2(self) -> float:
        """Sum of squares of markers and lengths."""
        return sum(left.chi2 for left in self.fit.remainders)

    @property
    def label(self) -> str:
        """For people."""
        return " + ".join(h.label for h in self.tried) or "nothing"

    def theta_of(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """θ of effect k with its standard deviations (nan where held)."""
        first = BODY + sum(len(h.effect.parameters) for h in self.tried[:k])
        last = first + len(self.tried[k].effect.parameters)
        return self.fit.values[first:last], self.fit.sd[first:last]


def can_refit(effect: NamedEffect, mechanism: Mechanism) -> bool:
    """Whether trajectories with derivatives carry the effect's slots."""
    try:
        refuse_unknown(Mechanism(mechanism.robot, (effect,)))
    except OurBugError:
        return False
    return True


def refit(
    base: Fit,
    donor: Fit,
    tried: Sequence[Hypothesis],
    starts: Sequence[Float[np.ndarray, " theta"]],
    context: Context,
) -> Completed | None:
    """Fit the model with these effects from these θ; None where it does not get there.

    base: the baseline, whose prior on the body holds and against which evidence is counted; donor: the fit whose body
    and states are the start. Bounds hold inside the fit: what would cross one is held on it.
    """
    mechanism = Mechanism(
        base.likelihood.mechanism.robot,
        tuple(h.effect for h in tried),
        np.concatenate(list(starts)).tolist(),
        native=base.likelihood.mechanism.native,
    )
    likelihood = replace(base.likelihood, mechanism=mechanism)
    prior = _prior(base, tried)
    low, high = (np.concatenate(side) for side in zip(*(h.effect.bounds(context) for h in tried), strict=True))
    shared = np.concatenate([donor.values[:BODY], np.clip(mechanism.theta, low, high)])
    free = np.ones(len(shared), dtype=bool)
    states = donor.journey.optimum.point.states
    for _ in range(ROUNDS):
        begins = np.array([recording.begin for recording in likelihood.recordings])
        start = Point(shared, tied(mechanism, shared, states, begins))
        journey = grow(likelihood, start, prior, free, HORIZONS)
        if journey is None:
            return None
        point = journey.optimum.point
        theta = point.shared[BODY:]
        outside = (theta < low) | (theta > high)
        if not outside.any():
            found = _as_fit(base, likelihood, journey, prior, tried)
            return Completed(tuple(tried), found, tuple((~free[BODY:]).tolist()), laplace(base, found, tried))
        free[BODY:] &= ~outside
        shared = np.concatenate([point.shared[:BODY], np.clip(theta, low, high)])
        states = point.states
    return None


def predict(completed: Completed, windows: Sequence[Window]) -> HeldOut:
    """Held-out windows with the shared parameters of a completed model."""
    chi2, dof, squares, count = 0.0, 0, 0.0, 0
    refused: dict[str, str] = {}
    robot = completed.mechanism.robot
    for window in windows:
        try:
            recording = prepare(window, robot)
            found = held_out.predict(completed.mechanism, completed.fit.values, recording, robot.sensors).remainder
        except RefusedError as refusal:
            refused[window.id] = str(refusal)
            continue
        seen = int(np.isfinite(found.residuals).sum())
        chi2, dof = chi2 + found.chi2, dof + found.dof
        squares, count = squares + found.rms**2 * seen, count + seen
    return HeldOut(chi2, dof, float(np.sqrt(squares / max(1, count))), refused)


def _prior(base: Fit, tried: Sequence[Hypothesis]) -> Prior:
    body = base.prior
    mean = np.concatenate([body.mean[:BODY], *(h.absent for h in tried)])
    theta = np.concatenate([_theta_sd(h) for h in tried])
    return Prior(mean=mean, sd=np.concatenate([body.sd[:BODY] / FAR_PRIOR, theta]))


def _theta_sd(tried: Hypothesis) -> np.ndarray:
    return np.array([BROAD * parameter.scale for parameter in tried.effect.parameters])


def _as_fit(base: Fit, likelihood: Likelihood, journey: Journey, prior: Prior, tried: Sequence[Hypothesis]) -> Fit:
    found = replace(base, likelihood=likelihood, journey=journey)
    simulation = found.journey.optimum.simulation
    return replace(
        found,
        remainders=tuple(remainder(likelihood, simulation, w) for w in range(len(likelihood.recordings))),
        prior=replace(prior, sd=prior.sd * FAR_PRIOR),
        plausible=prior.sd,
        names=(*PARAMETER_NAMES, *(p.name for h in tried for p in h.effect.parameters)),
    )


def laplace(base: Fit, found: Fit, tried: Sequence[Hypothesis]) -> float:
    """Log-evidence over the baseline: half the χ² gained, in units of what is left, less what freedom costs."""
    inflation = max(1.0, found.excess)
    before, after = (sum(left.chi2 for left in x.remainders) for x in (base, found))
    sd = np.concatenate([_theta_sd(h) for h in tried])
    ratio = sd / np.maximum(found.sd[BODY:] * np.sqrt(inflation), 1e-300)
    return 0.5 * (before - after) / inflation - float(np.log(np.maximum(ratio, 1.0)).sum())
