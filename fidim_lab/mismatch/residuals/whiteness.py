"""Are the residuals white? A test with a known false-alarm rate, for weak structure in many data.

The global χ²/dof cannot see 300 of 54 000. Structure of a mechanism lies at low frequencies, in few windows or in a
line, so χ² is looked at by octave bands, over all windows and in each, and line by line; each against the noise level
above `whiteness_reference` Hz, which no rigid motion reaches (a wrong declared noise does not matter). What all windows
together have in a narrow band there is no noise either: cameras shake. The p-value counts all these tests (Bonferroni).
The windows' own fitted unknowns take energy out of the low bands: exactly accounted for where their derivatives are
given, else ignored, which makes the test conservative.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np
from jaxtyping import Float
from scipy.special import chdtrc, fdtrc

from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.residuals.thresholds import RESIDUALS
from fidim_lab.units import plain


@dataclass(frozen=True, eq=False)
class Spectrum:
    """χ² of one window by frequency, for each channel; white noise of 1 has χ² = dof everywhere."""

    frequencies: Float[np.ndarray, " F"]
    chi2: Float[np.ndarray, "F K"]
    dof: Float[np.ndarray, "F K"]


@dataclass(frozen=True)
class Whiteness:
    """The answer."""

    statistic: float
    """χ²/dof of the most telling band or line, over the noise level"""
    p_value: float
    """chance of one like it in white noise, with all tests counted"""
    band: tuple[float, float]
    """Hz"""
    window: str | None
    """id where one window tells most, else None"""
    excess: float
    """χ² below `whiteness_reference` beyond that of the noise"""
    level: float
    """standard deviation of the noise, over the declared"""
    says: str

    @property
    def is_white(self) -> bool:
        """Whether the residual is only noise."""
        return self.p_value > RESIDUALS.whiteness_white

    @property
    def vibration(self) -> float | None:
        """Hz, of a line that is faster than any rigid motion of the platform; None where none of these tells most."""
        return None if self.is_white or self.band[0] < RESIDUALS.whiteness_edges[-1] else float(np.mean(self.band))


def spectrum(leftover: Leftover) -> Spectrum:
    """Periodogram of each channel, gaps counted as no data."""
    step, values = leftover.on_grid()
    seen = np.isfinite(values)
    count = len(values)
    share = seen.mean(axis=0)
    lines = np.fft.rfft(np.where(seen, values, 0.0), axis=0)
    weight = np.full((len(lines), 1), 2.0)
    weight[0] = 1.0
    if count % 2 == 0:
        weight[-1] = 1.0
    dof = weight * share
    if leftover.directions is not None:
        dof = np.maximum(dof - _taken(leftover, weight), 1e-9)
    return Spectrum(np.fft.rfftfreq(count, step), weight * np.abs(lines) ** 2 / count, dof)


def _taken(leftover: Leftover, weight: np.ndarray) -> np.ndarray:
    """(F, K): degrees of freedom that the fit of the window's own unknowns took at each line."""
    if leftover.directions is None:
        return np.zeros((len(weight), 1))
    seen = np.isfinite(leftover.values).reshape(-1)
    columns = leftover.directions.reshape(len(seen), -1) * seen[:, np.newaxis]
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    left = left[:, size > 1e-9 * size[0]]
    steps = leftover.t.shape[0]
    grid = np.rint((leftover.t - leftover.t[0]) / float(np.median(np.diff(leftover.t)))).astype(int)
    spread = np.zeros((grid[-1] + 1, leftover.values[0].size, left.shape[1]))
    spread[grid] = left.reshape(steps, -1, left.shape[1])
    return weight * (np.abs(np.fft.rfft(spread, axis=0)) ** 2).sum(axis=2) / len(spread)


