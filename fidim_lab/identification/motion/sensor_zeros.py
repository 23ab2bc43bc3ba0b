"""Zeros, delays and noise of swivel encoders and inclinometer: calibrated once a campaign, or by the data sheet.

A relative encoder counts from an unknown zero and an inclinometer filters, so its reading is late. Where some windows
hold markers that show the whole pose, `calibrated` finds a constant and a delay for each sensor from all of them
together, and how far readings stray from that: a handful of numbers for a whole campaign, after which the cameras are
no longer needed. `STATED` is for absolute encoders without a delay.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable, Series
from fidim_lab.data.own_sensors import OwnSensors

SWIVEL_NOISE = 2e-3
"""rad, of a swivel encoder with the play of its pulley, where nobody calibrated it"""
INCLINATION_NOISE = 5e-3
"""rad, of an inclinometer on a moving platform, where nobody calibrated it"""
FEWEST = 50
"""samples with a whole pose that a calibration needs"""


@dataclass(frozen=True, eq=False)
class SensorZeros:
    """What turns readings into angles of the model."""

    swivel: PerCable | float
    """rad, reading minus angle"""
    inclination: Float[np.ndarray, " K"] | float
    """rad, reading minus angle"""
    swivel_delay: float
    """s, by which the reading is late"""
    inclination_delay: float
    """s"""
    length_noise: float
    """m"""
    swivel_noise: float
    """rad"""
    inclination_noise: Float[np.ndarray, " K"] | float
    """rad, about each axis"""

    def noise(self, cables: int, inclinations: int) -> Float[np.ndarray, " K"]:
        """Standard deviations of [lengths; swivel angles; inclinations]."""
        of_inclination = np.broadcast_to(self.inclination_noise, inclinations)
        return np.concatenate([
            np.full(cables, self.length_noise), np.full(cables, self.swivel_noise), of_inclination
        ])  # fmt: skip


def stated(encoder_resolution: float) -> SensorZeros:
    """Absolute encoders, no delay, usual noise; lengths as good as the robot file says."""
    return SensorZeros(0.0, 0.0, 0.0, 0.0, encoder_resolution, SWIVEL_NOISE, INCLINATION_NOISE)


@dataclass(frozen=True, eq=False)
class Compared:
    """One window's readings beside those that its poses by motion capture predict (`pose_sources.predicted`)."""

    t: Series
    readings: OwnSensors
    expected: OwnSensors


def calibrated(windows: Sequence[Compared], encoder_resolution: float) -> SensorZeros | None:
    """Zeros, delays and noise from all windows together; None with too few samples that hold everything.

    By least squares of reading − expected = zero − delay · d(expected)/dt. Noise is what that leaves, at least the
    encoder's resolution for lengths.
    """
    swivel = _column_fit([(w.t, w.readings.swivels, w.expected.swivels) for w in windows])
    incline = _column_fit([(w.t, w.readings.inclination, w.expected.inclination) for w in windows])
    if swivel is None:
        return None
    length = np.concatenate([w.readings.lengths - w.expected.lengths for w in windows])
    length_noise = max(encoder_resolution, float(np.sqrt(np.nanmean(length**2))))
    by = stated(encoder_resolution) if incline is None else None
    return SensorZeros(
        swivel=swivel.zeros,
        inclination=0.0 if incline is None else incline.zeros,
        swivel_delay=swivel.delay,
        inclination_delay=0.0 if incline is None else incline.delay,
        length_noise=length_noise,
        swivel_noise=float(np.sqrt(np.mean(swivel.noise**2))),
        inclination_noise=by.inclination_noise if incline is None and by else incline.noise if incline else 0.0,
    )


def corrected(t: Series, readings: OwnSensors, zeros: SensorZeros) -> OwnSensors:
    """Readings without their zeros and delays, at times t (s); NaN at the end that a delay takes."""
    return OwnSensors(
        readings.lengths,
        _earlier(t, readings.swivels, zeros.swivel_delay) - zeros.swivel,
        _earlier(t, readings.inclination, zeros.inclination_delay) - zeros.inclination,
    )


@dataclass(frozen=True, eq=False)
class _Column:
    zeros: np.ndarray
    delay: float
    noise: np.ndarray


def _column_fit(windows: Sequence[tuple[Series, np.ndarray, np.ndarray]]) -> _Column | None:
    """Zeros (K,), one delay, and the remainder's rms (K,) of sensors of one kind."""
    K = windows[0][1].shape[1] if windows else 0
    if K == 0:
        return None
    off: list[np.ndarray] = []
    rates: list[np.ndarray] = []
    for t, read, expected in windows:
        difference = read - expected
        difference -= 2 * np.pi * np.rint(difference / (2 * np.pi))
        rate = np.gradient(np.unwrap(expected, axis=0), t, axis=0)
        whole = np.isfinite(difference).all(axis=1) & np.isfinite(rate).all(axis=1)
        off.append(difference[whole])
        rates.append(rate[whole])
    y, v = np.concatenate(off), np.concatenate(rates)
    if len(y) < FEWEST:
        return None
    about, moving = y - y.mean(axis=0), v - v.mean(axis=0)
    power = float((moving**2).sum())
    delay = -float((moving * about).sum()) / power if power > 0 else 0.0
    left = about + delay * moving
    return _Column(y.mean(axis=0) + delay * v.mean(axis=0), delay, np.sqrt((left**2).mean(axis=0)))


def _earlier(t: Series, values: np.ndarray, delay: float) -> np.ndarray:
    if delay == 0.0:
        return values
    columns = [np.interp(t + delay, t, column, left=np.nan, right=np.nan) for column in values.T]
    return np.column_stack(columns) if columns else values
