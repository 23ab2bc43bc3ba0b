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
WHOLE = 0.5
"""of the samples in which one of many markers must be seen: others are pieces of trajectories"""
BLOCK = 1000
"""orders looked at together: with 1000 markers of which 5 are wanted they take 32 MB"""


def order_of(markers: np.ndarray, body: np.ndarray) -> tuple[tuple[int, ...], float, bool]:
    """The measured markers in the robot file's order.

    Args:
        markers: (N, M, 3) m, NaN where not seen.
        body: (B, 3) m, body frame; B at most M.

    Returns:
        (B,) indices into the M markers, rms misfit of their distances (m), whether no other order fits about as well.

    Raises RefusedError where no order fits to `ALIKE`, or there are too few markers or too many orders.
    """
    between, varies = _distances(markers)
    wanted = np.linalg.norm(body[:, None] - body[None], axis=2)
    count = markers.shape[1]
    if count < len(body):
        raise RefusedError(f"{count} markers were recorded; the robot file has {len(body)}.")
    if perm(count, len(body)) <= MOST_ORDERS:
        orders = list(permutations(range(count), len(body)))
    else:
        whole = np.isfinite(markers).all(axis=2).mean(axis=0) >= WHOLE
        steady = (varies <= ALIKE) & whole & whole[:, np.newaxis]
        orders = _among_many(np.where(steady, between, np.nan), wanted)
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
    first = tuple(range(len(body)))
    as_recorded = orders.index(first) if first in orders else best
    chosen = as_recorded if not certain and misfits[as_recorded] <= CLEAR * misfits[best] else best
    return orders[chosen], float(misfits[chosen]), certain


def _among_many(between: np.ndarray, wanted: np.ndarray) -> list[tuple[int, ...]]:
    """Orders of many markers in which each distance was seen and is nearly the wanted one, marker by marker.

    between: (M, M) median distances, m, NaN where they vary: one of the two is on the platform, the other is not. Room
    and tools have many more pairs at some wanted distance. wanted: (B, B) m. Raises RefusedError where there are none,
    or too many.
    """
    count, body = len(between), len(wanted)
    found = np.arange(count)[:, np.newaxis]
    for k in range(1, body):
        blocks = np.array_split(found, 1 + len(found) // BLOCK)
        found = np.concatenate([_with_next(between, wanted[k, :k], block) for block in blocks])
        if not 0 < len(found) <= MOST_ORDERS:
            too = "too many" if len(found) else "none of them at"
            what = f"{count} markers were recorded, {too} the distances of the robot file's {body}."
            raise RefusedError(what, hint="Name the platform's with --order, in the robot file's order.")
    return [tuple(order) for order in found.tolist()]


def _with_next(between: np.ndarray, wanted: np.ndarray, found: np.ndarray) -> np.ndarray:
    """(F, k) orders, each with every further marker that is nearly at the (k,) wanted distances from it."""
    near = (np.abs(between[found] - wanted[:, np.newaxis]) <= CLEAR * ALIKE).all(axis=1)
    row, marker = np.nonzero(near)
    new = (found[row] != marker[:, np.newaxis]).all(axis=1)
    return np.column_stack([found[row], marker])[new]


def _distances(markers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(M, M) median distances and how much they vary (robust sd), m; NaN for pairs never seen together."""
    count = markers.shape[1]
    table, varies = np.zeros((2, count, count))
    for i in range(count):
        for j in range(i):
            apart = np.linalg.norm(markers[:, i] - markers[:, j], axis=1)
            apart = apart[np.isfinite(apart)]
            middle = np.median(apart) if len(apart) else np.nan
            table[i, j] = table[j, i] = middle
            varies[i, j] = varies[j, i] = 1.4826 * np.median(np.abs(apart - middle)) if len(apart) else np.nan
    return table, varies


def _misfit(difference: np.ndarray) -> tuple[int, float]:
    """How many pairs were ever seen together, and the misfit of their distances, m rms."""
    known = difference[np.triu_indices(len(difference), 1)]
    known = known[np.isfinite(known)]
    return len(known), float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
