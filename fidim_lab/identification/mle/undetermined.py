"""Directions of the body that look determined at the optimum and are not: a mode that was never excited.

Where a mode of the motion is not in the recordings, its amplitude is fitted to noise, and at that amplitude its
frequency looks known. A standard deviation then is the width of one peak of noise, and says nothing of other bodies.
So where the data leave some of the body open, or seem to determine one that cannot exist, every direction is tried
out: ten standard deviations away, with each window's own state fitted anew, the sum of squares must have risen by ten
squared. Where it has not risen by half of that, no curvature is believed, and the direction counts as open. A way that
ends sooner, at bodies that cannot move, is asked for the same rise if a parabola reaches it there; else it says
nothing.
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
from fidim_lab.identification.mle.starts.start import Guess
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.rates import reads_rates

FAR = 10.0
"""standard deviations: the highest of some hundred peaks of noise in a few windows rises to 5 or 6"""
RISEN = 0.5
"""of what the curvature foretells: lower, the sum of squares is no parabola over that distance"""
OPEN = 2.0
"""times what is plausible: the standard deviation of an open direction, and at least how far the search went along it;
with it parameters that have half of the direction count as not seen"""
STEPS = 50
"""parts of the way that are tried where the whole of it ends at bodies that cannot move: fifths of a deviation"""


def tried_out(found: Fit) -> Fit:
    """The fit with standard deviations that count as open what was not seen.

    The fit itself where the data determine all of a body that can exist. Its optimum stays as it is.
    """
    plausible, covariance = found.plausible[:BODY], found.covariance
    values, axes = np.linalg.eigh(covariance[:BODY, :BODY] / np.outer(plausible, plausible))
    if values[-1] < LOOSE_COMBINATION**2 and consistency.can_exist(found.body):
        return found
    here = _left(found, found.values)  # the states fitted as elsewhere: the search may have got stuck before their best
    if not np.isfinite(here):
        return found
    gone = (found.values[:BODY] - found.start.vector) / plausible
    doubt = np.zeros((BODY, BODY))
    for value, axis in zip(values, axes.T, strict=True):
        if value < OPEN**2 and not _excluded(found, FAR * np.sqrt(value) * axis * plausible, here):
            size = np.hypot(OPEN, axis @ gone)
            doubt += size**2 * np.outer(axis * plausible, axis * plausible)
    return replace(found, doubt=doubt) if doubt.any() else found


def _excluded(found: Fit, by: Float[np.ndarray, " body"], here: float) -> bool:
    """Whether the recordings exclude bodies that are off by so much, either way, or the last that can move there.

    here: what is left at the optimum.
    """
    covariance = found.covariance
    others = covariance[BODY:, :BODY] @ np.linalg.solve(covariance[:BODY, :BODY], by)
    step = np.concatenate([by, others])
    least = RISEN * FAR**2 * max(1.0, found.chi2_per_dof)
    reached = [(_as_far_as_bodies_move(found.values, way), way) for way in (step, -step)]
    asked = [found.values + part * way for part, way in reached if part**2 > RISEN]
    return bool(asked) and all(_left(found, there) - here > least for there in asked)


def _as_far_as_bodies_move(values: Float[np.ndarray, " shared"], way: Float[np.ndarray, " shared"]) -> float:
    """The largest of some parts of the way (1: all of it) at which the body can move; 0 where it cannot at any."""
    parts = np.linspace(1.0, 0.0, STEPS, endpoint=False)
    return next((p for p in parts if consistency.can_move(Body.from_vector((values + p * way)[:BODY]))), 0.0)


def _left(found: Fit, shared: Float[np.ndarray, " shared"]) -> float:
    """The sum of squares, the prior's among it, with each window's own state fitted anew; infinite where lost."""
    likelihood, ends = found.likelihood, found.journey.ends
    recordings = [one.until(float(end)) for one, end in zip(likelihood.recordings, ends, strict=True)]
    sensors: Sensors = replace(likelihood.mechanism.robot.sensors, marker_noise=likelihood.noise)
    total = float((found.prior.rows(shared)[:, -1] ** 2).sum())
    near = reads_rates(likelihood.mechanism)  # first rates tell a state far less well than first markers do
    guesses = _states(found) if near else None
    for one in held_out.predict_all(likelihood.mechanism, shared, recordings, sensors, guesses, near=near):
        if isinstance(one, RefusedError) or one.lost:
            return np.inf
        total += one.remainder.chi2
    return total


def _states(found: Fit) -> list[Guess]:
    """Those of the windows at the optimum."""
    states = found.journey.optimum.point.states
    return [Guess(*one, 0.0) for one in zip(states.positions, states.rotations, states.twists, strict=True)]
