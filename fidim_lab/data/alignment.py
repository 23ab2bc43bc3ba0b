"""How far apart two clocks are, from signals that both devices saw: the lag of best correlation and its uncertainty.

For whole recordings without a common pulse (motion capture against a robot's log). The same motion reaches both sides
through different sensors, each with its own filter, so the lag found is clock offset *plus* the difference of their
delays: the two cannot be separated, and signals of different sensors should be aligned separately and compared.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.signal import butter, sosfiltfilt

from fidim_lab.arrays import Series
from fidim_lab.errors import RefusedError

Channels = Float[np.ndarray, "N k"]
PerChannel = Float[np.ndarray, "k"]

BAND = (0.3, 8.0)
"""Hz: below is sensor drift, above is noise and what a smooth motion does not hold"""
LEAST_OVERLAP = 0.5
"""of the shorter recording; fewer common samples correlate by chance"""
BLOCK = 5.0
"""s; long against the motion's periods, so that blocks err independently"""
FEWEST_BLOCKS = 6
"""of a short recording: two tell too little of their scatter (24 jogs of 12 s: 79 % within 2 sd; with six, all)"""


@dataclass(frozen=True, eq=False)
class ClockOffset:
    """`other` shows at time t + offset what `reference` shows at time t."""

    offset: float
    """s"""
    sd: float
    """s, from the scatter over blocks of time and over channels (jackknife over both)"""
    correlation: float
    """mean over the channels at that offset"""
    per_channel: PerChannel
    """s, each channel alone"""
    correlations: PerChannel


def align_clocks(t: Series, reference: Channels, t_other: Series, other: Channels) -> ClockOffset:
    """The offset between two clocks that recorded the same k signals.

    Args:
        t: (N,) s, even steps; the reference's clock.
        reference: (N, k) signals; scale and constant do not matter, the sign does. NaN is bridged.
        t_other: (K,) s, increasing; the other clock.
        other: (K, k) the same signals as the other device saw them.

    Raises:
        RefusedError: recordings too short to compare, or signals that do not move.
    """
    step = float(np.median(np.diff(t)))
    ours = _prepared(reference, step)
    grid = np.arange(t_other[0], t_other[-1] + 0.5 * step, step)
    theirs = _prepared(np.column_stack([np.interp(grid, t_other, column) for column in other.T]), step)
    shift, first, last = _coarse(ours, theirs)

    def at_lag(lag: float) -> float:
        return float(grid[0] - t[0] + lag * step)

    blocks = _blocks(first, last, step)
    products = np.array([_products(ours, theirs, shift, rows) for rows in blocks])
    whole = products.sum(axis=0)
    lag = shift + _peak(_correlation(whole).mean(axis=0))
    channels = np.array([shift + _peak(_correlation(channel[None])[0]) for channel in whole])
    variance = _jackknife([_peak(_correlation(whole - block).mean(axis=0)) for block in products])
    if len(channels) > 1:
        others = [_peak(_correlation(np.delete(whole, k, axis=0)).mean(axis=0)) for k in range(len(channels))]
        variance += _jackknife(others)
    # A parabola through three lags resolves no better than a small part of a step.
    sd = float(np.hypot(np.sqrt(variance), 0.01)) * step
    best = _correlation(whole)[:, 1]
    return ClockOffset(
        at_lag(lag), sd, float(best.mean()), np.array([at_lag(float(c)) for c in channels]), np.array(best)
    )


def _prepared(signals: Channels, step: float) -> Channels:
    """Band-passed signals of unit power; gaps bridged by straight lines."""
    rate = 1.0 / step
    if len(signals) < 2 * BLOCK * rate:
        raise RefusedError(
            f"{len(signals) * step:.1f} s are too short to align two clocks; {2 * BLOCK:g} s or more are needed."
        )
    rows = np.arange(len(signals))
    bridged = np.column_stack([_bridged(rows, column) for column in signals.T])
    sections = butter(2, [BAND[0], min(BAND[1], 0.4 * rate)], "bandpass", fs=rate, output="sos")
    passed = sosfiltfilt(sections, bridged, axis=0)
    power = passed.std(axis=0)
    if (power <= 1e-9 * np.abs(bridged).max(axis=0)).any():
        still = ", ".join(str(k + 1) for k in np.flatnonzero(power <= 1e-9 * np.abs(bridged).max(axis=0)))
        raise RefusedError(f"Signal {still} does not move, so it says nothing about the clocks.")
    return passed / power


def _bridged(rows: np.ndarray, column: np.ndarray) -> np.ndarray:
    known = np.isfinite(column)
    if not known.any():
        raise RefusedError("A signal was never seen, so it says nothing about the clocks.")
    return np.interp(rows, rows[known], column[known])


def _coarse(ours: Channels, theirs: Channels) -> tuple[int, int, int]:
    """Best whole-step lag over every overlap that is long enough, and the rows of `ours` it overlaps."""
    n, m = len(ours), len(theirs)
    lags = np.arange(-(n - 1), m)
    size = 1 << (n + m - 1).bit_length()
    spectrum = np.conj(np.fft.rfft(ours, size, axis=0)) * np.fft.rfft(theirs, size, axis=0)
    product = np.fft.irfft(spectrum.sum(axis=1), size)[lags % size]
    first, last = np.maximum(0, -lags), np.minimum(n, m - lags)
    energy = np.sqrt(_summed(ours, first, last) * _summed(theirs, first + lags, last + lags))
    # One step is kept on both sides, for the parabola.
    allowed = (last - first >= LEAST_OVERLAP * min(n, m)) & (energy > 0.0)
    score = np.where(allowed, product / np.where(energy > 0.0, energy, 1.0), -np.inf)
    best = int(np.argmax(score))
    return int(lags[best]), int(first[best]) + 1, int(last[best]) - 1


def _summed(signals: Channels, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    running = np.concatenate([[0.0], np.cumsum((signals**2).sum(axis=1))])
    return running[last] - running[first]


def _blocks(first: int, last: int, step: float) -> list[np.ndarray]:
    rows = np.arange(first, last)
    return list(np.array_split(rows, max(FEWEST_BLOCKS, round(len(rows) * step / BLOCK))))


def _products(ours: Channels, theirs: Channels, shift: int, rows: np.ndarray) -> np.ndarray:
    """(k, 7) sums over some rows: products at the lags shift − 1, shift, shift + 1, their energies there, our energy.

    The energy belongs to each lag: a stretch that begins fast and ends slow would otherwise pull the peak to one side.
    """
    mine = ours[rows]
    shown = [theirs[rows + shift + more] for more in (-1, 0, 1)]
    sums = [(mine * their).sum(axis=0) for their in shown] + [(their**2).sum(axis=0) for their in shown]
    return np.column_stack([*sums, (mine**2).sum(axis=0)])


def _correlation(products: np.ndarray) -> np.ndarray:
    """(k, 3) correlations at the three lags."""
    return products[:, :3] / np.sqrt(products[:, 3:6] * products[:, 6:])


def _peak(three: np.ndarray) -> float:
    """Where the parabola through three values at −1, 0, 1 is highest; never farther than two steps."""
    before, at, after = (float(v) for v in three)
    curvature = before - 2.0 * at + after
    if curvature >= 0.0:
        return 0.0
    return float(np.clip(0.5 * (before - after) / curvature, -2.0, 2.0))


def _jackknife(values: list[float]) -> float:
    """Variance of an estimate from its delete-one values."""
    array = np.array(values)
    return float((len(array) - 1) / len(array) * ((array - array.mean()) ** 2).sum())
