"""Mistakes in a campaign, reported before anything is computed from it, whatever the method.

`check` refuses what cannot be identified from (markers in millimetres, no motion at all) and says what weakens the
answer (one equilibrium only). What is cut out of recordings comes after it (`cleaning.clean`).
"""

from collections.abc import Sequence

import numpy as np

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.errors import RefusedError

FARTHEST = 20.0
"""times the robot's own size that markers may be away from its middle"""
MILLIMETRES = 1000.0
STILL = 3.0
"""times the marker noise: a motion no larger says nothing"""
ONE_PLACE = 0.01
"""m: equilibria no farther apart are one"""


def check(campaign: Campaign) -> tuple[str, ...]:
    """The messages.

    Raises RefusedError where every `identify` window has its markers in a wrong unit, or none moves.
    """
    fitted = campaign.of_role(Role.IDENTIFY)
    notes = _units(campaign, fitted)
    _refuse_stillness(campaign, fitted)
    notes += [
        f"Window {w.id}: the markers do not move beyond their noise, so it does not show the inertia."
        for w in fitted
        if not _moves(w, campaign.robot)
    ]
    notes += _one_equilibrium(fitted, campaign.robot.markers)
    notes += _covered(fitted)
    return tuple(notes)


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


def _covered(fitted: Sequence[Window]) -> list[str]:
    """Markers that no window shows, where others are seen."""
    most = min((w.markers.shape[1] for w in fitted), default=0)
    seen = [any(np.isfinite(w.markers[:, m]).any() for w in fitted) for m in range(most)]
    unseen = [m + 1 for m in range(most) if any(seen) and not seen[m]]
    return [f"Marker {m} is seen in none of {len(fitted)} windows; the others show the motion." for m in unseen]


def _one_equilibrium(fitted: Sequence[Window], on_body: np.ndarray) -> list[str]:
    """With every window at one place, an error of the geometry there is the same in all of them."""
    if len(fitted) < 2:
        return []
    if all(w.lengths is not None and np.isfinite(w.lengths).any(axis=0).all() for w in fitted):
        places = np.array([np.nanmean(w.lengths, axis=0) for w in fitted if w.lengths is not None])
        what = "cable lengths"
    else:
        middles = [middle for w in fitted if (middle := w.middle(on_body)) is not None]
        if len(middles) < len(fitted):
            return []
        places, what = np.array(middles), "mean marker positions"
    apart = float((places.max(axis=0) - places.min(axis=0)).max())
    if apart > ONE_PLACE:
        return []
    return [
        f"All {len(fitted)} windows hang at one equilibrium ({what} within {apart * 1e3:.1f} mm, {fitted[0].id} to "
        f"{fitted[-1].id}): an error of lengths or geometry there is the same in all, and neither spread nor held-out "
        "windows show it. Record at other lengths too."
    ]
