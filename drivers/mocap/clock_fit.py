"""The time of a frame: its counter times the period, fitted to the arrival times from below.

A packet may come late, never early: the arrivals lie above a straight line (the device's clock plus the least latency)
and touch it now and then. That line is the edge, over the mean of the counter, of the lower convex hull; it is the line
below all points that is nearest to them on average. Least squares follows the mean latency and every spike instead:
with 0.5 ms of exponential jitter it is 0.5–0.6 ms off where this one is off by a microsecond.

The least latency itself cannot be seen in arrivals: it comes from the vendor's latency information, a trigger, or a
motion seen by two sensors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_FRAMES = 8
"""fewer tell no rate"""
NEAREST = 16
"""points nearest to the line, from which the local density of arrivals is taken"""

# How far the edge lies from the true line depends on one length only: delta, the mean step from one of the nearest
# points to the next (1 / (n f(0)) for n arrivals whose jitter has the density f(0) at its least value). In units of
# delta, and of delta over the span for the rate, the law is the same for every such jitter. From 10 000 trials
# with uniform and exponential jitter, n = 200…2000; tests/drivers/mocap/test_mocap_clock_fit.py repeats them:
_BIAS, _SD, _SD_RATE = 1.80, 1.36, 7.0
_TIES = 1e-9
"""s; jitter below a nanosecond is arithmetic"""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """Host time of a frame number: time(n) = offset + rate · period · (n − reference)."""

    reference: float
    """frame number at the middle, where offset and rate are uncorrelated"""
    offset: float
    """host monotonic s at the reference, least latency included"""
    rate: float
    """host seconds for one second of the device; 1.00003 is a device 30 ppm slow"""
    period: float
    """nominal s from frame to frame"""
    sd_offset: float
    """s, one standard deviation, of the line against the least latency"""
    sd_rate: float
    """one standard deviation"""
    frames: int
    """how many it rests on"""

    def time(self, number: float) -> float:
        """Host monotonic s at which a frame would arrive with the least latency."""
        return self.offset + self.rate * self.period * (number - self.reference)

    def sd(self, number: float) -> float:
        """Standard deviation of `time(number)`, s."""
        return float(np.hypot(self.sd_offset, self.sd_rate * self.period * (number - self.reference)))


def fit_clock(numbers: Sequence[int], arrivals: Sequence[float], rate: float) -> ClockFit | None:
    """Lower-envelope fit of arrivals (N,) in s against increasing frame numbers (N,); `rate` in Hz is the nominal one.

    None for fewer than LEAST_FRAMES frames. The stated standard deviations hold for jitter that has a density at its
    least value; arrivals with no jitter at all give zero.
    """
    if len(numbers) < LEAST_FRAMES:
        return None
    period = 1.0 / rate
    n = np.asarray(numbers, dtype=np.float64)
    reference = float(n.mean())
    x = (n - reference) * period
    origin = float(arrivals[0])
    y = (
        np.asarray(arrivals, dtype=np.float64) - origin - x
    )  # what a perfect clock leaves: small numbers, no cancellation
    height, slope = _edge_below(x, y)
    above = y - height - slope * x
    nearest = min(NEAREST, len(n) // 4)
    delta = float(np.partition(above, nearest + 1)[nearest + 1]) / nearest  # the two touching points are at zero
    if delta < _TIES:
        delta = 0.0
    span = float(x[-1] - x[0])
    return ClockFit(
        reference=reference,
        offset=origin + height - _BIAS * delta,
        rate=1.0 + slope,
        period=period,
        sd_offset=_SD * delta,
        sd_rate=_SD_RATE * delta / span,
        frames=len(n),
    )


def _edge_below(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Height at x = 0 and slope of the lower hull's edge over x = 0; x increasing, with mean 0."""
    hull: list[tuple[float, float]] = []
    for point in zip(x.tolist(), y.tolist(), strict=True):
        while len(hull) > 1 and not _turns_up(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    right = next(i for i in range(1, len(hull)) if hull[i][0] >= 0.0)
    (x0, y0), (x1, y1) = hull[right - 1], hull[right]
    slope = (y1 - y0) / (x1 - x0)
    return y0 - slope * x0, slope


def _turns_up(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])
