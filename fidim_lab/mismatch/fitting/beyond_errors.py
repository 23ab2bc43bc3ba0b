"""The part of prediction errors that the fit's own uncertainty does not explain.

A held-out window that hangs on a direction of which the fitted ones tell little is missed by more than its noise,
though the model is right: in a few short windows a frequency may be off by a ten-thousandth, and seen to be. So the
held-out windows together may move the shared parameters, against all that the fit knows of them, and each its own
unknowns: to first order one least-squares step. What physics that is missing leaves stays.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import HeldOutPrediction
from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.likelihood import WindowLinear, linearised
from fidim_lab.identification.mle.trajectories.normal import compressed, reduced


def beyond_errors(
    found: Fit, free: Bool[np.ndarray, " shared"], predicted: Sequence[HeldOutPrediction]
) -> list[Float[np.ndarray, "T M 3"]]:
    """Residuals (m; recorded − predicted; NaN where nothing was recorded) of each prediction after that step.

    free: which shared parameters the fit has moved.
    """
    journeys = {id(one.journey): one for one in predicted}
    all_linear = {key: linearised(one.likelihood, one.journey.optimum.simulation) for key, one in journeys.items()}
    linear = [all_linear[id(one.journey)][one.place] for one in predicted]
    tables = np.stack([compressed(window) for window in linear])
    held = Quadratic.of(reduced(tables, found.likelihood.own), np.zeros((0, len(found.values) + 1)))
    both = Quadratic(found.quadratic.information + held.information, held.gradient)
    step = both.step(free, np.zeros(len(found.values)))
    return [_residuals(prediction, one, step) for prediction, one in zip(predicted, linear, strict=True)]


def _residuals(prediction: HeldOutPrediction, one: WindowLinear, step: np.ndarray) -> np.ndarray:
    moved = one.residual + one.by_shared @ step
    moved = moved - one.by_own @ np.linalg.lstsq(one.by_own, moved, rcond=None)[0]
    residuals = prediction.remainder.residuals.copy()
    seen = np.isfinite(residuals)
    residuals[seen] = -prediction.likelihood.coloured(one.window, moved[: int(seen.sum())], seen)
    return residuals
