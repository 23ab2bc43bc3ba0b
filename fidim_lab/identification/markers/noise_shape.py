"""How unevenly the noise of markers is spread over directions, and over the markers.

Cameras see better across their line of sight than along it, and some markers better than others. The noise is what
differences of eighth order leave: they let nothing pass of a motion slower than a tenth of the frame rate, and a
thousandth of one at a fifth. Where the robot file states more noise than that, the rest is slower than frames and of no
known direction, and counts as the same in all.
"""

from collections.abc import Callable, Sequence
from math import comb

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
"""log-evidence (BIC) for uneven noise, from which on it is believed: odds of 150"""
ROUNDS = 50
"""of Weiszfeld's iteration"""
NEAR = 1e-3
"""a distance of logarithms below which two recordings have the same shape: a thousandth of a covariance"""
TINY = np.finfo(float).tiny
"""keeps the logarithm of a marker that tells nothing finite"""


def noise_shape(
    recordings: Sequence[tuple[Series, Float[np.ndarray, "T M 3"]]], stated: float
) -> Float[np.ndarray, "M 3 3"] | None:
    """Matrices that make the noise of each marker as large in all directions as it is on the mean of all.

    recordings: times (s) and markers (m, NaN where missing). stated: m, one standard deviation of a coordinate. None
    where the noise is as even as chance leaves it, or where nothing tells. The shape is the one that most recordings
    have: a few with swapped or reflected markers do not change it.
    """
    most = max((markers.shape[1] for _, markers in recordings), default=0)
    if not most:
        return None
    found = [_of_recording(t, markers, stated) for t, markers in recordings]
    covariances, independent = np.zeros((most, 3, 3)), np.zeros(most)
    for m in range(most):
        logs = [(one[m], count[m]) for one, count in found if m < len(count) and count[m] > 0]
        if not logs:
            return None
        every, counts = (np.array(values) for values in zip(*logs, strict=True))
        covariances[m], independent[m] = _spectral(np.exp, _middle(every, counts)), counts.sum()
    mean = float(independent @ np.einsum("mii->m", covariances)) / 3 / independent.sum()
    gained = -0.5 * float(independent @ np.linalg.slogdet(covariances / mean)[1])
    price = 0.5 * (FREE * most - 1) * np.log(independent.sum())
    return _spectral(lambda values: values**-0.5, covariances / mean) if gained - price > SURE else None


def _of_recording(
    t: Series, markers: Float[np.ndarray, "T M 3"], stated: float
) -> tuple[Float[np.ndarray, "M 3 3"], Float[np.ndarray, " M"]]:
    """Logarithms of the covariances over their mean, and how many samples tell each; 0 where they do not tell it."""
    found = _differences(t, markers)
    independent = INDEPENDENT * np.array([len(one) for one in found])
    seen = np.array([one.T @ one / max(1, len(one)) for one in found])
    independent[(independent <= FREE) | (np.linalg.eigvalsh(seen)[:, 0] <= 0)] = 0.0
    if not independent.any():
        return seen, independent
    shares = independent / independent.sum()
    fast = float(shares @ np.einsum("mii->m", seen)) / 3
    lengths = np.einsum("mij,mij->m", seen, seen)
    chance = float(np.sqrt(2 / independent.sum() * shares @ lengths)) / 3
    slower = stated**2 - fast if stated**2 > fast + BY_CHANCE * chance else 0.0
    covariances = (seen + slower * np.eye(3)) / (fast + slower)
    return _spectral(lambda values: np.log(np.maximum(values, TINY)), covariances), independent


def _middle(logs: Float[np.ndarray, "W 3 3"], counts: Float[np.ndarray, " W"]) -> Float[np.ndarray, "3 3"]:
    """Their geometric median (Weiszfeld's iteration from the mean), which no minority moves far."""
    middle = np.average(logs, axis=0, weights=counts)
    for _ in range(ROUNDS):
        distances = np.linalg.norm(logs - middle, axis=(1, 2))
        middle = np.average(logs, axis=0, weights=counts / np.maximum(distances, NEAR))
    return middle


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
