"""One window for a trajectory fit: times from its first usable sample, markers, one length for each cable.

Any sampling and any gaps: a missing coordinate gives no residual, nothing is interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import PerCable, Series
from fidim_lab.data.records import Robot, Window
from fidim_lab.errors import RefusedError

SHORTEST = 0.3
"""s; less does not show an initial velocity"""
FEWEST = 8
"""samples"""
OPENING = 0.1
"""s, of the readings that say where an encoder began"""
PARABOLA = 2
"""degree of the course through them"""
FARTHEST = 20.0
"""times the robot's own size that a marker may be away from its middle: beyond, units or frames are mixed up"""


@dataclass(frozen=True, eq=False)
class FollowedSamples:
    """The samples of one window that hold at least one coordinate."""

    window: Window
    begin: float
    """s on the window's own clock (0 at its first row) at the first sample here"""
    t: Series
    """s since `begin`"""
    markers: Float[np.ndarray, "T M 3"]
    """m; NaN where missing"""
    lengths: PerCable
    """m, mean of the encoder over the window; NaN for a cable without one, or of which it is no measurement"""
    first_lengths: PerCable
    """m, of the encoder at `begin`: what counts where it turns with the cable's tension"""

    @property
    def end(self) -> float:
        """Time of the last sample, s since `begin`."""
        return float(self.t[-1])

    def read(self, yielding: Sequence[int]) -> PerCable:
        """Lengths at the start, m: the mean of each encoder, or its first reading where it turns with the tension.

        yielding: indices (0-based) of these. Their means would be those of a tension that swings all the while.
        """
        lengths = self.lengths.copy()
        lengths[list(yielding)] = self.first_lengths[list(yielding)]
        return lengths

    def seen_until(self, end: float) -> tuple[Bool[np.ndarray, " T"], Bool[np.ndarray, "K M 3"]]:
        """Which samples lie within the first `end` seconds, and which of their coordinates are there."""
        use = self.t <= end + 1e-9
        return use, np.isfinite(self.markers[use])

    def until(self, end: float) -> "FollowedSamples":
        """The first `end` seconds; the lengths stay those of the whole."""
        use, _ = self.seen_until(end)
        return replace(self, t=self.t[use], markers=self.markers[use])


def prepare(window: Window, robot: Robot) -> FollowedSamples:
    """The recording of a window. Raises RefusedError, naming the window, where it is too short or in wrong units."""
    rows = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    if len(rows) < FEWEST:
        raise RefusedError(f"Window {window.id}: {len(rows)} samples hold a marker; at least {FEWEST} are needed.")
    t = window.t[rows] - window.t[rows[0]]
    if t[-1] < SHORTEST:
        raise RefusedError(f"Window {window.id} lasts {t[-1]:.2f} s; at least {SHORTEST:g} s are needed.")
    _refuse_far(window, robot)
    if window.lengths_by_poses:
        window = replace(window, lengths=None)
    return FollowedSamples(
        window=window,
        begin=float(window.t[rows[0]] - window.t[0]),
        t=t,
        markers=window.markers[rows],
        lengths=_encoder_means(window, robot.n),
        first_lengths=_encoder_at(window, robot.n, float(window.t[rows[0]])),
    )


def _encoder_means(window: Window, cables: int) -> PerCable:
    means = np.full(cables, np.nan)
    if window.lengths is not None:
        known = np.isfinite(window.lengths).any(axis=0)
        means[known] = np.nanmean(window.lengths[:, known], axis=0)
    return means


def _encoder_at(window: Window, cables: int, begin: float) -> PerCable:
    """By a parabola through the first readings; the mean where there are too few.

    A body let go from rest has tensions that change with the square of time: a line would be off by l̈ `OPENING`²/12,
    three resolutions of an encoder where the winch yields by a third of a millimetre.
    """
    found = _encoder_means(window, cables)
    if window.lengths is None:
        return found
    early = (window.t >= begin) & (window.t <= begin + OPENING)
    for k in range(cables):
        known = early & np.isfinite(window.lengths[:, k])
        if known.sum() > PARABOLA + 1:
            course = np.polynomial.Polynomial.fit(window.t[known] - begin, window.lengths[known, k], PARABOLA)
            found[k] = float(course(0.0))
    return found


def _refuse_far(window: Window, robot: Robot) -> None:
    anchors = np.array([cable.d for cable in robot.cables])
    middle = anchors.mean(axis=0)
    size = max(1.0, float(np.linalg.norm(anchors - middle, axis=1).max()))
    away = float(np.nanmax(np.linalg.norm(window.markers - middle, axis=2)))
    if away > FARTHEST * size:
        raise RefusedError(
            f"Window {window.id}: a marker is {away:.4g} m away from the middle of the anchors; the robot is "
            f"{size:.2g} m large.",
            hint="Check units (metres are expected) and frame of the motion capture.",
        )
