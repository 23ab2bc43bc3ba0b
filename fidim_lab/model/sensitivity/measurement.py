"""What the cameras make of moving markers, with derivatives: the slots marker, true_time and seen of effects.

A marker that is elsewhere moves all its nodes; a frame stamped t shows the motion at its true time; what is seen there
may be turned, shifted or displaced. `Measurement.of` says what a mechanism's effects do at one θ; without such effects
it only interpolates. Times count from a recording's first sample: an offset common to all of them is a gauge of free
motion, which the window's start takes up, so `time-offset` has no influence here and stays unidentified.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.model.batch import function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import extra_count, marker_at, seen_at, true_time_at
from fidim_lab.model.motion.equations import Symbols
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.markers import at_nodes, between, hermite
from fidim_lab.model.slots import Effect, PlatformState

SLOTS = ("marker", "seen", "true_time")
SHIFT = 1e-4
"""s, over which velocities are differences"""
INVERSIONS = 6
"""fixed-point steps from a reported to a real point: each gains a factor of the (small) turn"""


def measures(effect: Effect) -> bool:
    """Whether an effect changes what the cameras report."""
    return any(getattr(type(effect), name) is not getattr(Effect, name) for name in SLOTS)


@dataclass(frozen=True, eq=False)
class Measurement:
    """The cameras at one θ."""

    mechanism: Mechanism
    theta: Float[np.ndarray, " theta"]

    @property
    def plain(self) -> bool:
        """Whether no effect changes anything."""
        return not any(measures(effect) for effect in self.mechanism.effects)

    def places(self, markers: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "M 3"]:
        """Where these markers of the robot file really are, body frame, m."""
        return markers if self.plain else self._moved(markers)[0]

    def latest(self, end: float) -> float:
        """True time (s) until which a motion must be known for stamps up to `end`."""
        return end if self.plain else max(end, float(self._times(np.array([end]))[0][0]))

    def seen(
        self,
        nodal: Float[np.ndarray, "N 3 M 3"],
        nodes: Series,
        stamps: Series,
        begin: float,
        extra: Float[np.ndarray, " extra"] | None = None,
    ) -> Float[np.ndarray, "T M 3"]:
        """What is reported at stamps (s since the recording's `begin`, itself s since its window's), m.

        nodal: of the real places, by `at_nodes`. extra: effects' own states of this window; those that cameras see do
        not change within it.
        """
        times = self._times(stamps)[0]
        points = between(nodal, *hermite(nodes, times))
        return points if self.plain else self._sights(points, begin + times, extra)[0]

    def seen_by(
        self,
        trajectories: Trajectories,
        place: int,
        markers: Float[np.ndarray, "M 3"],
        varied: Float[np.ndarray, "N 3 M 3 P"],
        stamps: Series,
        begin: float,
        extra: tuple[Float[np.ndarray, " extra"], Float[np.ndarray, "extra P"]] | None = None,
    ) -> Float[np.ndarray, "T M 3 P"]:
        """Derivatives of `seen` for the window at `place` of a batch; markers as in the robot file.

        varied: by `varied_at_nodes` at the real places; its last columns are those of θ, what the motion adds to them.
        extra: effects' own states of this window, with their derivatives.
        """
        nodes = trajectories.grid.t
        times, by_theta = self._times(stamps)
        columns = between(varied, *hermite(nodes, times))
        if self.plain:
            return columns
        real, moved = self._moved(markers)
        one = trajectories.only(place)
        nodal = at_nodes(one, real)[0]
        points, later, sooner = (between(nodal, *hermite(nodes, times + s)) for s in (0.0, SHIFT, -SHIFT))
        own = None if extra is None else extra[0]
        _, by_point, by_time, direct, by_extra = self._sights(points, begin + times, own)
        velocity = np.einsum("tmij,tmj->tmi", by_point, (later - sooner) / (2 * SHIFT)) + by_time
        centre = at_nodes(one, np.zeros((1, 3)))[0]
        count = self.theta.size
        arms = [between(at_nodes(one, moved[..., k])[0] - centre, *hermite(nodes, times)) for k in range(count)]
        columns = np.einsum("tmij,tmjp->tmip", by_point, columns)
        columns[..., columns.shape[-1] - count :] += (
            np.einsum("tmij,tmjp->tmip", by_point, np.stack(arms, axis=-1))
            + direct
            + velocity[..., np.newaxis] * by_theta[:, np.newaxis, np.newaxis]
        )
        return columns if extra is None else columns + by_extra @ extra[1]

    def true_points(self, seen: Float[np.ndarray, "M 3"], time: float) -> tuple[np.ndarray, np.ndarray]:
        """Where points reported at a time (s since the window's begin) really were (M, 3), m.

        And the matrices (M, 3, 3) that turn a real velocity into a reported one.
        """
        points = seen
        if self.plain:
            return points, np.broadcast_to(np.eye(3), (len(seen), 3, 3))
        for _ in range(INVERSIONS):
            points = points - (self._sights(points[np.newaxis], np.array([time]))[0][0] - seen)
        return points, self._sights(points[np.newaxis], np.array([time]))[1][0]

    def _times(self, stamps: Series) -> tuple[Series, Float[np.ndarray, "T theta"]]:
        """True times since the recording's first sample, and their derivatives by θ."""
        if self.plain:
            return stamps, np.zeros((len(stamps), self.theta.size))
        given = np.concatenate([[0.0], stamps])[:, np.newaxis]
        time, by = over_samples(_true_times(self.mechanism), len(given), given, self.theta)
        return (time[1:] - time[0])[:, 0], by[1:] - by[0]

    def _moved(self, markers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Real places (M, 3) and their derivatives by θ (M, 3, theta)."""
        count, parts = len(markers), []
        for number in range(1, count + 1):
            place, by = over_samples(_place(self.mechanism, number), 1, markers[number - 1], self.theta)
            parts.append((place[0], by[0].reshape(3, self.theta.size)))
        return np.array([place for place, _ in parts]), np.array([by for _, by in parts])

    def _sights(
        self, points: np.ndarray, times: Series, extra: Float[np.ndarray, " extra"] | None = None
    ) -> tuple[np.ndarray, ...]:
        """Reported points (T, M, 3), their derivatives by the points, by time, by θ and by effects' own states."""
        shape, count = points.shape[:2], extra_count(self.mechanism)
        given = (points.reshape(-1, 3), np.repeat(times, shape[1])[:, np.newaxis])
        own = np.zeros(count) if extra is None else extra
        found = over_samples(_sight(self.mechanism), given[0].shape[0], *given, self.theta, own)
        sizes = ((3,), (3, 3), (3,), (3, self.theta.size), (3, count))
        return tuple(part.reshape(*shape, *size) for part, size in zip(found, sizes, strict=True))


def _true_times(mechanism: Mechanism) -> ca.Function:
    def build(made: Mechanism) -> ca.Function:
        stamp, theta = ca.SX.sym("stamp"), ca.SX.sym("theta", made.theta.size)
        time = true_time_at(made, stamp, theta)
        return function("true_times", [stamp, theta], [time, rows(ca.jacobian(time, theta))])

    return mechanism.compiled("measurement: true times", build)


def _place(mechanism: Mechanism, number: int) -> ca.Function:
    def build(made: Mechanism) -> ca.Function:
        place, theta = ca.SX.sym("place", 3), ca.SX.sym("theta", made.theta.size)
        real = marker_at(made, number, place, theta)
        return function("real_place", [place, theta], [real, rows(ca.jacobian(real, theta))])

    return mechanism.compiled(f"measurement: marker {number}", build)


def _sight(mechanism: Mechanism) -> ca.Function:
    def build(made: Mechanism) -> ca.Function:
        symbols = Symbols.of(made)
        point, theta = ca.SX.sym("point", 3), symbols.theta
        state = PlatformState(
            time=symbols.time,
            position=symbols.position,
            rotation=symbols.rotation,
            twist=symbols.twist,
            cables=made.cables_at(symbols.position, symbols.rotation, theta),
            extra=symbols.extra,
        )
        seen = seen_at(made, point, state, theta)
        outputs = [seen, *(rows(ca.jacobian(seen, by)) for by in (point, symbols.time, theta, symbols.extra))]
        return function("sight", [point, symbols.time, theta, symbols.extra], outputs)

    return mechanism.compiled("measurement: sight", build)
