"""What is wrong with a campaign before anything is computed from it, in words, whatever the method.

`check` refuses what cannot be identified from (markers in millimetres, no motion at all), cleans as `explain` does
(`cleaning.clean`), cuts a window at a jump of its clock, and says what weakens the answer (one equilibrium only).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.clean import clean_recordings
from fidim_lab.identification.cleaning.removed import Removed

FARTHEST = 20.0
"""times the robot's own size that markers may be away from its middle"""
MILLIMETRES = 1000.0
STILL = 3.0
"""times the marker noise: a motion no larger says nothing"""
GAP = 1.5
"""steps between two time stamps that are more than jitter"""
BESIDE = 6
"""samples on each side of a gap through which a quartic is laid"""
STEADY = 4.0
"""times the noise's variance that a quartic may miss them by if the clock jumped"""
STAMPED = 4.0
"""times worse must the time stamps as they are fit"""
ONE_PLACE = 0.01
"""m: equilibria no farther apart are one"""


@dataclass(frozen=True, eq=False)
class Checked:
    """A campaign that may be identified from."""

    campaign: Campaign
    removed: tuple[Removed, ...]
    notes: tuple[str, ...]


def check(campaign: Campaign) -> Checked:
    """The campaign without what is no free motion and what a jumping clock spoils, and what is to be said.

    Raises RefusedError where every `identify` window has its markers in a wrong unit, or none moves.
    """
    fitted = campaign.of_role(Role.IDENTIFY)
    notes = _units(campaign, fitted)
    _refuse_stillness(campaign, fitted)
    cleaned = clean_recordings(campaign).recordings
    campaign = cleaned.campaign
    fitted = campaign.of_role(Role.IDENTIFY)
    notes += cleaned.notes
    windows: list[Window] = []
    for window in campaign.windows:
        kept, said = _cut_at_jumps(window, campaign.robot)
        windows.append(kept)
        notes += said
    notes += [
        f"Window {w.id}: the markers do not move beyond their noise, so it says nothing of the inertia."
        for w in fitted
        if not _moves(w, campaign.robot)
    ]
    notes += _one_equilibrium(fitted)
    return Checked(replace(campaign, windows=tuple(windows)), cleaned.removed, tuple(notes))


def _units(campaign: Campaign, fitted: Sequence[Window]) -> list[str]:
    anchors = np.array([cable.d for cable in campaign.robot.cables])
    middle = anchors.mean(axis=0)
    size = max(1.0, float(np.linalg.norm(anchors - middle, axis=1).max()))

    def away(window: Window, unit: float) -> float:
        places = window.markers[np.isfinite(window.markers).all(axis=2)] * unit
        return float(np.median(np.linalg.norm(places - middle, axis=1))) if len(places) else 0.0

    far = [w for w in campaign.windows if away(w, 1.0) > FARTHEST * size]
    if not far:
        return []
    millimetres = all(away(w, 1 / MILLIMETRES) < FARTHEST * size for w in far)
    verdict = "the markers are in millimetres" if millimetres else "units or frame of the markers are wrong"
    ids = ", ".join(w.id for w in far)
    named, first = f"Window{'s' * (len(far) > 1)} {ids}", far[0]
    sentence = (
        f"{named}: {verdict} (at {first.t[0]:.2f} s of {first.id} they are {away(first, 1.0):.4g} m away from the "
        f"middle of the anchors; the robot is {size:.2g} m large)."
    )
    if fitted and all(w in far for w in fitted):
        raise RefusedError(sentence, hint="Write x, y, z and m2x … in metres.")
    return [sentence]


def _amplitude(window: Window) -> float:
    """rms motion of the marker coordinate that moves most, m."""
    spread = [
        float(np.std(column[np.isfinite(column)]))
        for column in window.markers.reshape(len(window.t), -1).T
        if np.isfinite(column).sum() > 1
    ]
    return max(spread, default=0.0)


def _moves(window: Window, robot: Robot) -> bool:
    return _amplitude(window) > STILL * robot.sensors.marker_noise


