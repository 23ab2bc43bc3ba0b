"""Statistics of successes: exact intervals of a share, and the size that is found nine times in ten."""

from dataclasses import dataclass

import numpy as np
from scipy import optimize, special, stats

CONFIDENCE = 0.95
FOUND = 0.9
"""share of campaigns that a detection limit means"""
SLOPE_SD = 2.0
"""of the prior of the slope's logarithm about 0, where finding rises from 10 % to 90 % over a factor of 80 in size:
wide, but outcomes that are separated (all large sizes found, no small one) do not make the slope infinite"""
OFFSET_SD = 10.0
MOST_UNCERTAIN = 1e6


@dataclass(frozen=True)
class Share:
    """So many of so many."""

    good: int
    all: int

    @property
    def value(self) -> float:
        """Of 1; NaN of none."""
        return self.good / self.all if self.all else np.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Exact two-sided interval (Clopper and Pearson 1934, Biometrika 26), 95 %."""
        k, n, tail = self.good, self.all, (1.0 - CONFIDENCE) / 2
        low = 0.0 if k == 0 else float(stats.beta.ppf(tail, k, n - k + 1))
        high = 1.0 if k == n else float(stats.beta.ppf(1.0 - tail, k + 1, n - k))
        return low, high

    def __str__(self) -> str:
        if not self.all:
            return "–"
        low, high = self.interval
        return f"{self.good}/{self.all} = {100 * self.value:.1f} % ({100 * low:.1f} – {100 * high:.1f})"


@dataclass(frozen=True)
class DetectionLimit:
    """The size found nine times in ten, by a logistic curve in its logarithm."""

    size: float
    low: float
    """size/low and high/size: a factor of one standard deviation"""
    high: float
    beyond: str = ""
    """where the limit lies outside of what was tried: «below» or «above» its ends"""


def detection_limit(sizes: np.ndarray, found: np.ndarray) -> DetectionLimit | None:
    """Fit P(found) = 1/(1 + exp(−a − b ln size)) by maximum posterior and give the size at `FOUND`.

    sizes: (N,) positive. found: (N,) bool. None where fewer than four sizes were tried, or more found of the small ones
    than of the large. The limit is said to be «below» or «above» what was tried where the curve puts it there.
    """
    if len(sizes) < 4:
        return None
    x = np.log(sizes)
    centre = float(x.mean())
    best = optimize.minimize(_misfit, [0.0, 0.0], args=(x - centre, found), method="BFGS")
    offset, slope = float(best.x[0]), float(np.exp(best.x[1]))
    at = (special.logit(FOUND) - offset) / slope
    gradient = np.array([-1.0 / slope, -at])
    spread = float(np.exp(np.sqrt(max(0.0, gradient @ best.hess_inv @ gradient))))
    size = float(np.exp(at + centre))
    beyond = "below" if size < sizes.min() else "above" if size > sizes.max() else ""
    spread = min(spread, MOST_UNCERTAIN)
    return DetectionLimit(float(np.clip(size, sizes.min(), sizes.max())), size / spread, size * spread, beyond)


def _misfit(parameters: np.ndarray, x: np.ndarray, found: np.ndarray) -> float:
    """Minus the logarithm of the posterior; the slope as its logarithm, so that it stays positive."""
    offset, log_slope = parameters
    logits = offset + np.exp(np.clip(log_slope, -20, 5)) * x
    likelihood = np.where(found, special.log_expit(logits), special.log_expit(-logits)).sum()
    return float(-likelihood + 0.5 * (log_slope / SLOPE_SD) ** 2 + 0.5 * (offset / OFFSET_SD) ** 2)
