"""Time stamps of a window: the even grid behind them, and what is wrong with them."""

from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import Series
from fidim_lab.data.records import Window
from fidim_lab.identification.markers.finding import DefectKind, Finding
from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True, eq=False)
class EvenGrid:
    """Where the rows of a window lie on an even time grid."""

    slots: np.ndarray
    """(N,) int, increasing; a number that is left out is a missing row"""
    step: float
    """s"""
    jitter: float
    """largest distance of a stamp from its slot, of a step"""

    def spread(self, columns: np.ndarray) -> np.ndarray:
        """Columns (N, K) on the grid (G, K), NaN where there is no row."""
        out = np.full((int(self.slots[-1]) + 1, columns.shape[1]), np.nan)
        out[self.slots] = columns
        return out


def even_grid(t: Series) -> EvenGrid:
    """The grid of the median step; slow drifts of the stamps are followed."""
    steps = np.diff(t)
    step = float(np.median(steps))
    whole = np.maximum(1, np.rint(steps / step)).astype(int)
    slots = np.concatenate([[0], np.cumsum(whole)])
    off = np.abs(steps - whole * step) / step
    return EvenGrid(slots, step, float(off.max(initial=0.0)))


def check_clock(window: Window, rate: float) -> tuple[Finding, ...]:
    """Uneven stamps, stamps of another rate, rows that are missing."""
    grid = even_grid(window.t)
    begin, end = float(window.t[0]), float(window.t[-1])
    found: list[Finding] = []
    if abs(grid.step * rate - 1) > MARKERS.other_rate:
        says = (
            f"Window {window.id}: samples come every {grid.step * 1e3:.4g} ms; the campaign says {1e3 / rate:.4g} ms "
            f"({rate:g} Hz)."
        )
        found.append(Finding(DefectKind.CLOCK, window.id, "t", (begin, end), grid.step - 1 / rate, "s", says))
    if grid.jitter > MARKERS.clock_check_uneven:
        worst = int(np.argmax(np.abs(np.diff(window.t) - np.diff(grid.slots) * grid.step)))
        size, at = grid.jitter * grid.step, float(window.t[worst + 1])
        says = f"Window {window.id}: time stamps are uneven by up to {size * 1e3:.3g} ms (at {at:.3f} s)."
        found.append(Finding(DefectKind.CLOCK, window.id, "t", (at, at), size, "s", says))
    missing = np.diff(grid.slots) - 1
    for row in np.flatnonzero(missing):
        t = (float(window.t[row]), float(window.t[row + 1]))
        says = f"Window {window.id}: {missing[row]} rows are missing between {t[0]:.3f} and {t[1]:.3f} s."
        found.append(Finding(DefectKind.GAP, window.id, "t", t, float(missing[row]), "samples", says))
    return tuple(found)