def _refuse_stillness(campaign: Campaign, fitted: Sequence[Window]) -> None:
    seen = [w for w in fitted if np.isfinite(w.markers).any()]
    if not seen or any(_moves(w, campaign.robot) for w in seen):
        return
    largest = max(seen, key=_amplitude)
    raise RefusedError(
        f"No window moves: the largest motion is {_amplitude(largest) * 1e3:.2g} mm rms ({largest.id}, "
        f"{largest.t[0]:.2f} to {largest.t[-1]:.2f} s), the marker noise "
        f"{campaign.robot.sensors.marker_noise * 1e3:.2g} mm; a platform at rest does not show its inertia.",
        hint="Let the platform go from a displacement of some centimetres.",
    )


def _cut_at_jumps(window: Window, robot: Robot) -> tuple[Window, list[str]]:
    """The longest part between jumps of the clock."""
    jumps = [k for k in _gaps(window) if _clock_jumped(window, k, robot.sensors.marker_noise)]
    if not jumps:
        return window, []
    edges = [0, *(k + 1 for k in jumps), len(window.t)]
    begin, end = max(itertools.pairwise(edges), key=lambda part: part[1] - part[0])
    first = jumps[0]
    said = (
        f"Window {window.id}: the time stamps jump by {window.t[first + 1] - window.t[first]:.3f} s at "
        f"{window.t[first]:.2f} s, but the markers do not: the clock is wrong there"
        + (f" (and {len(jumps) - 1} times more)" if len(jumps) > 1 else "")
        + f". Only {window.t[begin]:.2f} to {window.t[end - 1]:.2f} s are used."
    )
    return _part(window, slice(begin, end)), [said]


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
    usual = max(noise**2, _misfit(steps[begin - BESIDE : k + 1], markers[begin - BESIDE : k + 1, whole]))
    steady = _misfit(after, markers[begin:end, whole])
    stamped = _misfit(steps[begin:end], markers[begin:end, whole])
    # Over a long gap a quartic fits anything; that the motion goes on exactly where it was is then the evidence.
    return steady < STEADY * usual and (gap > BESIDE or stamped > STAMPED * max(steady, usual))


def _misfit(steps: np.ndarray, values: np.ndarray) -> float:
    """Variance that a quartic leaves of some coordinates (N, K), m²."""
    X = np.vander(steps - steps.mean(), 5)
    left = values - X @ np.linalg.lstsq(X, values, rcond=None)[0]
    return float((left**2).sum() / (left.shape[1] * (len(steps) - 5)))


def _part(window: Window, rows: slice) -> Window:
    return replace(
        window,
        t=window.t[rows],
        markers=window.markers[rows],
        lengths=None if window.lengths is None else window.lengths[rows],
        currents=None if window.currents is None else window.currents[rows],
        further={name: values[rows] for name, values in window.further.items()},
    )


def _one_equilibrium(fitted: Sequence[Window]) -> list[str]:
    """With every window at one place, an error of the geometry there is the same in all of them."""
    if len(fitted) < 2:
        return []
    if all(w.lengths is not None and np.isfinite(w.lengths).any(axis=0).all() for w in fitted):
        places = np.array([np.nanmean(w.lengths, axis=0) for w in fitted if w.lengths is not None])
        what = "cable lengths"
    elif all(np.isfinite(w.markers[:, 0]).any() for w in fitted):
        places, what = np.array([np.nanmean(w.markers[:, 0], axis=0) for w in fitted]), "mean marker positions"
    else:
        return []
    apart = float((places.max(axis=0) - places.min(axis=0)).max())
    if apart > ONE_PLACE:
        return []
    return [
        f"All {len(fitted)} windows hang at one equilibrium ({what} within {apart * 1e3:.1f} mm, {fitted[0].id} to "
        f"{fitted[-1].id}): an error of lengths or geometry there is the same in all, and neither spread nor held-out "
        "windows show it. Record at other lengths too."
    ]
