"""The residual of a window after a fit: χ²/dof, rms, whiteness, and the marker noise that it shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation

LAGS = 20
"""samples, over which residuals are tested for correlation"""
SURPRISE = 5.0
"""standard deviations of χ² above its expectation by which more than noise is left"""
UNEVEN = 1.5
"""times the usual noise that one window may show without something missing from the model"""
EVEN = 0.01
"""share of the sampling interval by which samples may be off and still count as neighbours"""


@dataclass(frozen=True, eq=False)
class Remainder:
    """The residuals of one window and their figures."""

    t: Series
    """s on the window's own clock (as in its file)"""
    residuals: Float[np.ndarray, "T M 3"]
    """recorded − predicted, m; NaN where nothing was recorded"""
    predicted: Float[np.ndarray, "T M 3"]
    """m; NaN where nothing was recorded"""
    chi2: float
    """of markers and lengths"""
    dof: int
    """their number, less the window's own unknowns"""
    rms: float
    """of the marker residuals, m"""
    whiteness: float | None
    """mean of N ρ² over the first lags: 1 ± 0.3 for white residuals, larger where something is left; None if uneven"""
    noise: float | None
    """m, by fourth differences: what no smooth motion explains, and at least `MARKERS.finest` of the stated noise"""
    evening: Float[np.ndarray, "M 3 3"] | None = None
    """by which the noise of each marker becomes even; None where it is"""

    @property
    def chi2_per_dof(self) -> float:
        """1 says: nothing but the stated noise is left."""
        return self.chi2 / self.dof


def remainder(likelihood: Likelihood, simulation: Simulation, w: int) -> Remainder:
    """The remainder of recording `w` as far as it was used."""
    recording = likelihood.recordings[w]
    use, seen = recording.seen_until(simulation.ends[w])
    found = simulation.residuals[w]
    left = np.full(seen.shape, np.nan)
    left[seen] = -likelihood.coloured(w, found.markers, seen)
    t = recording.window.t[0] + recording.begin + recording.t[use]
    count = len(found.markers) + len(found.lengths)
    return Remainder(
        t=t,
        residuals=left,
        predicted=recording.markers[use] - left,
        chi2=float(found.markers @ found.markers + found.lengths @ found.lengths),
        dof=max(1, count - likelihood.own),
        rms=float(np.sqrt(np.mean(left[seen] ** 2))),
        whiteness=_whiteness(t, left),
        noise=_noise(t, left, MARKERS.finest * likelihood.noise),
        evening=recording.evening,
    )


def noise_alone(remainders: Sequence[Remainder], noise: float, usual: float) -> bool:
    """Whether nothing but noise is left, by χ²: each window is judged by the noise of its own residuals, if near usual.

    noise: m, as stated. usual: times that, of all windows.
    """
    own = [usual if left.noise is None else left.noise / noise for left in remainders]
    own = np.clip(own, usual / UNEVEN, usual * UNEVEN)
    expected = sum(left.dof * ratio**2 for left, ratio in zip(remainders, own, strict=True))
    beyond = sum(left.chi2 for left in remainders) / max(expected, 1e-300)
    return bool((beyond - 1) * np.sqrt(sum(left.dof for left in remainders) / 2) <= SURPRISE)


def _whiteness(t: Series, residuals: Float[np.ndarray, "T M 3"]) -> float | None:
    """Ljung–Box without its small-sample factors, per lag, over all coordinates together."""
    columns = _even(t, residuals)
    if columns is None or len(columns) < 3 * LAGS:
        return None
    total = 0.0
    counted = 0
    for column in columns.T:
        seen = np.isfinite(column)
        if seen.sum() < 3 * LAGS:
            continue
        x, there = np.where(seen, column - column[seen].mean(), 0.0), seen.astype(float)
        square = np.mean(x[seen] ** 2) ** 2
        for lag in range(1, LAGS + 1):
            pairs = there[lag:] @ there[:-lag]
            if pairs > LAGS:
                total += float((x[lag:] @ x[:-lag]) ** 2 / pairs / square)
                counted += 1
    return total / counted if counted else None


def _noise(t: Series, residuals: Float[np.ndarray, "T M 3"], least: float) -> float | None:
    columns = _even(t, residuals)
    if columns is None or len(columns) < LAGS:
        return None
    fourth = np.diff(columns, n=4, axis=0)
    fourth = fourth[np.isfinite(fourth)]
    return max(least, float(np.sqrt(np.mean(fourth**2) / 70))) if len(fourth) > LAGS else None


def _even(t: Series, residuals: Float[np.ndarray, "T M 3"]) -> Float[np.ndarray, "N K"] | None:
    """Residuals on the even grid of the sampling, NaN in gaps; None where the samples lie on no such grid."""
    if len(t) < 3:
        return None
    interval = float(np.median(np.diff(t)))
    steps = (t - t[0]) / interval
    index = np.rint(steps).astype(int)
    if np.abs(steps - index).max() > EVEN * max(1, len(t)) or np.any(np.diff(index) < 1):
        return None
    grid = np.full((index[-1] + 1, residuals[0].size), np.nan)
    grid[index] = residuals.reshape(len(t), -1)
    return grid
