"""Each channel by itself: whether what the model leaves of it is white, and whether it depends on the windows' order.

    markers    recorded less predicted
    lengths    within a window the readings less their mean, for held winches do not turn; from window to window their
               means less the lengths that the fitted motion has
    currents   what a + b τ leaves, τ being the tensions of the fitted motion: within a window with its own a and b,
               from window to window with those that each motor has in all
    swivels    encoders of the pulleys' swivels less the angles of the fitted motion, with a zero and a delay: within
               a window its own, from window to window one zero

A drift, a jump or another session shows in the order of the windows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import betainc

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.residuals.currents import CurrentCourse, courses
from fidim_lab.mismatch.residuals.residual import Leftover, of_remainders
from fidim_lab.mismatch.residuals.swivels import swivels
from fidim_lab.mismatch.residuals.thresholds import RESIDUALS
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED

OF_ANOTHER_CLOCK = ("currents", "swivels")
"""channels that were interpolated to the markers' times"""


@dataclass(frozen=True)
class Channel:
    """What one channel shows beside the model."""

    channel: str
    white: bool
    p: float
    """chance of as unusual a band or line in white noise"""
    trend_over_windows: float | None
    """chance of as strong a drift or step (`trend`); None with fewer than four windows"""


def channels(found: Fit) -> tuple[Channel, ...]:
    """Of the windows that were fitted; those that were not recorded are not listed."""
    measured = {
        "markers": _markers(found),
        "lengths": _lengths(found),
        "currents": _currents(found),
        "swivels": _swivels(found),
    }
    return tuple(_tested(name, *one) for name, one in measured.items() if one is not None)


def trend(values: Float[np.ndarray, "W K"]) -> float | None:
    """Chance of as strong a drift, or step between two windows, in one of K columns were they independent and normal.

    Their spread is unknown: R² of W - 2 degrees of freedom, times the number of courses and columns (Bonferroni). None
    with fewer than four windows.
    """
    count = len(values)
    if count <= SHARED.fewest:
        return None
    centred = values - values.mean(axis=0)
    size = np.linalg.norm(centred, axis=0)
    told = size > 0
    if not told.any():
        return 1.0
    shapes = np.vstack([np.arange(count), np.arange(count) >= np.arange(1, count)[:, np.newaxis]]).astype(float)
    shapes -= shapes.mean(axis=1, keepdims=True)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    of_each = np.square(shapes @ (centred[:, told] / size[told]))
    return min(1.0, of_each.size * float(betainc((count - 2) / 2, 0.5, max(0.0, 1.0 - of_each.max()))))


def _tested(name: str, leftovers: Sequence[Leftover], means: Float[np.ndarray, "W K"]) -> Channel:
    found = whiteness(leftovers, coloured=RESIDUALS.whiteness_interpolated if name in OF_ANOTHER_CLOCK else 1.0)
    return Channel(name, found.is_white, found.p_value, trend(means))


_Measured = tuple[list[Leftover], Float[np.ndarray, "W K"]]


def _markers(found: Fit) -> _Measured:
    left = [*of_remainders(found)]
    return left, np.array([np.nanmean(one.values, axis=(0, 1)) for one in left])


def _lengths(found: Fit) -> _Measured | None:
    likelihood, simulation = found.likelihood, found.journey.optimum.simulation
    left: list[Leftover] = []
    means = np.full((len(likelihood.recordings), likelihood.mechanism.n), np.nan)
    for w, recording in enumerate(likelihood.recordings):
        window, known = recording.window, np.isfinite(recording.lengths)
        if window.lengths is None or not known.any():
            continue
        means[w, known] = simulation.residuals[w].lengths
        t = window.t - window.t[0] - recording.begin
        rows = (t >= 0) & (t <= float(simulation.ends[w]))
        read = window.lengths[rows][:, known] / likelihood.resolution
        off = read - np.nanmean(read, axis=0)
        beyond = np.sign(off) * np.maximum(np.abs(off) - 1.0, 0.0)  # a count more or less says nothing
        left.append(_leftover(window.id, window.t[rows], beyond))
    return (left, means[:, np.isfinite(means).all(axis=0)]) if left else None


def _currents(found: Fit) -> _Measured | None:
    likelihood = found.likelihood
    windows = [recording.window for recording in likelihood.recordings]
    all_courses = [courses(found, w) for w in range(len(windows))]
    left: list[Leftover] = []
    for window, ours in zip(windows, all_courses, strict=True):
        values = np.full((len(window.t), likelihood.mechanism.n), np.nan)
        for one in ours:
            values[one.rows, one.cable] = _by_scatter(_rest(one.current, one.tension(one.t)))
        if ours:
            left.append(_leftover(window.id, window.t, values[:, [one.cable for one in ours]]))
    columns = [column for k in range(likelihood.mechanism.n) if (column := _by_window(all_courses, k)) is not None]
    return (left, np.array(columns).T.reshape(len(windows), -1)) if left else None


def _leftover(window: str, t: np.ndarray, values: Float[np.ndarray, "T n"]) -> Leftover:
    return Leftover(window, t, values[:, :, np.newaxis], noise=1.0, own=0)


def _rest(values: Float[np.ndarray, " T"], of: Float[np.ndarray, " T *K"]) -> Float[np.ndarray, " T"]:
    """What a + b `of` leaves, with a b of each column."""
    columns = np.column_stack([np.ones(len(of)), of])
    return values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]


def _by_scatter(rest: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """Over its own standard deviation: the noise of this channel is not stated."""
    return rest / max(float(rest.std()), np.finfo(float).tiny)


def _by_window(all_courses: Sequence[Sequence[CurrentCourse]], cable: int) -> Float[np.ndarray, " W"] | None:
    """Means of what is left with one a and b in all windows, A; None where a window has no such current."""
    ours = [one for window in all_courses for one in window if one.cable == cable]
    if len(ours) < len(all_courses):
        return None
    rest = _rest(np.concatenate([one.current for one in ours]), np.concatenate([one.tension(one.t) for one in ours]))
    ends = np.cumsum([len(one.t) for one in ours])
    return np.array([part.mean() for part in np.split(rest, ends[:-1])])


def _swivels(found: Fit) -> _Measured | None:
    n = found.likelihood.mechanism.n
    shown = swivels(found)
    left: list[Leftover] = []
    for one in shown:
        window = one.window
        values = np.full((len(window.t), n), np.nan)
        for k in range(n):
            seen = np.isfinite(one.off[:, k])
            if seen.sum() >= SHARED.samples:
                late = np.column_stack([one.rates[seen, k], one.curves[seen, k]])
                values[one.rows[seen], k] = _by_scatter(_rest(one.off[seen, k], late))
        left.append(_leftover(window.id, window.t, values))
    means = np.array([np.nanmean(one.off, axis=0) for one in shown]).reshape(-1, n)
    return (left, means[:, np.isfinite(means).all(axis=0)]) if left else None
