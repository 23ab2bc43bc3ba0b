"""Where a gyroscope's recording shows a free swing, and no hand.

A free pendulum is slow and smooth; a hand trembles at 8 to 12 Hz and lets go or catches with a jerk. Fourth differences
let nothing pass of a swing of 3 Hz or less and most of a tremor: where they are larger than the noise, it is no free
swing. Where nothing moves, there is none either.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

ORDER, GAIN = 4, 70.0
"""of differences, and by how much they enlarge the square of white noise"""
AVERAGED = 0.5
"""s over which differences are averaged"""
TREMOR = 1.6
"""times their usual size, from which on it is a hand: chance reaches 1.45 in a minute, tremor of 0.03 rad/s makes 3"""
MOVING = 6.0
"""times its noise that a rate must be off its mean"""
AT_ENDS = 0.3
"""of its usual peaks, which a swing has reached where its window begins and ends: a steady hand may hold so still that
it has no tremor to be seen by, and a swing is that slow for a tenth of its period only"""
BESIDE = 0.1
"""s left out at both ends: a hand lets go that slowly"""
SHORTEST = 5.0
"""s: less than two swings show no period"""
QUIETEST = 0.25
"""share of the time that is at least free swing: there the usual size of the differences is read"""


@dataclass(frozen=True)
class FreeSwing:
    """Rows of one free swing."""

    first: int
    last: int
    """the row after it"""


def rate_noise(rates: Float[np.ndarray, "N 3"]) -> float:
    """rad/s, of one even sample, by fourth differences, outliers aside; NaN where there are too few."""
    fourth = np.diff(rates, n=ORDER, axis=0)
    fourth = np.abs(fourth[np.isfinite(fourth)])
    return float(np.median(fourth) / 0.6745 / np.sqrt(GAIN)) if len(fourth) > 20 else np.nan


def free_swings(t: Float[np.ndarray, " N"], rates: Float[np.ndarray, "N 3"]) -> tuple[FreeSwing, ...]:
    """The free swings of a recording at even times (s); rates in rad/s, NaN where missing."""
    step = float(t[1] - t[0])
    fast = np.full(len(t), np.nan)
    fast[ORDER // 2 : len(t) - ORDER // 2] = (np.diff(rates, n=ORDER, axis=0) ** 2).mean(axis=1)
    size = np.sqrt(_averaged(fast, max(1, round(AVERAGED / step))))
    moves = np.sqrt(_averaged(((rates - np.nanmedian(rates, axis=0)) ** 2).sum(axis=1), round(2.0 / step)))
    known = np.isfinite(size) & np.isfinite(moves)
    if not known.any():
        return ()
    usual = float(np.quantile(size[known], QUIETEST))
    noise = usual / np.sqrt(GAIN)
    free = known & (size < TREMOR * usual) & (moves > MOVING * noise)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(int)))
    found: list[FreeSwing] = []
    for first, last in edges.reshape(-1, 2):
        off = np.abs(rates[first:last] - np.nanmedian(rates[first:last], axis=0)).max(axis=1)
        begun = np.flatnonzero(off > max(MOVING * noise, AT_ENDS * float(np.nanquantile(off, 0.95))))
        if not len(begun):
            continue
        inside = (first + int(begun[0]) + round(BESIDE / step), first + int(begun[-1]) + 1 - round(BESIDE / step))
        if (inside[1] - inside[0]) * step >= SHORTEST:
            found.append(FreeSwing(*inside))
    return tuple(found)


def _averaged(values: np.ndarray, count: int) -> np.ndarray:
    """Running means over so many, of those that are known; NaN where half are not."""
    known = np.isfinite(values)
    ones = np.ones(count)
    sums, numbers = (np.convolve(v, ones, mode="same") for v in (np.where(known, values, 0.0), known.astype(float)))
    return np.where(numbers >= count / 2, sums / np.maximum(numbers, 1), np.nan)
