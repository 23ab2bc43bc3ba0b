"""Samples computed from their neighbours: gaps filled by lines or cubics, and linear upsampling.

Measured samples scatter; computed ones lie on their line to the last digit that the file writes. A run of second (or
fourth) differences that are zero to the rounding, in all coordinates of a marker at once, does not happen by chance.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter1d

from fidim_lab.arrays import Series, runs
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.removed import CleanRecordings, without_each

CHANCE = 1e-6
"""of one such run in a window by rounding alone"""
DIGITS = 9
"""of a metre: finer is the arithmetic, not the file"""
MANY = 20.0
"""times as many such samples as chance gives show that all of them are computed"""
SCATTER = 5.0
"""times the last digit that measured samples must scatter by: below, everything lies on lines to the last digit"""
WHY = "computed from its neighbours"


def without_filled(campaign: Campaign) -> CleanRecordings:
    """Computed samples become missing."""
    says = "lie on straight lines or cubics between their neighbours to the last digit"
    return without_each(campaign, _filled, WHY, says)


def _filled(window: Window) -> Bool[np.ndarray, "N M"]:
    found = np.zeros(window.markers.shape[:2], dtype=bool)
    if not _even(window.t):
        return found
    for m in range(window.markers.shape[1]):
        track = window.markers[:, m]
        digit = _last_digits(track)
        for order, beside in ((2, 0), (4, 1)):
            found[:, m] |= _on_curves(track, order, beside, digit)
    return found


def _even(t: Series) -> bool:
    """Whether samples are so evenly spaced that differences mean derivatives."""
    steps = np.diff(t)
    return len(t) > 8 and bool(np.quantile(np.abs(steps - np.median(steps)), 0.9) < 0.01 * np.median(steps))


def last_digit(track: Float[np.ndarray, "..."]) -> float:
    """Size of the last decimal that the file writes, m."""
    known = track[np.isfinite(track)]
    for digits in range(1, DIGITS):
        scaled = known * 10.0**digits
        if len(known) and np.abs(scaled - np.rint(scaled)).max() < 1e-3:
            return 10.0**-digits
    return 10.0**-DIGITS


def _last_digits(track: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Of each number, m: of six digits in all, as C's %g and Nexus write them, larger numbers have fewer decimals."""
    decade = np.floor(np.log10(np.maximum(np.abs(track), 10.0**-DIGITS)))
    digits = np.full(track.shape, 10.0**-DIGITS)
    for one in np.unique(decade[np.isfinite(decade)]):
        digits[decade == one] = last_digit(track[decade == one])
    return digits


def _on_curves(
    track: Float[np.ndarray, "N 3"], order: int, beside: int, digits: Float[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    """Samples whose differences of this order are zero in all coordinates; `beside`: further ones on each side."""
    half = order // 2
    apart = np.full(track.shape, np.nan)
    apart[half:-half] = np.diff(track, n=order, axis=0)
    rounding = maximum_filter1d(digits, order + 1, axis=0) * 2.0 ** (order - 1)
    zero = np.asarray((np.abs(apart) <= rounding * (1 + 1e-6)).all(axis=1))
    others = np.abs(apart / rounding)[~zero & np.isfinite(apart).all(axis=1)]
    found = np.zeros(len(track), dtype=bool)
    if len(others) < 8 or np.median(others, axis=0).min() < SCATTER:
        return found
    chance = float(np.prod((others <= 4).mean(axis=0) / 4 + 1 / len(track)))
    needed = max(1, int(np.ceil(np.log(CHANCE / len(track)) / np.log(min(chance, 0.5)))))
    if zero.sum() > MANY * max(1.0, chance * len(track)):
        needed = 1  # a recording that was upsampled has them everywhere, one between any two
    for begin, end in runs(zero):
        frozen = not np.ptp(track[max(0, begin - 1) : end], axis=0).any()  # a fault of the sensor: screening names it
        if end - begin >= needed and not frozen:
            found[max(0, begin - beside) : end + beside] = True
    return found
