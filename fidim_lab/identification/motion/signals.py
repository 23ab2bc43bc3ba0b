"""From recorded samples to usable values, first and second derivatives: grid, gaps, filter.

`uniform` puts a recording on an even grid and fills short gaps; `smooth` filters and differentiates what is whole.
Nothing is repaired silently: every step adds a note.

A sample may be used when the whole kernel around it lies on measured (or shortly interpolated) samples: within half a
kernel of an end or of a longer gap it may not. Odd reflection would keep the ends but bends the acceleration there
towards zero; with windows of many periods the lost share costs less than that bias (`Edges` chooses).
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from fidim_lab.arrays import Mask, Series, runs
from fidim_lab.errors import SetupError
from fidim_lab.identification.motion.filters import Derivatives, Edges, FilterDesign, Kernels, convolve, design

MAX_GAP = 0.05
"""s; a gap up to this long is interpolated: half a period of the 10 Hz that the filter stops"""
JITTER = 0.02
"""of one step; time stamps further from an even grid are interpolated to it"""


@dataclass(frozen=True, eq=False)
class Track:
    """Signals on an even time grid; NaN where nothing was measured and nothing may be filled in."""

    t: Series
    """s, even"""
    values: np.ndarray
    """(N, K)"""
    notes: tuple[str, ...] = ()
    """what was repaired, for people"""

    @property
    def rate(self) -> float:
        """Hz"""
        return (len(self.t) - 1) / float(self.t[-1] - self.t[0])


@dataclass(frozen=True, eq=False)
class Smooth:
    """Filtered signals with their derivatives on the same grid; trust a row only where `usable`."""

    t: Series
    value: np.ndarray
    """(N, K)"""
    first: np.ndarray
    """(N, K), 1/s"""
    second: np.ndarray
    """(N, K), 1/s²"""
    usable: Mask

    def at(self, rows: np.ndarray) -> "Smooth":
        """Only some rows, by index or mask."""
        return Smooth(self.t[rows], self.value[rows], self.first[rows], self.second[rows], self.usable[rows])


def uniform(t: Series, values: np.ndarray, rate: float) -> Track:
    """Signals (N, K) recorded at times t (s) on the even grid of `rate` Hz, short gaps filled by a cubic spline.

    Rows that are absent from the file and NaN entries are the same to us: missing. A row in which a signal is missing
    stays NaN in that column when the gap is longer than 0.05 s. Stamps off the grid by more than 2 % of a step are
    interpolated to it. Raises SetupError when the stamps do not belong to this rate at all.
    """
    if len(t) < 2:
        raise SetupError(f"{len(t)} samples are not a recording.")
    steps = (t - t[0]) * rate
    step = float(np.median(np.diff(steps)))
    if not 0.8 < step < 1.25:
        raise SetupError(
            f"The time stamps come every {step / rate:.5g} s, the campaign says {rate:g} Hz.",
            hint="Correct sample_rate in campaign.toml.",
        )
    notes: list[str] = []
    slots = np.rint(steps).astype(int)
    shift = steps - slots
    drift = abs(shift[-1]) > 0.5 or np.abs(shift).max() > JITTER or len(np.unique(slots)) < len(slots)
    grid = t[0] + np.arange(slots[-1] + 1) / rate
    if drift:
        notes.append(f"time stamps are up to {np.abs(shift).max() / rate * 1e3:.2f} ms off an even grid: interpolated")
    columns = [_column(t, values[:, k], grid, slots, drift) for k in range(values.shape[1])]
    filled = sum(c[1] for c in columns)
    if filled:
        notes.append(f"{filled} missing values in gaps of up to {MAX_GAP:g} s interpolated")
    out = np.stack([c[0] for c in columns], axis=1)
    left = int(np.isnan(out).any(axis=1).sum())
    if left:
        notes.append(f"{left} samples ({left / rate:.2f} s) are missing in longer gaps: cut out")
    return Track(grid, out, tuple(notes))


def _column(t: Series, x: Series, grid: Series, slots: np.ndarray, drift: bool) -> tuple[Series, int]:
    """One signal on the grid, and how many missing values were filled."""
    known = np.isfinite(x)
    if known.sum() < 4:
        return np.full(len(grid), np.nan), 0
    measured = np.zeros(len(grid), dtype=bool)
    measured[slots[known]] = True
    if measured.all() and not drift:
        return x.copy(), 0
    out = CubicSpline(t[known], x[known])(grid)
    if not drift:
        out[slots[known]] = x[known]
    allowed = MAX_GAP * (len(grid) - 1) / (grid[-1] - grid[0]) + 1e-6
    for begin, end in runs(~measured):
        at_end = begin == 0 or end == len(grid)
        if at_end or end - begin > allowed:  # nothing is extrapolated
            out[begin:end] = np.nan
    return out, int(np.isfinite(out).sum() - measured.sum())


def smooth(track: Track, spec: FilterDesign) -> Smooth:
    """Low-pass and differentiate every whole stretch of the track; rows near ends and gaps are marked not usable.

    Raises SetupError (from `design`) when rate or duration do not allow the filter.
    """
    kernels = design(spec, track.rate, float(track.t[-1] - track.t[0]))
    shape = track.values.shape
    out = [np.full(shape, np.nan) for _ in range(3)]
    usable = np.zeros(shape[0], dtype=bool)
    for begin, end in runs(np.asarray(np.isfinite(track.values).all(axis=1))):
        inner, parts = _filter_stretch(track.values[begin:end], kernels, spec)
        for target, part in zip(out, parts, strict=True):
            target[begin + inner : begin + inner + len(part)] = part
        usable[begin + inner : begin + inner + len(parts[0])] = True
    return Smooth(track.t, out[0], out[1], out[2], usable)


def _filter_stretch(x: np.ndarray, kernels: Kernels, spec: FilterDesign) -> tuple[int, tuple[np.ndarray, ...]]:
    """Index of the first usable row, and value, first and second derivative from there on."""
    M = kernels.half
    inner = M
    if spec.edges is Edges.REFLECT and len(x) > M:
        head, tail = 2 * x[0] - x[M:0:-1], 2 * x[-1] - x[-2 : -M - 2 : -1]
        x, inner = np.concatenate([head, x, tail]), 0
    if len(x) <= 2 * M + 2:
        return 0, (np.empty((0, x.shape[1])),) * 3
    value = convolve(kernels.value, x)
    if spec.derivatives is Derivatives.MATCHED:
        return inner, (value, convolve(kernels.first, x), convolve(kernels.second, x))
    first = np.gradient(value, 1 / kernels.rate, axis=0)
    return inner, (value, first, np.gradient(first, 1 / kernels.rate, axis=0))
