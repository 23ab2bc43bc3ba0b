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


def moved_in(campaign: Campaign, name: str) -> str:
    """The marker that is elsewhere on the body in one window than in most, as a sentence; empty where there is none.

    For a window whose motion contradicts the others': what is too little to be told from a calibration of cameras by
    itself, is then the likely cause if it is more than noise.
    """
    tables = {window.id: _distances(window) for window in campaign.windows}
    shape = tables[name].shape
    usual = [table for id, table in tables.items() if id != name and table.shape == shape]
    if not usual or not shape[0]:
        return ""
    found = _stands_out(tables[name] - np.median(usual, axis=0), campaign.robot.sensors.marker_noise / MOVED)
    if found is None:
        return ""
    marker, by = found
    return (
        f" Marker {marker + 1} was elsewhere on the body there: its distances to the others differ by up to "
        f"{1e3 * by:.1f} mm from those in most windows, theirs do not. Blank it there, and identify again."
    )


def _displaced(robot: Robot, window: Window) -> tuple[int, float] | None:
    """The marker (0-based) and the largest error of its distances, m."""
    found = _distances(window)
    body = robot.markers[: len(found)]
    return _stands_out(found - np.linalg.norm(body[:, np.newaxis] - body, axis=2), LEAST)


def _stands_out(off: Float[np.ndarray, "M M"], least: float) -> tuple[int, float] | None:
    """The marker (0-based) whose distances are off, the others' not, and the largest of these errors, m.

    least: m, by which distances may be off where nothing moved.
    """
    count = len(off)
    if count < FEWEST:
        return None
    own = np.array([np.sqrt(np.nanmean(np.delete(off[m], m) ** 2)) for m in range(count)])
    others = np.array([_rms_without(off, m) for m in range(count)])
    marker = int(np.nanargmax(own / np.maximum(others, least)))
    if not own[marker] > MOVED * max(float(others[marker]), least):
        return None
    return marker, float(np.nanmax(np.abs(off[marker])))


def _rms_without(off: Float[np.ndarray, "M M"], marker: int) -> float:
    """Of the distances among the other markers, m."""
    rest = np.delete(np.delete(off, marker, axis=0), marker, axis=1)
    known = rest[np.triu_indices(len(rest), 1)]
    return float(np.sqrt(np.nanmean(known**2))) if np.isfinite(known).any() else np.inf


def _distances(window: Window) -> Float[np.ndarray, "M M"]:
    """Median distances between its markers, m; NaN where not seen together; empty where one is hardly seen with any."""
    count = window.markers.shape[1]
    seen = np.asarray(np.isfinite(window.markers).all(axis=2))
    use = np.flatnonzero(seen.sum(axis=0) >= SAMPLES)
    found = np.full((count, count), np.nan)
    for one, other in combinations(use, 2):
        both = seen[:, one] & seen[:, other]
        if both.sum() < SAMPLES:
            continue
        apart = np.linalg.norm(window.markers[both, one] - window.markers[both, other], axis=1)
        found[one, other] = found[other, one] = float(np.median(apart))
    whole = np.isfinite(found).sum(axis=1) >= FEWEST - 1
    return found if whole.all() else np.zeros((0, 0))
