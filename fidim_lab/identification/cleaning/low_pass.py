"""Markers that were low-passed or upsampled before export: found by the spectrum of their noise.

Noise of cameras is white. Above the motion, a filtered recording has a spectrum that falls, to the rounding of the
file if the filter is steep. Samples of such a recording are delayed or smeared by an unknown filter, and their noise is
not independent: it is said, and a fit that then misses is the filter's.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.filled import last_digit

SEGMENT = 256
"""samples of one periodogram, 2.6 s at 100 Hz"""
FALLS = 4.0
"""times less power in the highest tenth of the spectrum than in the tenth below its middle: 24 periodograms of white
noise have 1 ± 0.1; a filter of second order 100 and more, whatever its cutoff"""
QUIET, SILENT = 0.2, 0.02
"""of the stated noise, in the upper half of the spectrum: with less the file's rounding is all that may be left; less
still is no camera's noise, however good it is beside what was stated (on the paper's robot a fifth)"""
ROUNDING = 3.0
"""times the file's rounding, below which nothing is told"""
LOW, MIDDLE, HIGH = (0.2, 0.3), (0.2, 0.5), (0.4, 0.48)
"""bands, of the sample rate; below a fifth of it harmonics of the motion may lie"""


@dataclass(frozen=True)
class LowPass:
    """What the spectrum shows."""

    cutoff: float
    """Hz, below which the noise is the stated one"""
    fall: float
    """power in the low band over that in the high one"""

    @property
    def says(self) -> str:
        """For people."""
        return (
            f"The markers were low-passed at about {self.cutoff:.2g} Hz, or upsampled, before they were exported "
            "(above it their noise is gone): the residual is delayed, or smeared, by an unknown filter. Export them "
            "unfiltered."
        )


def low_passed(campaign: Campaign) -> LowPass | None:
    """None where the noise is white as far as it is seen."""
    rate = campaign.sample_rate
    spectra = [power for window in campaign.windows for power in _spectra(window, rate)]
    if not spectra:
        return None
    power = np.mean(spectra, axis=0)
    f = np.arange(len(power)) / SEGMENT * rate
    stated = 2 * campaign.robot.sensors.marker_noise**2 / rate
    rounding = 2 * max(last_digit(w.markers.reshape(-1, 3)) for w in campaign.windows) ** 2 / 12 / rate
    low, middle, high = (float(power[(f >= a * rate) & (f < b * rate)].mean()) for a, b in (LOW, MIDDLE, HIGH))
    falls = low > FALLS * high and low > ROUNDING * rounding
    least = QUIET if middle < ROUNDING * rounding else SILENT
    gone = middle < least**2 * stated and stated > ROUNDING**2 * rounding
    if not falls and not gone:
        return None
    return LowPass(_cutoff(f / rate, power / stated, falls=falls) * rate, low / high)


def _cutoff(f: Float[np.ndarray, " F"], power: Float[np.ndarray, " F"], *, falls: bool) -> float:
    """By the law of a Butterworth filter through the spectrum's fall, of the sample rate; power in white noise's.

    Where the file's rounding hides the fall: the lowest frequency from which on less than half of the noise is left.
    """
    if falls:
        use = (f >= LOW[0]) & (f < HIGH[0])
        slope, level = np.polyfit(np.log(np.tan(np.pi * f[use])), np.log(power[use]), 1)
        return float(np.arctan(np.exp(-level / slope)) / np.pi)
    loud = np.flatnonzero(power > 0.5)
    return float(f[min(loud[-1] + 1, len(f) - 1)]) if len(loud) else float(f[1])


def _spectra(window: Window, rate: float) -> list[Float[np.ndarray, " F"]]:
    """Periodograms (m²/Hz) of every coordinate in each stretch of `SEGMENT` rows without a gap."""
    found: list[np.ndarray] = []
    taper = np.blackman(SEGMENT)
    for begin in range(0, len(window.t) - SEGMENT + 1, SEGMENT):
        t = window.t[begin : begin + SEGMENT]
        columns = window.markers[begin : begin + SEGMENT].reshape(SEGMENT, -1)
        columns = columns[:, np.isfinite(columns).all(axis=0)]
        if not columns.shape[1] or np.abs(np.diff(t) * rate - 1).max() > 0.1:
            continue
        line = np.vander(np.linspace(-1.0, 1.0, SEGMENT), 2)
        columns = columns - line @ np.linalg.lstsq(line, columns, rcond=None)[0]
        spectrum = np.abs(np.fft.rfft(columns * taper[:, np.newaxis], axis=0)) ** 2
        found.append(2 * spectrum.mean(axis=1) / (rate * (taper**2).sum()))
    return found
