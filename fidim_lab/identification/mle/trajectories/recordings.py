"""One window for a trajectory fit: times from its first usable sample, markers, one length for each cable.

Any sampling and any gaps: a missing coordinate gives no residual, nothing is interpolated.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import PerCable, Series
from fidim_lab.data.own_sensors import angular_rates, has_rates_alone
from fidim_lab.data.records import Robot, Window
from fidim_lab.errors import RefusedError
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.grid import Grid, Resolution
from fidim_lab.model.sensitivity.measurement import MotionSensor
from fidim_lab.model.side_by_side import cores

BATCH = 12
"""windows integrated together, if they have one or two markers; fewer with more"""
NODES = 3000
"""of all of these together, if they are more than one: what long ones need stays in a core's cache"""
LONG = 30.0
"""s of all recordings together, from which they are shared out among the cores"""

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
    evening: Float[np.ndarray, "M 3 3"] | None = None
    """for each marker, by which its noise becomes even and as large as stated; None where it is (`noise_shape`)"""

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


def prepare(window: Window, robot: Robot, *, rates: bool = False) -> FollowedSamples:
    """The recording of a window. Raises RefusedError, naming the window, where it is too short or in wrong units.

    rates: of its gyroscope, whose angular rates (rad/s) stand in the place of a marker's coordinates.
    """
    if rates:
        window = replace(window, markers=angular_rates(window)[:, np.newaxis])
    elif has_rates_alone(window):
        says = f"Window {window.id}: a gyroscope's rates alone, which fidim identify takes; this asks for markers."
        raise RefusedError(says)
    rows = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    what = "an angular rate" if rates else "a marker"
    if len(rows) < FEWEST:
        raise RefusedError(f"Window {window.id}: {len(rows)} samples hold {what}; at least {FEWEST} are needed.")
    t = window.t[rows] - window.t[rows[0]]
    if t[-1] < SHORTEST:
        raise RefusedError(f"Window {window.id} lasts {t[-1]:.2f} s; at least {SHORTEST:g} s are needed.")
    if not rates:
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


def body_changes(recordings: Sequence[FollowedSamples]) -> Float[np.ndarray, "W 9"] | None:
    """What the body of each window has beyond the shared one; None where it is the same in all."""
    changes = [recording.window.body_change for recording in recordings]
    if all(change is None for change in changes):
        return None
    return np.array([np.zeros(BODY) if change is None else change for change in changes])


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


def in_batches(
    recordings: Sequence[FollowedSamples],
    measurement: MotionSensor,
    ends: Float[np.ndarray, " W"],
    resolution: Resolution,
) -> Iterator[tuple[np.ndarray, Grid]]:
    """Indices of recordings of similar length, each batch with a grid that reaches its longest end (s)."""
    most = max(recording.markers.shape[1] for recording in recordings)
    longest = Grid.covering(measurement.latest(float(ends.max())), resolution)
    size = max(1, min(BATCH // max(1, most // 2), NODES // longest.nodes))
    if float(ends.sum()) > LONG:
        size = min(size, -(-len(ends) // cores()))
    order = np.argsort(ends, kind="stable")
    for first in range(0, len(order), size):
        members = order[first : first + size]
        yield members, Grid.covering(measurement.latest(float(ends[members].max())), resolution)


def body_markers(
    recordings: Sequence[FollowedSamples], robot: Robot, members: Sequence[int] | np.ndarray
) -> Float[np.ndarray, "M 3"]:
    """As many of the robot's markers (body frame, m) as the windows of a batch have at most."""
    return robot.markers[: max(recordings[w].markers.shape[1] for w in members)]


def rows_of(values: np.ndarray | None, members: np.ndarray) -> np.ndarray | None:
    """Those rows of an array that may not be there."""
    return None if values is None else values[members]
