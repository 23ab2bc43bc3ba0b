"""Cable stretch per tension, by statics: lengths of measured poses against load cells.

With locked winches a window's cables differ from a constant by stretch alone, κ f. One κ for all cables and windows, a
constant for each cable and window, and one delay of the cells (clock, filter and viscoelastic lag, which cannot be
told apart). The motion itself hardly tells κ (a factor of 2 at best), while wrong ones bend the body: a fit with
elastic cables takes it from here where the campaign has load cells and three markers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import Series
from fidim_lab.data.records import Robot, Window
from fidim_lab.identification.equations.uncertainty import MIN_WINDOWS
from fidim_lab.identification.motion import rigid
from fidim_lab.model.mechanism import Mechanism

DELAYS = 0.005 * np.arange(-12, 13)
"""s; the cells are read so much later than the markers"""
LEAST_EXPLAINED = 0.01
CLEAR = 3.0
"""standard deviations from zero below which nothing was measured"""


@dataclass(frozen=True)
class ElasticStretch:
    """What statics says of elastic cables."""

    softness: float
    """m/N, of every cable"""
    sd: float
    """m/N: jackknife over windows"""
    delay: float
    """s, by which the cells lag"""
    explained: float
    """share of the lengths' variance within windows that stretch explains"""

    @property
    def doubt(self) -> float:
        """m/N, the uncertainty to use: jackknife together with the part of the lengths that stretch does not explain.

        Lengths by tensions give κ, tensions by lengths κ/R²: were the cells as wrong as the lengths, κ/R would be true.
        """
        return float(np.hypot(self.sd, self.softness * (1 / np.sqrt(max(self.explained, LEAST_EXPLAINED)) - 1)))

    @property
    def clear(self) -> bool:
        """Whether it is positive beyond doubt."""
        return self.softness > CLEAR * self.sd


@dataclass(frozen=True, eq=False)
class _Sums:
    """Normal equations of one window at every delay: f·f, f·l and l·l (N², N m, m²) about the cables' means."""

    ff: Series
    fl: Series
    ll: Series

    def __add__(self, other: "_Sums") -> "_Sums":
        return _Sums(self.ff + other.ff, self.fl + other.fl, self.ll + other.ll)


def seen_stretch(robot: Robot, windows: Sequence[Window]) -> ElasticStretch | None:
    """κ from the windows' columns f1 … fn (N) and whole poses; None where fewer than three windows hold them."""
    mechanism = Mechanism(robot)
    sums = [found for window in windows if (found := _sums(mechanism, window)) is not None]
    if len(sums) < MIN_WINDOWS:
        return None
    total = sum(sums[1:], sums[0])
    softness, at = _best(total)
    without = [_best(sum((s for s in sums if s is not out), _Sums(*(np.zeros(len(DELAYS)),) * 3)))[0] for out in sums]
    count = len(sums)
    sd = float(np.sqrt((count - 1) / count * np.sum((np.array(without) - np.mean(without)) ** 2)))
    explained = float(total.fl[at] ** 2 / (total.ff[at] * total.ll[at]))
    return ElasticStretch(softness, sd, float(DELAYS[at]), explained)


def _best(sums: _Sums) -> tuple[float, int]:
    """Slope at the delay that leaves least."""
    left = 1 - sums.fl**2 / (sums.ff * sums.ll)
    at = int(np.argmin(left))
    return float(sums.fl[at] / sums.ff[at]), at


def _sums(mechanism: Mechanism, window: Window) -> _Sums | None:
    names = [f"f{k + 1}" for k in range(mechanism.n)]
    body_markers = mechanism.robot.markers[: window.markers.shape[1]]
    if any(name not in window.further for name in names) or rigid.spread(body_markers) <= rigid.MIN_SPREAD:
        return None
    cells = np.column_stack([window.further[name] for name in names])
    positions, rotations, _ = rigid.register(
        window.markers, body_markers, np.isfinite(window.markers).all(axis=2).astype(float)
    )
    # frames at the ends have no cells at every delay; all delays are judged on the same ones
    inner = (window.t >= window.t[0] + DELAYS.max()) & (window.t <= window.t[-1] + DELAYS.min())
    use = inner & np.isfinite(positions).all(axis=1)
    known = np.isfinite(cells).all(axis=1)
    if use.sum() < 2 * mechanism.n or known.sum() < 2 * mechanism.n:
        return None
    lengths = mechanism.lengths(positions[use], rotations[use])
    lengths = lengths - lengths.mean(axis=0)
    ff, fl, ll = [], [], []
    for delay in DELAYS:
        read = np.column_stack(
            [np.interp(window.t[use] + delay, window.t[known], cells[known, k]) for k in range(mechanism.n)]
        )
        read -= read.mean(axis=0)
        ff.append(float((read**2).sum()))
        fl.append(float((read * lengths).sum()))
        ll.append(float((lengths**2).sum()))
    if min(ff) <= 0 or min(ll) <= 0:
        return None
    return _Sums(np.array(ff), np.array(fl), np.array(ll))
