"""How unevenly the noise of markers is spread over directions, over the markers, and over recordings.

Cameras see better across their line of sight than along it, and some markers better than others. The noise is what
differences of eighth order leave: they let nothing pass of a motion slower than a tenth of the frame rate, and a
thousandth of one at a fifth. Where the robot file states more noise than most markers show of that, the rest is slower
than frames and of no known direction, and counts as the same in all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import comb
from statistics import median_low

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.neighbours import differences, robust_sd

ORDER = 8
"""of the differences"""
INDEPENDENT = comb(2 * ORDER, ORDER) ** 2 / comb(4 * ORDER, 2 * ORDER)
"""share of independent ones among them: 1 / Σ ρ² of their autocorrelation ρ"""
FREE = 6
"""of a covariance of three coordinates"""
BY_CHANCE = 3.0
"""standard deviations by which noise between frames must stay below the stated one to count as less"""
FARTHEST = 5.0
"""standard deviations of a difference, by their median: one of two million is farther by chance"""
SURE = 5.0
"""log-evidence (BIC) for uneven noise, or for a recording's own, from which on it is believed: odds of 150"""
ROUNDS = 50
"""of Weiszfeld's iteration"""
NEAR = 1e-3
"""a distance of logarithms below which two recordings have the same shape: a thousandth of a covariance"""
TINY = np.finfo(float).tiny
"""keeps the logarithm of a marker that tells nothing finite"""


@dataclass(frozen=True, eq=False)
class _Noise:
    """Of one recording."""

    covariances: Float[np.ndarray, "M 3 3"]
    """m², that of a marker of which nothing is known does not count"""
    independent: Float[np.ndarray, " M"]
    """samples that tell each; 0 where they do not"""

    @property
    def level(self) -> float:
        """m², of the mean coordinate."""
        return float(self.independent @ np.einsum("mii->m", self.covariances)) / 3 / self.independent.sum()


def noise_shapes(
    recordings: Sequence[tuple[Series, Float[np.ndarray, "T M 3"]]], stated: float
) -> list[Float[np.ndarray, "M 3 3"] | None]:
    """For each recording matrices that make the noise of its markers even, and as large as most recordings have it.

    recordings: times (s) and markers (m, NaN where missing). stated: m, one standard deviation of a coordinate. None
    where the noise is as even as chance leaves it, or where nothing tells. What is common is the shape that most
    recordings have: a few with swapped or reflected markers do not change it. These are weighed by their own.
    """
    found = [_between_frames(t, markers) for t, markers in recordings]
    if not any(one.independent.any() for one in found):
        return [None] * len(found)
    slower = _slower(found, stated) * np.eye(3)
    found = [_Noise(one.covariances + slower, one.independent) for one in found]
    telling = [one for one in found if one.independent.any()]
    common, usual = _common(telling), median_low([one.level for one in telling])
    return [_evening(one, common, usual) for one in found]


def _slower(found: Sequence[_Noise], stated: float) -> float:
    """m², by which the stated noise is more than what most markers show between frames; 0 within chance."""
    counts = np.concatenate([one.independent for one in found])
    covariances = np.concatenate([one.covariances for one in found])[counts > 0]
    fast = float(np.median(np.einsum("mii->m", covariances))) / 3
    chance = np.sqrt(2 / counts.sum()) * float(np.median(np.linalg.norm(covariances, axis=(1, 2)))) / 3
    return stated**2 - fast if stated**2 > fast + BY_CHANCE * chance else 0.0


def _common(telling: Sequence[_Noise]) -> Float[np.ndarray, "M 3 3"]:
    """Covariances over their mean; equal ones where the noise is even, or where nothing tells of a marker."""
    most = max(len(one.independent) for one in telling)
    even = np.tile(np.eye(3), (most, 1, 1))
    covariances, independent = even.copy(), np.zeros(most)
    for m in range(most):
        of = [one for one in telling if m < len(one.independent) and one.independent[m] > 0]
        if not of:
            return even
        logs = _spectral(_logarithm, np.array([one.covariances[m] / one.level for one in of]))
        counts = np.array([one.independent[m] for one in of])
        covariances[m], independent[m] = _spectral(np.exp, _middle(logs, counts)), counts.sum()
    covariances /= _Noise(covariances, independent).level
    gained = -0.5 * float(independent @ np.linalg.slogdet(covariances)[1])
    price = 0.5 * (FREE * most - 1) * np.log(independent.sum())
    return covariances if gained - price > SURE else even


def _evening(one: _Noise, common: Float[np.ndarray, "M 3 3"], usual: float) -> Float[np.ndarray, "M 3 3"] | None:
    """By the recording's own noise where that is evidently another one than is common."""
    known = one.independent > 0
    expected, seen = common[: len(known)], one.covariances / usual
    excess = np.linalg.solve(expected, seen)[known]
    apart = np.einsum("mii->m", excess) - np.linalg.slogdet(excess)[1] - 3
    gained = 0.5 * float(one.independent[known] @ apart)
    price = 0.5 * FREE * known.sum() * np.log(max(1.0, one.independent.sum()))
    own = np.where((known & (gained - price > SURE))[:, np.newaxis, np.newaxis], seen, expected)
    return None if (own == np.eye(3)).all() else _spectral(lambda values: np.maximum(values, TINY) ** -0.5, own)


def _between_frames(t: Series, markers: Float[np.ndarray, "T M 3"]) -> _Noise:
    """What differences leave of one recording."""
    found = _differences(t, markers)
    independent = INDEPENDENT * np.array([len(one) for one in found])
    seen = np.array([one.T @ one / max(1, len(one)) for one in found])
    independent[(independent <= FREE) | (np.linalg.eigvalsh(seen)[:, 0] <= 0)] = 0.0
    return _Noise(seen, independent)


def _middle(logs: Float[np.ndarray, "W 3 3"], counts: Float[np.ndarray, " W"]) -> Float[np.ndarray, "3 3"]:
    """Their geometric median (Weiszfeld's iteration from the mean), which no minority moves far."""
    middle = np.average(logs, axis=0, weights=counts)
    for _ in range(ROUNDS):
        distances = np.linalg.norm(logs - middle, axis=(1, 2))
        middle = np.average(logs, axis=0, weights=counts / np.maximum(distances, NEAR))
    return middle


def _logarithm(values: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(values, TINY))


def _spectral(
    function: Callable[[np.ndarray], np.ndarray], symmetric: Float[np.ndarray, "*M 3 3"]
) -> Float[np.ndarray, "*M 3 3"]:
    """A function of matrices, by their eigenvalues."""
    values, axes = np.linalg.eigh(symmetric)
    return np.einsum("...ik,...k,...jk->...ij", axes, function(values), axes)


def _differences(t: Series, markers: Float[np.ndarray, "T M 3"]) -> list[Float[np.ndarray, "D 3"]]:
    """Of each marker, as large as the noise itself; none where samples are too few."""
    if len(t) <= ORDER:
        return [np.zeros((0, 3))] * markers.shape[1]
    columns = even_grid(t).spread(markers.reshape(len(t), -1))
    every = differences(columns, ORDER).reshape(-1, markers.shape[1], 3)
    return [_usual(one[np.isfinite(one).all(axis=1)]) for one in np.moveaxis(every, 1, 0)]


def _usual(found: Float[np.ndarray, "D 3"]) -> Float[np.ndarray, "D 3"]:
    """Without the differences of samples that are off: one spike would be all that is seen of the noise."""
    return found[(np.abs(found) <= FARTHEST * robust_sd(found)).all(axis=1)] if len(found) else found
