"""Amplitude spectra of residuals: `amplitudes` for one course, `picture` for several, before and after or by axis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.app.report.drawings.figures import WIDTH, legend, plain_ticks
from fidim_lab.app.report.drawings.svg import COLOURS, POINTS, STYLES, sheet, styled, thin, to_svg
from fidim_lab.arrays import Series
from fidim_lab.units import millimetres

SHORTEST = 32
"""samples, with fewer of which there is no spectrum worth a picture"""
HIGHEST = 20.0
"""Hz, up to which pictures show: platforms on cables swing below a tenth of that, and the rest is noise"""


@dataclass(frozen=True, eq=False)
class LabelledSpectrum:
    """Amplitudes over frequency."""

    label: str
    frequencies: Series
    """Hz"""
    amplitudes: Series
    """m; a steady sine of amplitude a that fills the record shows as a peak of height a"""


def amplitudes(label: str, t: Series, values: np.ndarray) -> LabelledSpectrum | None:
    """The spectrum of residuals (N, K), root sum of squares over their columns; None where too few were recorded.

    Samples are put on an even grid; gaps count as no data (0), a Hann window keeps lines apart.
    """
    seen = np.isfinite(values).all(axis=1)
    if int(seen.sum()) < SHORTEST:
        return None
    step = float(np.median(np.diff(t)))
    places = np.rint((t[seen] - t[seen][0]) / step).astype(int)
    even = np.zeros((places[-1] + 1, values.shape[1]))
    even[places] = values[seen] - values[seen].mean(axis=0)
    window = np.hanning(len(even))[:, np.newaxis]
    gain = 0.5 * float(window[places].sum())
    lines = np.abs(np.fft.rfft(even * window, axis=0)) / gain
    return LabelledSpectrum(label, np.fft.rfftfreq(len(even), step), np.sqrt((lines**2).sum(axis=1)))


def mean(label: str, spectra: Sequence[LabelledSpectrum]) -> LabelledSpectrum | None:
    """Root mean square over windows, on the frequencies of the one with the finest lines; None of none."""
    if not spectra:
        return None
    f = max((one.frequencies for one in spectra), key=len)
    squares = [np.interp(f, one.frequencies, one.amplitudes**2) for one in spectra]
    return LabelledSpectrum(label, f, np.sqrt(np.mean(squares, axis=0)))


@styled
def picture(spectra: Sequence[LabelledSpectrum], noise: float | None = None, points: int = POINTS) -> str:
    """Draw spectra over one another, both axes as they are; `noise`: level (m) that white marker noise would have."""
    figure, (axis,) = sheet(WIDTH, 2.6)
    for k, one in enumerate(spectra):
        shown = (one.frequencies > 0) & (one.frequencies <= HIGHEST)
        line = thin(one.frequencies[shown], millimetres(1.0) * one.amplitudes[shown], points)
        axis.plot(*line, color=COLOURS[k % len(COLOURS)], ls=STYLES[k % len(STYLES)], lw=1.1, label=one.label)
    if noise is not None:
        axis.axhline(millimetres(noise), color="black", lw=0.9, ls=":", label="noise alone")
    axis.set_yscale("log")
    plain_ticks(axis.yaxis)
    axis.set_xlabel("f / Hz")
    axis.set_ylabel("amplitude / mm")
    legend(axis, len(spectra) + 1)
    return to_svg(figure)


def noise_level(sd: float, samples: int, columns: int) -> float:
    """Root mean square height (m) of the spectrum of white noise of this sd (m) in so many samples and columns.

    For a Hann window: E|X|² = N sd² · 3/8, and the gain is N/4.
    """
    return sd * float(np.sqrt(columns * 6.0 / max(1, samples)))
