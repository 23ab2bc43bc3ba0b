"""Samples off the fitted motion made missing: spikes and steps too small, or too well hidden, for screening.

    after = without_breaks(cleaned, leftovers)     what a fit leaves of whole windows, or of segments of them

What stands out is found by `breaks`. A marker known to be faulty by many spikes is looked at more closely, and one that
jumps at about the same time of several windows at that time of the others.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.identification.markers.clock_check import EvenGrid, even_grid
from fidim_lab.identification.markers.displaced import ScoreLimits
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel, marker_jump, marker_name
from fidim_lab.identification.markers.levels import displaced_rows
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.residuals.breaks import breaks_of
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.thresholds import SHARED

NEVER = (np.inf, np.inf)
CLOSER = ScoreLimits(4.2, 4.7)
"""of its single samples: of 20 000 good ones about one and a half are lost"""


@dataclass(frozen=True, eq=False)
class _Off:
    """What is off in one marker of one window: rows with sizes (m), and steps of all from a row on (m)."""

    window: Window
    marker: int
    noise: float
    """m"""
    spikes: dict[int, float]
    steps: dict[int, np.ndarray]

    def bad(self) -> np.ndarray:
        """(N,) rows to be taken out."""
        window, marker = self.window, self.marker
        seen = np.asarray(np.isfinite(window.markers[:, marker]).all(axis=1))
        found = displaced_rows(window.t, seen, self.steps, MARKERS.levels_same * self.noise)
        found[list(self.spikes)] = True
        return found

    def findings(self) -> list[Finding]:
        """A sentence for each."""
        return [*(self._spike(*one) for one in self.spikes.items()), *(self._step(*one) for one in self.steps.items())]

    def _spike(self, row: int, size: float) -> Finding:
        window, marker, time = self.window, self.marker, float(self.window.t[row])
        says = f"Window {window.id}: {marker_name(marker)} is {size * 1e3:.3g} mm off the motion at {time:.3f} s."
        return Finding(DefectKind.SPIKE, window.id, marker_channel(marker, 0), (time, time), size, "m", says)

    def _step(self, row: int, by: np.ndarray) -> Finding:
        t = (float(self.window.t[row]), float(self.window.t[-1]))
        sign = "; the motion continues unchanged."
        return marker_jump(self.window.id, self.marker, by, t, digits=3, sign=sign)


def without_breaks(cleaned: Cleaned, left: Sequence[Leftover], *, astray: bool = False) -> Cleaned | None:
    """Without what is off the motion that a fit of `cleaned.campaign` found; None where nothing is.

    left: what that fit leaves of windows, or of parts of them that bear their window's id. astray: it does not follow
    them.
    """
    windows = {window.id: window for window in cleaned.campaign.windows}
    strict = ScoreLimits.for_tests(
        sum(window.markers.shape[0] * window.markers.shape[1] for window in windows.values())
    )
    known = _Known.of(cleaned)
    off: dict[tuple[str, int], _Off] = {}
    for one in left:
        for marker in range(one.values.shape[1]):
            found = off.setdefault((one.window, marker), _Off(windows[one.window], marker, one.noise, {}, {}))
            _add(found, one, strict, known, CLEANING.clearer_astray if astray else MARKERS.rivals_clearer)
    found = [one for one in off.values() if one.spikes or one.steps]
    if not found:
        return None
    faults: list[Finding] = []
    for one in found:
        markers = windows[one.window.id].markers.copy()
        markers[one.bad(), one.marker] = np.nan
        windows[one.window.id] = replace(windows[one.window.id], markers=markers)
        faults += one.findings()
    campaign = replace(cleaned.campaign, windows=tuple(windows.values()))
    return replace(cleaned, campaign=campaign, faults=(*cleaned.faults, *faults))


@dataclass(frozen=True)
class _Known:
    """Markers (0-based) that were found to be faulty again and again."""

    spiking: frozenset[int]
    jumps: Mapping[int, Mapping[str, float]]
    """of those that jump: in which windows, and when first, s on their own clocks"""

    @staticmethod
    def of(cleaned: Cleaned) -> "_Known":
        """By the faults that were found so far."""
        most = max((window.markers.shape[1] for window in cleaned.campaign.windows), default=0)
        channels = {marker_channel(marker, axis): marker for marker in range(most) for axis in range(3)}
        spikes: Counter[int] = Counter()
        jumps: dict[int, dict[str, float]] = {}
        for fault in cleaned.faults:
            marker = channels.get(fault.channel)
            if marker is not None and fault.kind is DefectKind.SPIKE:
                spikes[marker] += 1
            elif (
                marker is not None
                and fault.kind is DefectKind.JUMP
                and fault.window is not None
                and fault.t is not None
            ):
                first = jumps.setdefault(marker, {})
                first[fault.window] = min(fault.t[0], first.get(fault.window, np.inf))
        return _Known(
            frozenset(marker for marker, count in spikes.items() if count >= CLEANING.off_motion_many),
            {marker: windows for marker, windows in jumps.items() if len(windows) >= SHARED.repeated},
        )

    def expected(self, marker: int, window: str) -> tuple[float, float]:
        """s: when a marker that jumps at about the same time in most of the windows in which it does is to jump here.

        `NEVER` where its jump is known, or no time is usual.
        """
        windows = self.jumps.get(marker, {})
        times = np.array(list(windows.values()))
        usual = float(np.median(times)) if len(times) else np.nan
        often = window not in windows and np.sum(np.abs(times - usual) < SHARED.at_once) > len(times) / 2
        return (usual - SHARED.at_once, usual + SHARED.at_once) if often else NEVER


def _add(off: _Off, left: Leftover, limits: ScoreLimits, known: _Known, clearer: float) -> None:
    """What is found in one leftover."""
    values = left.values[:, off.marker]
    if np.isfinite(values).all(axis=1).sum() < MARKERS.samples_fewest:
        return
    grid = even_grid(left.t)
    spikes = CLOSER if off.marker in known.spiking else None
    jumps = _rows(left, grid, known.expected(off.marker, left.window)) if off.marker in known.jumps else None
    found = breaks_of(grid.spread(values), grid.step, limits, clearer=clearer, spikes=spikes, jumps=jumps)
    for row in found.spikes if len(found.spikes) < SHARED.few * len(values) else ():
        size = float(np.abs(values[np.searchsorted(grid.slots, row)]).max())
        off.spikes[_row(off.window, left, grid, row)] = size * left.noise
    for row, by in found.steps:
        off.steps[_row(off.window, left, grid, row)] = by * left.noise


def _rows(left: Leftover, grid: EvenGrid, times: tuple[float, float]) -> slice:
    """Of a leftover's grid, between two times (s)."""
    begin, end = np.append(grid.slots, grid.slots[-1] + 1)[np.searchsorted(left.t, times)]
    return slice(int(begin), int(end))


def _row(window: Window, left: Leftover, grid: EvenGrid, row: int) -> int:
    """Of a window, for a row of a leftover's grid."""
    time = float(left.t[np.searchsorted(grid.slots, row)])
    return int(np.searchsorted(window.t, time - 0.25 * grid.step))
