"""Time stamps: whether they are instants of the samples or of their arrival.

Samples are taken evenly; a computer that stamps them on arrival bunches and delays them. Which of several times the
samples were taken at, their own smoothness tells: on wrong ones a swing looks rough. Which of two rates near each
other is right, header's or stamps', is for the fit to weigh (`identification.two_clocks`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.data.records import Campaign, Window
from fidim_lab.identification.cleaning.clock_jumps import BESIDE, quartic_misfit
from fidim_lab.identification.cleaning.removed import CleanRecordings
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.neighbours import noise_of

NEAR = 0.005
"""of the header's rate, within which it counts before the mean rate of arrivals, which queues stretch"""
UNEVEN = 0.05
"""of a step: stamps nearer to an even grid than this need no other"""
SMOOTHER = 0.9
"""times the roughness with the stamps as they are that an even grid must come down to, where one marker was seen 1000
times: six standard deviations of it. They shrink with the root of the number of coordinates: five windows of four
markers and jitter of half their noise have 0.94, where 0.97 is enough"""
COORDINATES = 3000
"""of one marker seen 1000 times"""
AVERAGED = 7
"""samples, over which a speed is averaged"""
EARLIEST = 0.02
"""quantile of how late stamps are that counts as no delay: single early stamps are the clock's own steps"""


def retimed(campaign: Campaign) -> CleanRecordings:
    """The campaign with evenly spaced time stamps, where its files hold only times of arrival."""
    windows = list(campaign.windows)
    tried = {k: found for k, w in enumerate(windows) if (found := _evened(w, campaign.sample_rate)) is not None}
    ratios = [found.even / found.stamped for found in tried.values()]
    enough = _enough(sum(found.coordinates for found in tried.values()))
    together = bool(ratios) and float(np.sqrt(np.mean(np.square(ratios)))) < enough
    moved: dict[str, float] = {}
    for k, found in tried.items():
        # one recorder wrote all windows: what they show together holds where one alone shows little
        if found.even < (1.0 if together else _enough(found.coordinates)) * found.stamped:
            window = windows[k]
            moved[window.id] = float(np.abs(found.times - window.t).max())
            windows[k] = replace(window, t=found.times)
    if not moved:
        return CleanRecordings(campaign)
    worst = max(moved, key=lambda id: moved[id])
    note = (
        f"The time stamps of {len(moved)} windows ({', '.join(moved)}) are times of arrival, up to "
        f"{1e3 * moved[worst]:.1f} ms off (window {worst}): on an even grid the motion is smooth, on the stamps it is "
        "not. The even times are used."
    )
    return CleanRecordings(replace(campaign, windows=tuple(windows)), notes=(note,))


def _enough(coordinates: int) -> float:
    """As `SMOOTHER`, for so many of them."""
    return 1.0 - (1.0 - SMOOTHER) * float(np.sqrt(COORDINATES / max(coordinates, 1)))


@dataclass(frozen=True, eq=False)
class _Evened:
    """Even times at which the samples of a window may have been taken."""

    times: Series
    """s"""
    even: float
    """roughness of the motion on them, m"""
    stamped: float
    """on the stamps as they are, m"""
    coordinates: int
    """that were seen"""


def _evened(window: Window, rate: float) -> _Evened | None:
    """None where the stamps are even already, rows lost or not: a clock that jumps is seen by the step after this."""
    if len(window.t) < 30:
        return None
    candidates = _candidates(window.t, rate)
    if min(grid.jitter for grid in candidates) < UNEVEN:
        return None
    columns = window.markers.reshape(len(window.t), -1)
    columns = columns[:, np.isfinite(columns).mean(axis=0) > 0.5]
    if not columns.shape[1]:
        return None
    rows, *skipping = candidates
    chosen = min(skipping, key=lambda one: _skipped(columns, one, rows), default=rows)
    chosen = chosen if _skipped(columns, chosen, rows) < 0 else rows
    even, as_stamped = (_roughness(columns, window.t, chosen, stamped=stamped) for stamped in (False, True))
    return _Evened(chosen.times, even, as_stamped, int(np.isfinite(columns).sum()))


