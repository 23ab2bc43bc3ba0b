"""Held-out windows: how well a model predicts them with only their initial states fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import HeldOutPrediction, predict_all
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.mismatch.fitting.beyond_errors import beyond_errors
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.fitting.sprung import guesses_of
from fidim_lab.mismatch.residuals.residual import Leftover, of_remainder
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well held-out windows are predicted, with only their initial states fitted."""

    chi2: float
    dof: int
    rms: float
    """m"""
    refused: dict[str, str]
    """window → why it could not be predicted"""
    leftovers: tuple[Leftover, ...] = ()
    """beyond what the fit's own errors explain (`beyond_errors`)"""
    of_window: dict[str, float] = field(default_factory=dict[str, float])
    """χ²/dof of each, lengths included"""

    @property
    def chi2_per_dof(self) -> float:
        """1 says: nothing but noise is left; nan where no window could be predicted."""
        return self.chi2 / self.dof if self.dof else float("nan")

    @property
    def says(self) -> str:
        """The same in words."""
        return f"held-out χ²/dof {self.chi2_per_dof:.3f}" if self.dof else "no window held out to judge it"


@dataclass(frozen=True, eq=False)
class Predicted:
    """Windows with their predictions, and why others have none."""

    found: tuple[tuple[Window, HeldOutPrediction], ...]
    refused: dict[str, str]
    """window → why"""

    @property
    def figures(self) -> HeldOut:
        """The figures of the predictions, without the residuals."""
        chi2, dof, squares, count = 0.0, 0, 0.0, 0
        of_window: dict[str, float] = {}
        for window, prediction in self.found:
            left = prediction.remainder
            seen = int(np.isfinite(left.residuals).sum())
            chi2, dof = chi2 + left.chi2, dof + left.dof
            squares, count = squares + left.rms**2 * seen, count + seen
            of_window[window.id] = left.chi2_per_dof
        rms = float(np.sqrt(squares / count)) if count else float("nan")
        return HeldOut(chi2, dof, rms, self.refused, of_window=of_window)


def predictions(fit: Fit, windows: Sequence[Window]) -> Predicted:
    """Each window that can be predicted with a fit's shared parameters; the others are named."""
    refused: dict[str, str] = {}
    mechanism = fit.likelihood.mechanism
    recordings: list[FollowedSamples] = []
    for window in windows:
        try:
            recordings.append(prepare(window, mechanism.robot))
        except RefusedError as refusal:
            refused[window.id] = str(refusal)
    guesses = guesses_of(mechanism, fit.values, recordings)
    predicted = predict_all(mechanism, fit.values, recordings, mechanism.robot.sensors, guesses)
    found: list[tuple[Window, HeldOutPrediction]] = []
    for recording, prediction in zip(recordings, predicted, strict=True):
        window = recording.window
        if isinstance(prediction, RefusedError):
            refused[window.id] = str(prediction)
        elif prediction.lost and float(prediction.remainder.t[-1] - prediction.remainder.t[0]) < held_out.HORIZONS[0]:
            refused[window.id] = f"Window {window.id}: no start was found from which its first motion follows."
        else:
            found.append((window, prediction))
    return Predicted(tuple(found), refused)


def chi2_beyond_errors(fit: Fit, windows: Sequence[Window]) -> tuple[float, int]:
    """χ² of the windows' markers after what the fit's own errors explain, and the number of values."""
    found = [one for _, one in predictions(fit, windows).found]
    left = beyond_errors(fit, np.ones(len(fit.values), dtype=bool), found)
    noise, count = fit.likelihood.noise, sum(int(np.isfinite(values).sum()) for values in left)
    return sum(float(np.nansum(values**2)) for values in left) / noise**2, count


def predict(completed: Completed, windows: Sequence[Window]) -> HeldOut:
    """Held-out windows with the shared parameters of a completed model, and what they leave."""
    likelihood, predicted = completed.fit.likelihood, predictions(completed.fit, windows)
    figures = predicted.figures
    leftovers = [of_remainder(window.id, one.remainder, likelihood) for window, one in predicted.found]
    followed = figures.chi2 < SHARED.near * figures.dof and not any(one.lost for _, one in predicted.found)
    if followed and not whiteness(leftovers).is_white:
        left = beyond_errors(completed.fit, completed.free, [one for _, one in predicted.found])
        noise = likelihood.noise
        leftovers = [replace(one, values=values / noise) for one, values in zip(leftovers, left, strict=True)]
    return replace(figures, leftovers=tuple(leftovers))
