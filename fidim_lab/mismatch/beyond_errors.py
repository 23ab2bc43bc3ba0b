"""What predictions leave beyond what the fit's own errors explain.

A held-out window that hangs on a direction of which the fitted ones tell little is missed by more than its noise,
though the model is right: in a few short windows a frequency may be off by a ten-thousandth, and seen to be. So the
held-out windows together may move the shared parameters, against all that the fit knows of them, and each its own
unknowns: to first order one least-squares step. What physics that is missing leaves stays.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import Prediction
from fidim_lab.identification.mle.likelihood import Likelihood, Simulation, WindowLinear, linearised


def beyond_errors(
    found: Fit, free: Bool[np.ndarray, " shared"], predicted: Sequence[Prediction]
) -> list[Float[np.ndarray, "T M 3"]]:
    """Residuals (m; recorded − predicted; NaN where nothing was recorded) of each prediction after that step.

    free: which shared parameters the fit has moved.
    """
    journeys = {id(one.journey): one for one in predicted}
    all_linear = {key: _linear(one.likelihood, one.journey.optimum.simulation) for key, one in journeys.items()}
    linear = [all_linear[id(one.journey)][one.place] for one in predicted]
    rows = np.concatenate([*found.tables, found.prior_rows])
    known = rows[:, :-1].T @ rows[:, :-1]
    toward = np.zeros(len(known))
    projected = [_without_own(one) for one in linear]
    for by_shared, residual in projected:
        known += by_shared.T @ by_shared
        toward -= by_shared.T @ residual
    step = np.zeros(len(known))
    scale = np.sqrt(np.diag(known))[free]
    step[free] = np.linalg.solve(known[np.ix_(free, free)] / np.outer(scale, scale), toward[free] / scale) / scale
    return [_residuals(prediction, one, step) for prediction, one in zip(predicted, linear, strict=True)]


def _linear(likelihood: Likelihood, simulation: Simulation) -> dict[int, WindowLinear]:
    return {one.window: one for one in linearised(likelihood, simulation)}


def _without_own(one: WindowLinear) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by what is shared, and the residual, as far as the window's own unknowns do not take them up."""
    basis = np.linalg.qr(one.by_own)[0]
    both = np.column_stack([one.by_shared, one.residual])
    both = both - basis @ (basis.T @ both)
    return both[:, :-1], both[:, -1]


def _residuals(prediction: Prediction, one: WindowLinear, step: np.ndarray) -> np.ndarray:
    moved = one.residual + one.by_shared @ step
    moved = moved - one.by_own @ np.linalg.lstsq(one.by_own, moved, rcond=None)[0]
    residuals = prediction.remainder.residuals.copy()
    seen = np.isfinite(residuals)
    residuals[seen] = -moved[: int(seen.sum())] * prediction.likelihood.noise
    return residuals
