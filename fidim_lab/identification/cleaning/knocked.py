"""Markers that are not where the robot file has them: knocked aside in some windows, or never there.

Distances between markers hold no dynamics. A marker whose distances to all others are off in a window, while the others
keep theirs, is not where it was: it is missing there, and the others do. With two markers nothing says which it was.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Robot, Window
from fidim_lab.identification.cleaning.removed import CleanRecordings, Removed, without_samples

MOVED = 4.0
"""times as far off as the distances among all others"""
LEAST = 5e-4
"""m: what a good calibration of cameras lets distances change across a room; less is not told from it"""
FEWEST = 3
"""markers, without which nothing says which of them it was"""
SAMPLES = 20
WHY = "marker not at its place on the body"


def without_knocked_markers(campaign: Campaign) -> CleanRecordings:
    """Each marker that is not at its place in a window is missing in that window."""
    windows: list[Window] = []
    removed: list[Removed] = []
    told: dict[int, tuple[float, list[str]]] = {}
    for window in campaign.windows:
        found = _displaced(campaign.robot, window)
        if found is not None:
            marker, by = found
            bad = np.zeros(window.markers.shape[:2], dtype=bool)
            bad[:, marker] = np.isfinite(window.markers[:, marker]).all(axis=1)
            window, out = without_samples(window, bad, WHY)
            removed += out
            size, ids = told.get(marker, (0.0, []))
            told[marker] = (max(size, by), [*ids, window.id])
        windows.append(window)
    if not removed:
        return CleanRecordings(campaign)
    notes = tuple(
        f"Marker {marker + 1} is not where the robot file has it in {', '.join(ids)}: its distances to the others are "
        f"off by up to {1e3 * size:.1f} mm, theirs are not. It is left out there."
        for marker, (size, ids) in sorted(told.items())
    )
    return CleanRecordings(replace(campaign, windows=tuple(windows)), tuple(removed), notes)


def _displaced(robot: Robot, window: Window) -> tuple[int, float] | None:
    """The marker (0-based) and the largest error of its distances, m."""
    off = _distances_off(robot, window)
    count = len(off)
    if count < FEWEST:
        return None
    own = np.array([np.sqrt(np.nanmean(np.delete(off[m], m) ** 2)) for m in range(count)])
    others = np.array([_rms_without(off, m) for m in range(count)])
    marker = int(np.nanargmax(own / np.maximum(others, LEAST)))
    if not own[marker] > MOVED * max(float(others[marker]), LEAST):
        return None
    return marker, float(np.nanmax(np.abs(off[marker])))


def _rms_without(off: Float[np.ndarray, "M M"], marker: int) -> float:
    """Of the distances among the other markers, m."""
    rest = np.delete(np.delete(off, marker, axis=0), marker, axis=1)
    known = rest[np.triu_indices(len(rest), 1)]
    return float(np.sqrt(np.nanmean(known**2))) if np.isfinite(known).any() else np.inf


def _distances_off(robot: Robot, window: Window) -> Float[np.ndarray, "M M"]:
    """Median distances between this window's markers less the robot file's, m; NaN where not seen together."""
    seen = np.asarray(np.isfinite(window.markers).all(axis=2))
    use = np.flatnonzero(seen.sum(axis=0) >= SAMPLES)
    off = np.full((window.markers.shape[1],) * 2, np.nan)
    for one, other in combinations(use, 2):
        both = seen[:, one] & seen[:, other]
        if both.sum() < SAMPLES:
            continue
        apart = np.linalg.norm(window.markers[both, one] - window.markers[both, other], axis=1)
        file = np.linalg.norm(robot.markers[one] - robot.markers[other])
        off[one, other] = off[other, one] = float(np.median(apart)) - float(file)
    whole = np.isfinite(off).sum(axis=1) >= FEWEST - 1
    return off[np.ix_(whole, whole)] if whole.all() else np.zeros((0, 0))
