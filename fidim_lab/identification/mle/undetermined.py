"""Directions of the body that look determined at the optimum and are not: a mode that was never excited.

Where a mode of the motion is not in the recordings, its amplitude is fitted to noise, and at that amplitude its
frequency looks known. A standard deviation then is the width of one peak of noise, and says nothing of other bodies.
So where the data leave some of the body open, every other direction is tried out: ten standard deviations away, with
each window's own state fitted anew, the sum of squares must have risen by ten squared. Where it has not risen by half
of that, no curvature is believed, and the direction counts as open.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body, Sensors
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.spread import LOOSE_COMBINATION
from fidim_lab.identification.mle.trajectories.stages import FAR_PRIOR
from fidim_lab.model.sensitivity.equations import BODY

FAR = 10.0
"""standard deviations: the highest of some hundred peaks of noise in a few windows rises to 5 or 6"""
RISEN = 0.5
"""of what the curvature foretells: lower, the sum of squares is no parabola over that distance"""


def tried_out(found: Fit) -> Fit:
    """The fit with standard deviations that count as open what was not seen; itself where the data leave nothing open.

    Its optimum stays as it is.
    """
    plausible, covariance = found.plausible[:BODY], found.covariance
    values, axes = np.linalg.eigh(covariance[:BODY, :BODY] / np.outer(plausible, plausible))
    if values[-1] < LOOSE_COMBINATION**2:
        return found
    doubt = np.zeros((BODY, BODY))
    for value, axis in zip(values, axes.T, strict=True):
        if value < LOOSE_COMBINATION**2 and not _excluded(found, FAR * np.sqrt(value) * axis * plausible):
            doubt += FAR_PRIOR**2 * np.outer(axis * plausible, axis * plausible)
    return replace(found, doubt=doubt) if doubt.any() else found


def _excluded(found: Fit, by: Float[np.ndarray, " body"]) -> bool:
    """Whether the recordings exclude bodies that are off by so much, either way, as far as such bodies can move."""
    covariance = found.covariance
    others = covariance[BODY:, :BODY] @ np.linalg.solve(covariance[:BODY, :BODY], by)
    step = np.concatenate([by, others])
    least = RISEN * FAR**2 * max(1.0, found.chi2_per_dof)
    return all(_risen(found, found.values + sign * step) > least for sign in (1.0, -1.0))


def _risen(found: Fit, shared: Float[np.ndarray, " shared"]) -> float:
    """Of the sum of squares, the prior's among it, with each window's own state fitted anew; infinite where lost."""
    if not consistency.can_move(Body.from_vector(shared[:BODY])):
        return np.inf
    likelihood, ends = found.likelihood, found.journey.ends
    recordings = [one.until(float(end)) for one, end in zip(likelihood.recordings, ends, strict=True)]
    sensors: Sensors = replace(likelihood.mechanism.robot.sensors, marker_noise=likelihood.noise)
    total = float((found.prior.rows(shared)[:, -1] ** 2).sum() - (found.prior_rows[:, -1] ** 2).sum())
    for now, before in zip(
        held_out.predict_all(likelihood.mechanism, shared, recordings, sensors), found.remainders, strict=True
    ):
        if isinstance(now, RefusedError) or now.lost:
            return np.inf
        total += now.remainder.chi2 - before.chi2
    return total
