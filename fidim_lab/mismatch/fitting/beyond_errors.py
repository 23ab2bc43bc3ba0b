"""The part of prediction errors that the fit's own uncertainty does not explain.

A held-out window that hangs on a direction of which the fitted ones tell little is missed by more than its noise,
though the model is right: in a few short windows a frequency may be off by a ten-thousandth, and seen to be. So the
held-out windows together may move the shared parameters, against all that the fit knows of them, what a body changes
by between windows, and each its own unknowns: to first order one least-squares step. What physics that is missing
leaves stays.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import block_diag

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import HeldOutPrediction
from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.likelihood import WindowLinear, linearised
from fidim_lab.identification.mle.trajectories.normal import Reduced, compressed, reduced
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.sensitivity.equations import BODY


def beyond_errors(
    found: Fit, free: Bool[np.ndarray, " shared"], predicted: Sequence[HeldOutPrediction]
) -> list[Float[np.ndarray, "T M 3"]]:
    """Residuals (m; recorded − predicted; NaN where nothing was recorded) of each prediction after that step.

    free: which shared parameters the fit has moved.
    """
    journeys = {id(one.journey): one for one in predicted}
    all_linear = {key: linearised(one.likelihood, one.journey.optimum.simulation) for key, one in journeys.items()}
    linear = [all_linear[id(one.journey)][one.place] for one in predicted]
    changes = [_change_by(one.likelihood.recordings[one.place]) for one in predicted]
    width = max((by.shape[1] for by in changes), default=0)
    tables = _with_changes(reduced(np.stack([compressed(one) for one in linear]), found.likelihood.own), changes, width)
    known = _with_changes(found.tables, [_change_by(recording) for recording in found.likelihood.recordings], width)
    beforehand = found.prior_rows[:, :-1]
    held = Quadratic.of(tables)
    information = Quadratic.of(known).information + block_diag(beforehand.T @ beforehand, np.eye(width))
    both = Quadratic(information + held.information, held.gradient)
    step = both.step(np.append(free, np.ones(width, dtype=bool)), np.zeros(len(free) + width))
    shared, theta = np.split(step, [len(free)])
    steps = [shared + np.pad(by @ theta[: by.shape[1]], (0, len(free) - BODY)) for by in changes]
    return [_residuals(*each) for each in zip(predicted, linear, steps, strict=True)]


def _change_by(recording: FollowedSamples) -> Float[np.ndarray, "9 p"]:
    by = recording.window.body_change_by
    return np.zeros((BODY, 0)) if by is None else by


def _with_changes(tables: Reduced, changes: Sequence[Float[np.ndarray, "9 p"]], width: int) -> Reduced:
    """With columns for what the bodies change by, after those of the shared parameters."""
    wide = np.stack([np.pad(by, ((0, 0), (0, width - by.shape[1]))) for by in changes])
    return np.concatenate([tables[:, :, :-1], tables[:, :, :BODY] @ wide, tables[:, :, -1:]], axis=2)


def _residuals(prediction: HeldOutPrediction, one: WindowLinear, step: np.ndarray) -> np.ndarray:
    moved = one.residual + one.by_shared @ step
    moved = moved - one.by_own @ np.linalg.lstsq(one.by_own, moved, rcond=None)[0]
    residuals = prediction.remainder.residuals.copy()
    seen = np.isfinite(residuals)
    residuals[seen] = -prediction.likelihood.coloured(one.window, moved[: int(seen.sum())], seen)
    return residuals
