"""A marker that slides on the platform, or an origin that moves, during a window. Pure.

Locked motors leave a swing about one place. What moves slowly besides is no free motion: it is fitted together with the
swing's tones, whose frequencies are near those of the robot file's body.
"""

from itertools import combinations, product

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from fidim_lab.arrays import Positions, Series
from procedures.outcomes import Measurement

FREQUENCIES = np.arange(0.7, 1.31, 0.05)
"""times the nominal ones: bodies that are 25 % off have tones within them (three open campaigns)"""
ROWS = 150
"""of the samples, for the search of the frequencies: 10 s at 15 Hz, four times the fastest tone"""
PART = 0.3
"""of the amplitude: large swings are no sums of tones, and leave up to 0.18 of it as slow motion (18 honest windows)"""
TOLD = 1.0 / 3.0
"""of the limit, beyond which it is told"""


def drift_measurement(
    t: Series, place: Positions, frequencies: Float[np.ndarray, " free"], allowed: float
) -> Measurement:
    """place: (N, 3) m, NaN where unseen; frequencies: nominal ones of free motion, Hz; allowed: m, without a swing."""
    seen = ~np.isnan(place).any(axis=1)
    tones = frequencies[frequencies > 0.0]
    name = "slow motion of the marker besides its swing"
    if seen.sum() < 4 * (2 + 2 * len(tones)):
        return Measurement(name, None, "m", high=allowed)
    high = allowed + PART * float(np.ptp(place[seen], axis=0).max())
    slow = slow_motion(t[seen] - t[seen][0], place[seen], tones)
    return Measurement(name, slow, "m", high=high, margin=high * (1.0 - TOLD))


def slow_motion(t: Series, place: Positions, frequencies: Float[np.ndarray, " tones"]) -> float:
    """Largest distance (m) between two places of the middle about which the marker swings."""
    knots = np.linspace(0.0, t[-1], max(2, 1 + int(t[-1] * frequencies.min(initial=1.0))))
    hats = np.array([np.interp(t, knots, one) for one in np.eye(len(knots))]).T
    few = slice(None, None, max(1, len(t) // ROWS))

    def left(factors: Float[np.ndarray, " tones"]) -> np.ndarray:
        return _fit(t[few], place[few], hats[few], factors * frequencies)[1].ravel()

    trials = product(FREQUENCIES, repeat=min(len(frequencies), 2))
    starts = (np.append(one, np.ones(len(frequencies) - len(one))) for one in trials)
    best = min(starts, key=lambda factors: float(np.sum(left(factors) ** 2)))
    factors = least_squares(left, best, max_nfev=15).x if len(best) else best
    middle = _fit(t, place, hats, factors * frequencies)[0][: len(knots)]
    return max(float(np.linalg.norm(a - b)) for a, b in combinations(middle, 2))


def _fit(t: Series, place: Positions, hats: np.ndarray, frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of hats and tones, and what is left of the places."""
    angles = 2.0 * np.pi * np.outer(t, frequencies)
    columns = np.hstack([hats, np.cos(angles), np.sin(angles)])
    found = np.linalg.lstsq(columns, place, rcond=1e-8)[0]
    return found, place - columns @ found
