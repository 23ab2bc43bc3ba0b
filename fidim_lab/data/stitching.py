"""Markers whose labels are wrong in some samples: found again among all places seen, by the rigid distances.

A sample is looked at where the labelled markers do not fit the rigid shape, or one of them is missing while a place
was seen that nothing claims; so markers that have no labels at all are found, too. The markers are looked for where the
pose one sample before puts them; without that, by the distances between the places. A sample that stays in doubt is
left as it was.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from fidim_lab.data.rigid_body import MarkerSeries, MarkerShape, cluster_shape, fit_pose
from fidim_lab.errors import RefusedError

NEAR = 0.25
"""of the smallest distance between two markers: a place nearer to where a marker must be than this is that marker"""
FASTEST = 0.03
"""m in one sample, the most of the above: 3 m/s at 100 Hz, faster than such a platform swings"""
FITS = 0.1
"""of that: a sample fits while its misfit is under it. One of five markers so far off leaves twice as much (rms)"""
FEWEST = 3
"""markers that show a pose"""
MOST_PLACES = 40
"""in one sample when looking by distances: 40³ threes in some ms"""


@dataclass(frozen=True, eq=False)
class Stitched:
    """Markers with their labels mended."""

    markers: MarkerSeries
    relabelled: int
    """samples in which a marker got another place than its label had"""
    found: int
    """samples in which a missing marker was found among the places without a label"""


def found_by_shape(places: MarkerSeries, body: MarkerShape) -> MarkerSeries:
    """Markers (N, B, 3) m found in each sample by distances alone, whatever their labels; NaN where none is.

    Places and body as in `stitch`.
    """
    return stitch(np.full((len(places), *body.shape), np.nan), places, body).markers


def stitch(markers: MarkerSeries, places: MarkerSeries, body: MarkerShape) -> Stitched:
    """Mend labels.

    Args:
        markers: (N, B, 3) m by their labels, in the body's order; NaN where not seen.
        places: (N, P, 3) m, all that was seen, with the labelled ones among them.
        body: (B, 3) m, the shape by the robot file; the recording's own is taken where it shows it.
    """
    shape = _shape(markers, body)
    _, _, rms = fit_pose(markers, shape)
    near = min(NEAR * _smallest(shape), FASTEST)
    limit = FITS * near
    seen = np.asarray(np.isfinite(markers).all(axis=2))
    shown = np.asarray(np.isfinite(places).all(axis=2)).sum(axis=1)
    missing = np.asarray(~seen.all(axis=1))
    doubtful = (rms > limit) | (missing & (shown > seen.sum(axis=1)) & (shown >= FEWEST))
    mended = markers.copy()
    relabelled = found = 0
    for k in np.flatnonzero(doubtful):
        before = mended[k - 1] if k else np.full_like(shape, np.nan)
        better = _found(places[k], before, shape, near)
        if better is None:
            continue
        now = np.asarray(np.isfinite(better[:, 0]))
        if now.sum() < (seen[k].sum() if rms[k] <= limit else FEWEST):
            continue
        both = seen[k] & now
        moved = bool((better[both] != markers[k][both]).any()) or bool((seen[k] & ~both).any())
        mended[k], relabelled, found = better, relabelled + moved, found + (not moved and bool((now & ~seen[k]).any()))
    return Stitched(mended, relabelled, found)


def _shape(markers: MarkerSeries, body: MarkerShape) -> MarkerShape:
    """The shape by the samples whose distances are the median ones, or the robot file's where no sample is whole."""
    whole = markers[np.isfinite(markers).all(axis=(1, 2))]
    if not len(whole):
        return body
    apart = np.linalg.norm(whole[:, :, None] - whole[:, None], axis=3)
    usual = np.abs(apart - np.median(apart, axis=0)).max(axis=(1, 2)) < NEAR * _smallest(body)
    try:
        return cluster_shape(whole[usual]).markers
    except RefusedError:
        return body


def _smallest(shape: MarkerShape) -> float:
    apart = np.linalg.norm(shape[:, None] - shape[None], axis=2)
    return float(apart[np.triu_indices(len(shape), 1)].min())


def _found(places: np.ndarray, before: np.ndarray, shape: MarkerShape, near: float) -> np.ndarray | None:
    """(B, 3) the markers among the places of one sample, NaN where there is none; None in doubt."""
    points = places[np.isfinite(places).all(axis=1)]
    if len(points) < FEWEST:
        return None
    position, rotation, misfit = fit_pose(before[None], shape)
    if np.isfinite(misfit[0]):
        expected = position[0] + shape @ rotation[0].T
        assigned = _assigned(points, expected, near)
        for tried in (assigned[None], _less_one(assigned)):
            rms = fit_pose(tried, shape)[2]
            if (rms <= FITS * near).any():
                return tried[np.nanargmin(rms)]
    return _by_distances(points, shape, near)


def _less_one(assigned: np.ndarray) -> np.ndarray:
    """(K, B, 3) without each marker in turn, as long as the others show a pose: one that is off is no other marker."""
    there = np.flatnonzero(np.isfinite(assigned[:, 0]))
    fewer = np.repeat(assigned[None], len(there) if len(there) > FEWEST else 0, axis=0)
    fewer[np.arange(len(fewer)), there[: len(fewer)]] = np.nan
    return fewer


def _assigned(points: np.ndarray, expected: np.ndarray, near: float) -> np.ndarray:
    """The point nearest to each expected place, each once; NaN where none is near enough."""
    apart = np.linalg.norm(expected[:, None] - points[None], axis=2)
    rows, columns = linear_sum_assignment(np.minimum(apart, 10.0 * near))
    found = np.full_like(expected, np.nan)
    for row, column in zip(rows, columns, strict=True):
        if apart[row, column] <= near:
            found[row] = points[column]
    return found


def _fits(markers: np.ndarray, shape: MarkerShape, limit: float) -> bool:
    return bool(fit_pose(markers[None], shape)[2][0] <= limit)


def _by_distances(points: np.ndarray, shape: MarkerShape, near: float) -> np.ndarray | None:
    """The only assignment of most markers that fits the shape; None where there is none, or two."""
    if len(points) > MOST_PLACES:
        return None
    limit = FITS * near
    best: list[np.ndarray] = []
    most = FEWEST
    for guess in _guesses(points, shape, 3.0 * limit):
        position, rotation, misfit = fit_pose(guess[None], shape)
        if not misfit[0] <= limit:
            continue
        assigned = _assigned(points, position[0] + shape @ rotation[0].T, near)
        count = int(np.isfinite(assigned).all(axis=1).sum())
        if count < most or not _fits(assigned, shape, limit):
            continue
        best = [] if count > most else best
        most = count
        if not any(np.array_equal(assigned, other, equal_nan=True) for other in best):
            best.append(assigned)
    return best[0] if len(best) == 1 else None


def _guesses(points: np.ndarray, shape: MarkerShape, near: float) -> Iterator[np.ndarray]:
    """(B, 3) three markers put on three points of the same distances, the others NaN; every way to do it."""
    seen = np.linalg.norm(points[:, None] - points[None], axis=2)
    for i, j, k in combinations(range(len(shape)), 3):
        ab, bc, ac = (np.linalg.norm(shape[p] - shape[q]) for p, q in ((i, j), (j, k), (i, k)))
        alike = (
            (np.abs(seen - ab) < near)[:, :, None]
            & (np.abs(seen - bc) < near)[None]
            & (np.abs(seen - ac) < near)[:, None]
        )
        for a, b, c in np.argwhere(alike):
            guess = np.full_like(shape, np.nan)
            guess[[i, j, k]] = points[[a, b, c]]
            yield guess