def whiteness(leftovers: Sequence[Leftover], *, coloured: float = 1.0) -> Whiteness:
    """Test all windows together. With nothing to test, p = 1.

    coloured: times by which the variance of noise may be more at low frequencies than where its level is read.
    """
    spectra = [spectrum(one) for one in leftovers if one.count > 0 and len(one.t) > 3]
    ids = [one.window for one in leftovers if one.count > 0 and len(one.t) > 3]
    if not spectra:
        return Whiteness(
            1.0, 1.0, (0.0, RESIDUALS.whiteness_edges[-1]), None, 0.0, 1.0, "There is no residual to test."
        )
    level, reference = _noise_level(spectra)
    level *= coloured
    found = np.array([[_band(s, low, high) for low, high in _bands()] for s in spectra])  # W, B, (χ², dof)
    total, narrow = found.sum(axis=0), _narrow_bands(spectra)
    fast = np.array([[_band(s, low, high) for low, high in narrow] for s in spectra]).sum(axis=0)
    vibrates = fast[:, 0] / level - fast[:, 1] > RESIDUALS.whiteness_vibrates * reference
    tests = [
        (*_bonferroni(_tail(total, level, reference)), "bands"),
        (*_bonferroni(_tail(found.reshape(-1, 2), level, reference)), "windows"),
        (*_line(spectra, level), "lines"),
        (*_bonferroni(np.where(vibrates, _tail(fast, level, reference), 1.0)), "fast"),
    ]
    p, place, kind = min(tests, key=lambda test: test[0])
    p = min(1.0, len(tests) * p)
    bands = _bands()
    window: str | None = None
    if kind == "bands":
        band, ratio = bands[place], _ratio(total[place], level)
    elif kind == "windows":
        band, ratio = bands[place % len(bands)], _ratio(found.reshape(-1, 2)[place], level)
        window = ids[place // len(bands)]
    elif kind == "fast":
        band, ratio = narrow[place], _ratio(fast[place], level)
    else:
        window, band, ratio = _line_at(spectra, ids, place, level)
    excess = float((found[..., 0] - level * found[..., 1]).sum())
    return Whiteness(ratio, p, band, window, excess, float(np.sqrt(level)), _words(p, ratio, band, window, excess))


def _narrow_bands(spectra: Sequence[Spectrum]) -> list[tuple[float, float]]:
    """Hz, of what is faster than the platform swings, as far as every window shows it; one at least."""
    first, width = RESIDUALS.whiteness_edges[-1], RESIDUALS.whiteness_narrow
    last = min(float(s.frequencies[-1]) for s in spectra)
    count = max(1, ceil((last - first) / width))
    return list(pairwise((first + width * np.arange(count + 1)).tolist()))


def _bands() -> list[tuple[float, float]]:
    return list(pairwise(RESIDUALS.whiteness_edges))


def _band(found: Spectrum, low: float, high: float) -> tuple[float, float]:
    inside = (found.frequencies >= low) & (found.frequencies < high)
    return float(found.chi2[inside].sum()), float(found.dof[inside].sum())


def _noise_level(spectra: list[Spectrum]) -> tuple[float, float]:
    """Variance of the noise above `whiteness_reference` and its degrees of freedom (infinite where it is believed)."""
    parts = np.array([_band(s, RESIDUALS.whiteness_edges[-1], np.inf) for s in spectra]).sum(axis=0)
    if parts[1] < RESIDUALS.fewest_reference:
        return 1.0, np.inf
    return max(MARKERS.finest**2, float(parts[0] / parts[1])), float(parts[1])


def _ratio(pair: np.ndarray, level: float) -> float:
    return float(pair[0] / max(pair[1], 1e-9) / level)


def _tail(pairs: np.ndarray, level: float, reference: float) -> np.ndarray:
    """p-values of (χ², dof) against the noise level."""
    chi2, dof = pairs[:, 0] / level, np.maximum(pairs[:, 1], 1e-9)
    p = chdtrc(dof, chi2) if np.isinf(reference) else fdtrc(dof, reference, chi2 / dof)
    return np.where(pairs[:, 1] > 0.5, p, 1.0)


def _bonferroni(p: np.ndarray) -> tuple[float, int]:
    place = int(np.argmin(p))
    return min(1.0, float(p[place]) * len(p)), place


def _line(spectra: list[Spectrum], level: float) -> tuple[float, int]:
    """The strongest line of all, with the lines counted; its place among all windows' lines laid end to end."""
    heights, places, lines = [], [], 0
    for s in spectra:
        usual = s.dof > 0.5 * np.median(s.dof)
        height = np.where(usual & (s.frequencies < RESIDUALS.whiteness_edges[-1])[:, np.newaxis], s.chi2, 0.0)
        height[0] = 0.0
        places.append(int(np.argmax(height)))
        heights.append(float(height.max()))
        lines += int((height > 0).sum())
    best = int(np.argmax(heights))
    offset = sum(s.chi2.size for s in spectra[:best])
    return min(1.0, float(np.exp(-heights[best] / (2 * level))) * max(1, lines)), offset + places[best]


def _line_at(
    spectra: list[Spectrum], ids: list[str], place: int, level: float
) -> tuple[str, tuple[float, float], float]:
    for s, name in zip(spectra, ids, strict=True):
        if place < s.chi2.size:
            row, column = divmod(place, s.chi2.shape[1])
            f, width = float(s.frequencies[row]), float(s.frequencies[1])
            return name, (f - width / 2, f + width / 2), float(s.chi2[row, column] / 2 / level)
        place -= s.chi2.size
    raise IndexError(place)


def _words(p: float, ratio: float, band: tuple[float, float], window: str | None, excess: float) -> str:
    where = "all windows together" if window is None else f"window {window}"
    if p > RESIDUALS.whiteness_white:
        return f"The residual is consistent with white noise (most unusual band: p = {p:.2g})."
    if band[0] >= RESIDUALS.whiteness_edges[-1]:
        return (
            f"The residual is not white: it oscillates at {np.mean(band):.3g} Hz, faster than the platform swings, in "
            f"{where} with {plain(ratio)} times the noise (chance {p:.1g})."
        )
    return (
        f"The residual is not white: between {band[0]:.2g} and {band[1]:.2g} Hz in {where} it has {plain(ratio)} "
        f"times the noise (chance {p:.1g}); χ² is {plain(excess)} too large below {RESIDUALS.whiteness_edges[-1]:g} Hz."
    )
