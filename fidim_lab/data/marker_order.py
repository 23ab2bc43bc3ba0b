"""Which measured marker is which of the robot file: by the distances between them, which no motion changes."""

from itertools import permutations
from math import comb, perm

import numpy as np

from fidim_lab.errors import RefusedError

ALIKE = 0.015
"""m; distances of one pair may differ so much: markers are glued on by hand"""
CLEAR = 2.0
"""times as badly must the second-best order fit, or the markers' own order decides"""
MOST_ORDERS = 50_000


def order_of(markers: np.ndarray, body: np.ndarray) -> tuple[tuple[int, ...], float, bool]:
    """The measured markers in the robot file's order.

    Args:
        markers: (N, M, 3) m, NaN where not seen.
        body: (B, 3) m, body frame; B at most M.

    Returns:
        (B,) indices into the M markers, rms misfit of their distances (m), whether no other order fits about as well.

    Raises RefusedError where no order fits to `ALIKE`, or there are too few markers or too many orders.
    """
    between = _distances(markers)
    wanted = np.linalg.norm(body[:, None] - body[None], axis=2)
    count = markers.shape[1]
    if count < len(body):
        raise RefusedError(f"{count} markers were recorded; the robot file has {len(body)}.")
    if perm(count, len(body)) > MOST_ORDERS:
        raise RefusedError(f"{count} markers are too many to find which are the platform's {len(body)}.")
    orders = list(permutations(range(count), len(body)))
    pairs, misfits = np.array([_misfit(between[np.ix_(order, order)] - wanted) for order in orders]).T
    most = pairs.max()
    if 2 * most < comb(len(body), 2):
        raise RefusedError(f"{count} markers, and most were never seen together: are they pieces of trajectories?")
    misfits[pairs < most] = np.inf  # of pieces, those never seen together would contradict nothing
    best = int(np.argmin(misfits))
    rest = np.delete(misfits, best)
    if len(body) > 1 and not misfits[best] <= ALIKE:
        raise RefusedError(
            f"No order of the {count} markers fits the robot file: "
            f"distances differ by {misfits[best] * 1e3:.0f} mm rms.",
            hint="Check [platform] marker and extra_markers, and the unit of the recording.",
        )
    certain = not len(rest) or bool(rest.min() > CLEAR * misfits[best])
    as_recorded = orders.index(tuple(range(len(body))))
    chosen = as_recorded if not certain and misfits[as_recorded] <= CLEAR * misfits[best] else best
    return orders[chosen], float(misfits[chosen]), certain


def _distances(markers: np.ndarray) -> np.ndarray:
    """(M, M) median distances, m; NaN for pairs never seen together."""
    count = markers.shape[1]
    table = np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            apart = np.linalg.norm(markers[:, i] - markers[:, j], axis=1)
            apart = apart[np.isfinite(apart)]
            table[i, j] = table[j, i] = np.median(apart) if len(apart) else np.nan
    return table


def _misfit(difference: np.ndarray) -> tuple[int, float]:
    """How many pairs were ever seen together, and the misfit of their distances, m rms."""
    known = difference[np.triu_indices(len(difference), 1)]
    known = known[np.isfinite(known)]
    return len(known), float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
