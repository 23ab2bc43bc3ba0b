"""A clock that jumps while the markers continue: only the longest part between its jumps is used."""

import itertools
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Campaign, Robot, Window
from fidim_lab.identification.cleaning.removed import CleanRecordings, Removed

GAP = 1.5
"""steps between two time stamps that are more than jitter"""
BESIDE = 6
"""samples on each side of a gap through which a quartic is laid"""
STEADY = 4.0
"""times the noise's variance that a quartic may miss them by if the clock jumped"""
STAMPED = 4.0
"""times worse must the time stamps as they are fit"""
WHY = "the clock jumps"


def without_clock_jumps(campaign: Campaign) -> CleanRecordings:
    """Each window's longest part between jumps of its clock."""
    windows: list[Window] = []
    notes: list[str] = []
    removed: list[Removed] = []
    for window in campaign.windows:
        kept, said = _cut_at_jumps(window, campaign.robot)
        windows.append(kept)
        notes += said
        removed += _lost(window, kept)
    if not notes:
        return CleanRecordings(campaign)
    return CleanRecordings(replace(campaign, windows=tuple(windows)), tuple(removed), tuple(notes))


def _lost(window: Window, kept: Window) -> list[Removed]:
    """What lies before and after the part that is kept."""
    before, after = window.t < kept.t[0], window.t > kept.t[-1]
    return [
        Removed(
            window.id,
            (float(window.t[use][0]), float(window.t[use][-1])),
            WHY,
            int(np.isfinite(window.markers[use]).all(axis=2).sum()),
        )
        for use in (before, after)
        if use.any()
    ]


def _cut_at_jumps(window: Window, robot: Robot) -> tuple[Window, list[str]]:
    """The longest part between jumps of the clock."""
    rows = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))  # importers write blank rows into a gap
    seen = window.of_rows(rows)
    jumps = [k for k in _gaps(seen) if _clock_jumped(seen, k, robot.sensors.marker_noise)]
    if not jumps:
        return window, []
    first, last = max(itertools.pairwise([0, *(k + 1 for k in jumps), len(rows)]), key=lambda part: part[1] - part[0])
    begin, end = int(rows[first]), int(rows[last - 1]) + 1
    at = jumps[0]
    said = (
        f"Window {window.id}: the time stamps jump by {seen.t[at + 1] - seen.t[at]:.3f} s at "
        f"{seen.t[at]:.2f} s, but the markers do not: the clock is wrong there"
        + (f" (and {len(jumps) - 1} times more)" if len(jumps) > 1 else "")
        + f". Only {window.t[begin]:.2f} to {window.t[end - 1]:.2f} s are used."
    )
    return window.of_rows(slice(begin, end)), [said]


def _gaps(window: Window) -> np.ndarray:
    """Rows after which more than a step of time is missing."""
    steps = np.diff(window.t)
    return np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.empty(0, dtype=int)


def _clock_jumped(window: Window, k: int, noise: float) -> bool:
    """Whether the samples after row k go on as if one step had passed, and not the time that the stamps say.

    A quartic through six samples on each side fits a steady clock, or the stamps as they are.
    """
    begin, end = k + 1 - BESIDE, k + 1 + BESIDE
    if begin < BESIDE or end > len(window.t):
        return False
    steps = window.t / float(np.median(np.diff(window.t)))
    gap = steps[k + 1] - steps[k]
    beside = np.diff(steps[begin - BESIDE : end])
    if (beside > GAP).sum() > 1:
        return False
    markers = window.markers.reshape(len(window.t), -1)
    whole = np.isfinite(markers[begin - BESIDE : end]).all(axis=0)
    if not whole.any():
        return False
    after = steps[begin:end] - np.where(np.arange(begin, end) > k, gap - 1.0, 0.0)
    usual = max(noise**2, quartic_misfit(steps[begin - BESIDE : k + 1], markers[begin - BESIDE : k + 1, whole]))
    steady = quartic_misfit(after, markers[begin:end, whole])
    stamped = quartic_misfit(steps[begin:end], markers[begin:end, whole])
    # Over a long gap a quartic fits anything; that the motion goes on exactly where it was is then the evidence, if it
    # is in motion there.
    speed = np.abs(np.polyfit(after, markers[begin:end, whole], 1)[0]).max()
    moves = gap > BESIDE and 2 * BESIDE * speed > STEADY * np.sqrt(usual)
    return steady < STEADY * usual and bool(moves or stamped > STAMPED * max(steady, usual))


def quartic_misfit(steps: np.ndarray, values: np.ndarray) -> float:
    """Variance that a quartic leaves of some coordinates (N, K), m²."""
    X = np.vander(steps - steps.mean(), 5)
    left = values - X @ np.linalg.lstsq(X, values, rcond=None)[0]
    return float((left**2).sum() / (left.shape[1] * (len(steps) - 5)))
