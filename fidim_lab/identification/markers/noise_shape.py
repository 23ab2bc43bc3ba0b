"""How unevenly the noise of markers is spread over directions, and over the markers.

Cameras see better across their line of sight than along it, and some markers better than others. The noise is what
differences of eighth order leave: they let nothing pass of a motion slower than a tenth of the frame rate, and a
thousandth of one at a fifth. Where the robot file states more noise than that, the rest is slower than frames and of no
known direction, and counts as the same in all.
"""

from collections.abc import Sequence
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


def noise_shape(
    recordings: Sequence[tuple[Series, Float[np.ndarray, "T M 3"]]], stated: float
) -> Float[np.ndarray, "M 3 3"] | None:
    """Matrices that make the noise of each marker as large in all directions as it is on the mean of all.

    recordings: times (s) and markers (m, NaN where missing). stated: m, one standard deviation of a coordinate. None
    where the noise is as even as chance leaves it, or where nothing tells.
    """
    most = max((markers.shape[1] for _, markers in recordings), default=0)
    sums, counts = np.zeros((most, 3, 3)), np.zeros(most)
    for t, markers in recordings:
        for m, found in enumerate(_differences(t, markers)):
            sums[m] += found.T @ found
            counts[m] += len(found)
    if not (counts * INDEPENDENT > FREE).all():
        return None
    seen = sums / counts[:, np.newaxis, np.newaxis]
    independent = counts * INDEPENDENT
    shares = independent / independent.sum()
    fast = float(shares @ np.einsum("mii->m", seen)) / 3
    chance = float(np.sqrt(2 * np.sum(shares**2 / independent * np.einsum("mij,mij->m", seen, seen)))) / 3
    slower = stated**2 - fast if stated**2 > fast + BY_CHANCE * chance else 0.0
    covariances, mean = seen + slower * np.eye(3), fast + slower
    if mean <= 0:
        return None
    values, axes = np.linalg.eigh(covariances / mean)
    if values.min() <= 0:
        return None
    gained = -0.5 * float(independent @ np.log(values).sum(axis=1))
    price = 0.5 * (FREE * most - 1) * np.log(independent.sum())
    return np.einsum("mik,mk,mjk->mij", axes, values**-0.5, axes) if gained - price > SURE else None


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
