"""Frames that repeat the one before: a slow camera in a faster file, frames that a stream lost.

The first of equal frames was measured when its time says, the others later than they were: they become missing.
Measured frames are equal only by rounding, and then single coordinates are equal far more often. One that comes again
later, or 0 0 0, stands for a blank. A marker that keeps one place for longer and then catches up has moved on unseen: a
program filled the gap. Where it goes on from that place instead, a hand may have held it, in a recording without noise;
screening names what is neither.
"""

from collections import Counter

import numpy as np
from jaxtyping import Bool

from fidim_lab.arrays import runs
from fidim_lab.data.missing import FEWEST_HELD
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.removed import CleanRecordings, without_each

BY_CHANCE = 0.05
"""share of the repeated frames of a window that rounding may make"""
ROUNDED = 2.0
"""digits, by which a rounded place that stood still moves on at most: one in each direction is √3"""
WHY = "repeats the frame before"


def without_repeated(campaign: Campaign) -> CleanRecordings:
    """Repeated frames become missing samples."""
    return without_each(campaign, _repeated, WHY, "repeat the frame before to the last digit")


def without_held(campaign: Campaign) -> CleanRecordings:
    """Places that a marker keeps while the motion goes on become missing samples."""
    return without_each(campaign, _held, WHY, "keep a place to the last digit while the motion continues")


def _held(window: Window) -> Bool[np.ndarray, "N M"]:
    held = np.zeros(window.markers.shape[:2], dtype=bool)
    for marker, track in enumerate(np.swapaxes(window.markers, 0, 1)):
        apart = np.abs(np.diff(track, axis=0))
        digit = float(np.min(apart[apart > 0.0], initial=np.inf))  # what is rounded stands still, and moves on by one
        steps = np.linalg.norm(apart, axis=1)
        own = np.where(np.append(False, steps[:-1] == 0.0), np.nan, steps)  # of one frame, not of those held before it
        for begin, end in runs(np.asarray(steps == 0.0)):
            kept = end - begin + 1
            if kept < FEWEST_HELD or end >= len(steps):
                continue
            beside = [*own[max(0, begin - 1) : begin], *own[end + 1 : end + 1 + kept]]
            held[begin + 1 : end + 1, marker] = steps[end] > np.nanmax([ROUNDED * digit, *beside])
    return held


def _repeated(window: Window) -> Bool[np.ndarray, "N M"]:
    frames = window.markers.reshape(len(window.t), -1)
    seen = np.isfinite(frames)
    equal = np.zeros(frames.shape, dtype=bool)
    equal[1:] = (frames[1:] == frames[:-1]) & seen[1:]
    whole = np.asarray((equal == seen).all(axis=1) & seen.any(axis=1))
    whole[:1] = False
    either = ~whole[:, np.newaxis] & seen
    chance = (1 + (equal & either).sum(axis=0)) / (1 + either.sum(axis=0))
    if len(frames) * float(np.prod(chance)) > BY_CHANCE * whole.sum():
        return np.zeros(window.markers.shape[:2], dtype=bool)
    met = Counter(frame.tobytes() for frame in frames[~whole])
    for begin, end in runs(whole):
        stands_for_a_blank = met[frames[begin].tobytes()] > 1 or not np.nan_to_num(frames[begin]).any()
        whole[begin:end] = end - begin + 1 < FEWEST_HELD and not stands_for_a_blank
    return whole[:, np.newaxis] & np.isfinite(window.markers).all(axis=2)
