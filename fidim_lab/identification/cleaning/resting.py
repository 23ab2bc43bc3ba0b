"""Where a hand holds the platform still away from its rest, before the release or later.

No pose is needed, nor cables: only markers that stay within their noise while the swing beside would have moved them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import Series, runs
from fidim_lab.data.records import Window

FEWEST = 8
"""samples, by whose scatter rest is told from motion"""
CLEAR = 5.0
"""times the marker noise that a coordinate is away from its middle before it counts as beyond it"""


@dataclass(frozen=True)
class RestRule:
    """What counts as not moving."""

    rests: float = 0.5
    """s without motion, which no swing of 1 Hz has; a slower one turns round so"""
    turned: float = 10.0
    """times the marker noise that the swing beside it would have moved meanwhile: turning round moves up to 6 unseen"""
    nothing: float = 1.5
    """times the marker noise (rms), up to which a coordinate does not move"""
    loud: float = 20.0
    """times the marker noise that the whole window moves (rms): less may come to rest by itself"""


RULE = RestRule()


def resting(window: Window, noise: float, rule: RestRule = RULE) -> list[tuple[float, float]]:
    """Begins and ends of what does not move (s) in a window that moves; noise: of a marker coordinate, m."""
    tracks = window.markers.reshape(len(window.t), -1)
    tracks = tracks[:, np.isfinite(tracks).mean(axis=0) > 0.5]
    if not tracks.shape[1] or np.nanstd(tracks, axis=0).max() < rule.loud * noise:
        return []
    still = _unmoved(window.t, tracks, rule.rests, rule.nothing * noise)
    last, half = len(window.t), _half_period(window.t, tracks, noise)
    return [
        (-np.inf if a == 0 else float(window.t[a]), np.inf if b >= last - 1 else float(window.t[b - 1]))
        for a, b in runs(still)
        if _would_move(window.t, tracks, (a, b), half) > rule.turned * noise
    ]


def _unmoved(t: Series, tracks: Float[np.ndarray, "N K"], seconds: float, most: float) -> Bool[np.ndarray, " N"]:
    """Samples within a stretch of so many seconds in which no coordinate scatters by `most` (m, standard deviation)."""
    seen = np.asarray(np.isfinite(tracks).all(axis=1))
    away = np.where(seen[:, np.newaxis], tracks - np.nanmean(tracks, axis=0), 0.0)
    begins, ends = np.arange(len(t)), np.searchsorted(t, t + seconds)
    count, total, squares = (
        (summed := np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)]))[ends] - summed[begins]
        for values in (seen[:, np.newaxis].astype(float), away, away**2)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        scatter = np.sqrt(np.maximum(squares / count - (total / count) ** 2, 0.0)).max(axis=1)
    quiet = (ends < len(t)) & (count[:, 0] > FEWEST) & (scatter < most)
    steps = np.zeros(len(t) + 1)
    np.add.at(steps, begins[quiet], 1.0)
    np.add.at(steps, ends[quiet], -1.0)
    return np.asarray(np.cumsum(steps[:-1]) > 0.5)


def _half_period(t: Series, tracks: Float[np.ndarray, "N K"], noise: float) -> float:
    """s between passages of the coordinate that moves most through its middle, the median of them."""
    track = tracks[:, int(np.argmax(np.nanstd(tracks, axis=0)))]
    away = track - np.nanmean(track)
    clear = np.flatnonzero(np.abs(np.nan_to_num(away)) > CLEAR * noise)
    passed = t[clear[1:]][np.diff(np.sign(away[clear])) != 0]
    return float(np.median(np.diff([t[0], *passed, t[-1]])))


def _would_move(t: Series, tracks: Float[np.ndarray, "N K"], rest: tuple[int, int], half: float) -> float:
    """How far (m) the swing before and after would have gone meanwhile, had it only turned round there."""
    begin, end = t[rest[0]], t[rest[1] - 1]
    beside = (t > begin - 2 * half) & (t < end + 2 * half)
    at = np.nanmedian(tracks[rest[0] : rest[1]], axis=0)
    swing = 0.5 * float(np.nanmax(np.abs(tracks[beside] - at)))
    return swing * (1.0 - np.cos(np.pi * min(0.5 * (end - begin) / half, 1.0)))
