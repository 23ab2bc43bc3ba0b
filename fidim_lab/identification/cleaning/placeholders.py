"""Numbers in place of a blank: (0, 0, 0), or any repeated value far away from the motion.

Motion capture writes such a value where it sees no marker. A place counts as one where it is the origin or is met to
the last digit more than once, and where the marker is too far away from it just before and just after.
"""

from collections import Counter

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import runs
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.removed import CleanRecordings, without_each

FAR = 20.0
"""times the median step from sample to sample that a marker jumps to such a value: no swing is so much quicker than
its own median speed. How the answer depends on it has not been measured"""
WHY = "placeholder for a blank"


def without_placeholders(campaign: Campaign) -> CleanRecordings:
    """Placeholders become missing samples."""
    recurring = _recurring(campaign.windows)
    says = "hold (0, 0, 0) or another constant where the marker cannot be"
    return without_each(campaign, lambda window: _placeholders(window, recurring), WHY, says)


def _recurring(windows: tuple[Window, ...]) -> set[tuple[float, ...]]:
    """Places that are met twice or more to the last digit by any marker, and the origin."""
    met: Counter[tuple[float, ...]] = Counter()
    for window in windows:
        places = window.markers.reshape(-1, 3)
        met.update(map(tuple, places[np.isfinite(places).all(axis=1)].tolist()))
    return {place for place, times in met.items() if times > 1} | {(0.0, 0.0, 0.0)}


def _placeholders(window: Window, recurring: set[tuple[float, ...]]) -> Bool[np.ndarray, "N M"]:
    bad = np.zeros(window.markers.shape[:2], dtype=bool)
    for m in range(window.markers.shape[1]):
        track = window.markers[:, m]
        suspect = np.array([place in recurring for place in map(tuple, track.tolist())], dtype=bool)
        if not suspect.any():
            continue
        usual = _median_step(track, suspect)
        known = np.flatnonzero(np.isfinite(track).all(axis=1) & ~suspect)
        for begin, end in runs(suspect):
            bad[begin:end, m] = _away(track, begin, end, known, usual)
    return bad


def _median_step(track: Float[np.ndarray, "N 3"], suspect: Bool[np.ndarray, " N"]) -> float:
    steps = np.linalg.norm(np.diff(np.where(suspect[:, np.newaxis], np.nan, track), axis=0), axis=1)
    steps = steps[np.isfinite(steps)]
    return float(np.median(steps)) if len(steps) else 0.0


def _away(track: np.ndarray, begin: int, end: int, known: np.ndarray, usual: float) -> bool:
    """Whether the marker jumps to rows begin … end − 1 and back; a marker that is nowhere else is not seen at all."""
    before, after = known[known < begin], known[known >= end]
    if not len(known):
        return bool((track[begin] == 0.0).all())
    jumps = [np.linalg.norm(track[begin] - track[before[-1]]) / (begin - before[-1])] if len(before) else []
    jumps += [np.linalg.norm(track[end - 1] - track[after[0]]) / (after[0] - end + 1)] if len(after) else []
    return bool(min(jumps) > FAR * usual)
