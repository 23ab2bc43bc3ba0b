"""When a hand comes and goes: where free motion, extrapolated from both sides, leaves the recording."""

from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.mismatch.cleaning.segments import Segmented, Segments, part
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.held_body import followed


def hand_times(segments: Segments, one: Segmented, first: int, end: int, ratio: float) -> tuple[float, float]:
    """Begin and end of a hand in the segments from `first` to `end` of a window, s on the window's own clock.

    ratio: χ²/dof there over that of the free parts.
    """
    window, edges = one.window, one.edges
    begin, finish = float(edges[first]), float(edges[end])
    above = float(np.clip(np.sqrt(ratio) / CLEANING.risen, *CLEANING.departed))
    if first > 0:
        since = float(edges[max(0, first - CLEANING.hand_times_known)])
        use = (window.t >= since) & (window.t <= finish)
        forward = _departure(segments, part(window, use, window.id), begin - since, above)
        begin = begin if forward is None else since + forward
    if end < len(edges) - 1:
        finish = _free_again(segments, one, first, end, above)
    if begin >= finish:
        # so weak that it shows only after it has ended: nothing more is known than the segments
        begin, finish = float(edges[first]) + CLEANING.timed, float(edges[end]) - CLEANING.timed
    begin, finish = (
        max(float(window.t[0]), begin - CLEANING.timed),
        min(float(window.t[-1]), finish + CLEANING.timed),
    )
    return begin, finish


def _free_again(segments: Segments, one: Segmented, first: int, end: int, above: float) -> float:
    """When motion is free again after the segments from `first` to `end`, s on the window's own clock."""
    window, last, finish = (
        one.window,
        float(one.edges[min(len(one.edges) - 1, end + CLEANING.hand_times_known)]),
        float(one.edges[end]),
    )
    if not segments.fit.likelihood.mechanism.effects:
        use = (window.t >= one.edges[first]) & (window.t < last)
        whole, until = part(window, use, window.id), float(window.t[use][-1])
        turned = None if whole is None else replace(whole, t=until - whole.t[::-1], markers=whole.markers[::-1])
        backward = _departure(segments, turned, until - finish, above)
        return finish if backward is None else until - backward
    # what dissipates cannot be followed backwards: the earliest time from which on it is followed forwards
    held, free = float(one.edges[first]), finish
    while free - held > CLEANING.timed:
        middle = (held + free) / 2
        whole = part(window, (window.t >= middle) & (window.t < last), window.id)
        found = None if whole is None else followed(segments.fit, whole, last - middle)
        follows = found is not None and found[0].chi2_per_dof < above**2
        held, free = (held, middle) if follows else (middle, free)
    return free


def _departure(segments: Segments, window: Window | None, free: float, above: float) -> float | None:
    """When (s since its first row) a motion that is free for so many seconds leaves the recording; None if unknown.

    above: rms residual, in what it usually is, beyond which it has.
    What is fitted ends before that: where the segments change a soft push may have begun already.
    """
    found = None if window is None else followed(segments.fit, window, max(free - CLEANING.beside, free / 2))
    return None if found is None else _first_large(*found, free, above)


def _first_large(left: Remainder, noise: float, free: float, above: float) -> float:
    """From where the residual is large, s since the first row; never long before the end of the part that is free."""
    squares = (left.residuals / noise) ** 2
    numbers = np.isfinite(squares).sum(axis=(1, 2))
    squares = np.nan_to_num(np.nansum(squares, axis=(1, 2)) / np.maximum(numbers, 1), nan=1.0)
    t = left.t - left.t[0]
    width = int(np.ceil(CLEANING.hand_times_smooth / max(1.0, float(np.median(numbers)))))
    rms = np.sqrt(np.convolve(squares, np.full(width, 1 / width), mode="same"))
    known = t <= free - CLEANING.beside
    usual = max(1.0, float(np.sqrt(squares[known].mean())) if known.any() else 1.0)
    large = np.flatnonzero((rms > above * usual) & (t > max(free - CLEANING.free, free / 2)))
    return float(t[large[0]]) if len(large) else float(t[-1])