@dataclass(frozen=True, eq=False)
class _Grid:
    slots: np.ndarray
    """(N,) int, increasing"""
    step: float
    begin: float
    jitter: float
    """largest distance of a stamp from its slot, of a step"""

    @property
    def times(self) -> Series:
        """s"""
        return self.begin + self.slots * self.step


def _candidates(t: Series, rate: float) -> list[_Grid]:
    """Grids on which the samples may have been taken: no row lost, or rows lost where stamps leave room for them."""
    rows = np.arange(len(t))
    slope = mean_step(rows, t)
    step = 1.0 / rate if abs(slope * rate - 1) < NEAR else slope
    rounded = even_grid(t)
    late = t - t[0] - step * rows
    room = np.floor((t - t[0] - np.quantile(late, EARLIEST)) / (1.0 / rate) + UNEVEN).astype(int)
    latest = np.minimum.accumulate((room - rows)[::-1])[::-1] + rows  # each slot before the next one
    grids = [_grid(t, rows, step)]
    grids.append(_grid(t, rounded.slots, step))
    if np.all(np.diff(latest) > 0):
        grids.append(_grid(t, latest - latest[0], 1.0 / rate))
    return grids


def _skipped(columns: Float[np.ndarray, "N K"], grid: _Grid, rows: _Grid) -> float:
    """How much rougher the motion is where this grid leaves slots out than without: below 0, rows were lost there."""
    total = 0.0
    for row in np.flatnonzero(np.diff(grid.slots) > 1):
        near = slice(max(0, row + 1 - BESIDE), row + 1 + BESIDE)
        values = columns[near]
        values = values[:, np.isfinite(values).all(axis=0)]
        if values.shape[1] and len(values) == 2 * BESIDE:
            total += quartic_misfit(grid.slots[near], values) - quartic_misfit(rows.slots[near], values)
    return total


def _grid(t: Series, slots: np.ndarray, step: float) -> _Grid:
    off = t - slots * step
    begin = float(np.quantile(off, EARLIEST))
    return _Grid(slots, step, begin, float(np.abs(off - np.median(off)).max()) / step)


def mean_step(rows: np.ndarray, t: Series) -> float:
    """Slope (s) of a line that late stamps do not move: least squares, then without the latest half, twice."""
    use = np.ones(len(t), dtype=bool)
    slope, begin = 1.0, 0.0
    for _ in range(3):
        slope, begin = np.polyfit(rows[use], t[use], 1)
        off = t - slope * rows - begin
        use = off <= np.quantile(off, 0.5)
    return float(slope)


def _roughness(columns: Float[np.ndarray, "N K"], t: Series, grid: _Grid, *, stamped: bool) -> float:
    """rms over the columns of what no smooth motion explains, m; `stamped`: if the samples were taken at their stamps.

    Then they are brought to the grid to first order, with the speed of the smooth motion between.
    """
    if stamped:
        speed = _averaged(np.gradient(columns, grid.times, axis=0))
        columns = columns - speed * (t - grid.times)[:, np.newaxis]
    spread = np.full((int(grid.slots[-1]) + 1, columns.shape[1]), np.nan)
    spread[grid.slots] = columns
    return float(np.sqrt(np.nanmean(noise_of(spread) ** 2)))


def _averaged(values: Float[np.ndarray, "N K"]) -> Float[np.ndarray, "N K"]:
    """Over `AVERAGED` rows, so that speeds hold less noise than positions; missing rows are left out."""
    seen = np.isfinite(values)
    taps = np.ones(AVERAGED)
    total = np.stack([np.convolve(np.where(s, v, 0.0), taps, "same") for s, v in zip(seen.T, values.T, strict=True)])
    count = np.stack([np.convolve(s, taps, "same") for s in seen.T])
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).T
