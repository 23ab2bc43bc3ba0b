"""What the cameras make of moving markers, with derivatives: the slots marker, stalk, true_time and seen of effects.

A marker that is elsewhere moves all its nodes; one on a stalk swings on it (`markers`); a frame stamped t shows the
motion at its true time; what is seen there may be turned, shifted or displaced. `MarkerMeasurement.of` says what a
mechanism's effects do at one θ; without such effects it only interpolates. Times count from a recording's first sample:
an offset common to all of them is a gauge of free motion, which the window's start takes up, so `time-offset` has no
influence here and stays unidentified.
"""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.model.batch import function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import extra_count, marker_at, seen_at, stalks_at, true_time_at
from fidim_lab.model.motion.equations import Symbols
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.markers import Nodal, at_nodes, between, hermite, swung, swung_by, varied_at_nodes
from fidim_lab.model.sensitivity.sampling import AXES
from fidim_lab.model.sensitivity.variation import Variations
from fidim_lab.model.slots import Effect, PlatformState

SLOTS = ("marker", "stalk", "seen", "true_time")
ACCELERATION = 2
"""of the three that `at_nodes` gives"""
SHIFT = 1e-4
"""s, over which velocities are differences"""
INVERSIONS = 6
"""fixed-point steps from a reported to a real point: each gains a factor of the (small) turn"""


class MotionSensor(Protocol):
    """Sensors at one θ: cameras (`MarkerMeasurement`) or a gyroscope (`rates.RateMeasurement`)."""

    def latest(self, end: float) -> float:
        """True time (s) until which a motion must be known for stamps up to `end`."""
        ...

    def at_nodes(self, trajectories: Trajectories, markers: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "W N ..."]:
        """What `seen` needs of the motions at their nodes; markers as in the robot file, m."""
        ...

    def varied_at_nodes(
        self, trajectories: Trajectories, by: Variations, markers: Float[np.ndarray, "M 3"]
    ) -> Float[np.ndarray, "W N ..."]:
        """Derivatives of `at_nodes` by the P columns of the variations."""
        ...

    def seen(
        self,
        nodal: Float[np.ndarray, "N ..."],
        count: int,
        grid: Grid,
        stamps: Series,
        begin: float,
        extra: Float[np.ndarray, " extra"] | None = None,
    ) -> Float[np.ndarray, "T M 3"]:
        """What is read at stamps, s since the recording's `begin`."""
        ...

    def seen_by(
        self,
        trajectories: Trajectories,
        place: int,
        markers: Float[np.ndarray, "M 3"],
        varied: Float[np.ndarray, "N ..."],
        stamps: Series,
        begin: float,
        extra: tuple[Float[np.ndarray, " extra"], Float[np.ndarray, "extra P"]] | None = None,
        *,
        held: bool = False,
    ) -> Float[np.ndarray, "T M 3 P"]:
        """Derivatives of `seen` for the window at `place` of a batch; held: none of the P is of θ."""
        ...


def measures(effect: Effect) -> bool:
    """Whether an effect changes what the cameras report."""
    return any(getattr(type(effect), name) is not getattr(Effect, name) for name in SLOTS)


@dataclass(frozen=True, eq=False)
class MarkerMeasurement:
    """The cameras at one θ."""

    mechanism: Mechanism
    theta: Float[np.ndarray, " theta"]

    @property
    def plain(self) -> bool:
        """Whether no effect changes anything."""
        return not any(measures(effect) for effect in self.mechanism.effects)

    @property
    def swings(self) -> bool:
        """Whether markers move against the body."""
        return any(type(effect).stalk is not Effect.stalk for effect in self.mechanism.effects)

    def followed(self, markers: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "K 3"]:
        """Points of the body that `seen` needs at the nodes: `places`, then the body's axes where markers swing."""
        return np.concatenate([self.places(markers), AXES]) if self.swings else self.places(markers)

    def at_nodes(self, trajectories: Trajectories, markers: Float[np.ndarray, "M 3"]) -> Nodal:
        """What `seen` needs of the motions at their nodes."""
        return at_nodes(trajectories, self.followed(markers))

    def varied_at_nodes(
        self, trajectories: Trajectories, by: Variations, markers: Float[np.ndarray, "M 3"]
    ) -> Float[np.ndarray, "W N 3 K 3 P"]:
        """Derivatives of `at_nodes`."""
        return varied_at_nodes(trajectories, by, self.followed(markers))

    def places(self, markers: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "M 3"]:
        """Where these markers of the robot file really are, body frame, m."""
        return markers if self.plain else self._moved(markers)[0]

    def latest(self, end: float) -> float:
        """True time (s) until which a motion must be known for stamps up to `end`."""
        return end if self.plain else max(end, float(self._times(np.array([end]))[0][0]))

    def seen(
        self,
        nodal: Float[np.ndarray, "N 3 K 3"],
        count: int,
        grid: Grid,
        stamps: Series,
        begin: float,
        extra: Float[np.ndarray, " extra"] | None = None,
    ) -> Float[np.ndarray, "T M 3"]:
        """What is reported of the first `count` markers at stamps (s since the recording's `begin`), m.

        begin: s since the window's. nodal: of the points `followed`, by `at_nodes`. extra: effects' own states of this
        window; those that cameras see do not change within it.
        """
        times = self._times(stamps)[0]
        points = self._points(nodal, count, grid, times, begin)
        return points if self.plain else self._sights(points, begin + times, extra)[0]

    def seen_by(
        self,
        trajectories: Trajectories,
        place: int,
        markers: Float[np.ndarray, "M 3"],
        varied: Float[np.ndarray, "N 3 K 3 P"],
        stamps: Series,
        begin: float,
        extra: tuple[Float[np.ndarray, " extra"], Float[np.ndarray, "extra P"]] | None = None,
        *,
        held: bool = False,
    ) -> Float[np.ndarray, "T M 3 P"]:
        """Derivatives of `seen` for the window at `place` of a batch; markers as in the robot file.

        varied: by `varied_at_nodes` at the points `followed`; its last columns are those of θ, what the motion adds,
        unless it is held. extra: effects' own states of this window, with their derivatives.
        """
        grid, many = trajectories.grid, len(markers)
        nodes = grid.t
        times, by_theta = self._times(stamps)
        columns = between(varied[:, :, :many], *hermite(nodes, times))
        if self.plain:
            return columns
        one = trajectories.only(place)
        nodal = at_nodes(one, self.followed(markers))[0]
        points, later, sooner = (self._points(nodal, many, grid, times + s, begin) for s in (0.0, SHIFT, -SHIFT))
        if self.swings:
            columns = columns + self._swings_by(nodal, varied, many, grid, times, begin, held=held)
        own = None if extra is None else extra[0]
        _, by_point, by_time, direct, by_extra = self._sights(points, begin + times, own)
        columns = by_point @ columns
        if not held:
            velocity = np.einsum("tmij,tmj->tmi", by_point, (later - sooner) / (2 * SHIFT)) + by_time
            turn = _rotations(between(at_nodes(one, AXES)[0], *hermite(nodes, times)))
            by_place = by_point @ turn[:, np.newaxis] @ self._moved(markers)[1]
            in_time = velocity[..., np.newaxis] * by_theta[:, np.newaxis, np.newaxis]
            columns[..., columns.shape[-1] - self.theta.size :] += by_place + direct + in_time
        return columns if extra is None else columns + by_extra @ extra[1]

    def _points(self, nodal: np.ndarray, count: int, grid: Grid, times: Series, begin: float) -> np.ndarray:
        """Where the first markers are (T, count, 3), m, on their stalks."""
        at = hermite(grid.t, times)
        course = between(nodal, *at)
        points = course[:, :count]
        if not self.swings:
            return points
        turn = _rotations(course)
        for number, stalk in self._stalks(count):
            felt = self._felt(nodal, number)
            y = between(swung(felt, grid, stalk.pulsation, stalk.damping, self._begins(felt, begin)), *at)
            points[:, number] += np.einsum("tij,jk,tlk,tl->ti", turn, stalk.give, turn, y, optimize=True)
        return points

    def _swings_by(
        self,
        nodal: np.ndarray,
        varied: np.ndarray,
        count: int,
        grid: Grid,
        times: Series,
        begin: float,
        *,
        held: bool,
    ) -> Float[np.ndarray, "T M 3 P"]:
        """What stalks add to the derivatives of the first markers by P columns, the last θ unless it is held.

        The acceleration of a foot that θ moves on the body is left out of them: a small part of a small thing.
        """
        at = hermite(grid.t, times)
        turn, turned = _rotations(between(nodal, *at)), between(varied[:, :, -4:], *at)
        turned = turned[:, 1:] - turned[:, :1]  # (T, axis, 3, P)
        P, size = varied.shape[-1], 0 if held else self.theta.size
        found = np.zeros((len(times), count, 3, P))
        for number, stalk in self._stalks(count):
            felt, by = self._felt(nodal, number), -varied[:, ACCELERATION, number].reshape(len(varied), -1)
            rest = 0 * by[0] if begin == 0 else by[0]
            course = swung(felt, grid, stalk.pulsation, stalk.damping, self._begins(felt, begin))
            moved = between(swung(by, grid, stalk.pulsation, stalk.damping, rest), *at).reshape(-1, 3, P)
            y = between(course, *at)
            inner = np.einsum("tkip,ti->tkp", turned, y) + np.einsum("tik,tip->tkp", turn, moved)
            own = np.einsum("tji,tj->ti", turn, y)
            lag = between(np.moveaxis(swung_by(felt, course, grid, stalk.pulsation, stalk.damping), 0, -1), *at)
            inner[..., P - size :] += np.einsum("tik,tiq,qp->tkp", turn, lag, stalk.lag_by[:, :size])
            given = np.einsum("tkip,kj,tj->tip", turned, stalk.give, own)
            given += np.einsum("tij,jk,tkp->tip", turn, stalk.give, inner)
            given[..., P - size :] += np.einsum("tij,jkp,tk->tip", turn, stalk.give_by[..., :size], own)
            found[:, number] += given
        return found

    def _felt(self, nodal: np.ndarray, number: int) -> Float[np.ndarray, "N 3"]:
        """g − acceleration of a marker's foot (from 0), m/s²."""
        return self.mechanism.robot.gravity - nodal[:, ACCELERATION, number]

    def _begins(self, felt: np.ndarray, begin: float) -> np.ndarray:
        """At rest where a window begins; what had begun before no longer rings."""
        return self.mechanism.robot.gravity if begin == 0 else felt[0]

    def _stalks(self, count: int) -> list[tuple[int, "_StalkNow"]]:
        """Those of the first markers (from 0)."""
        found: list[tuple[int, _StalkNow]] = []
        for number in range(count):
            compiled = _stalks(self.mechanism, number + 1)
            values, by = over_samples(compiled, 1, self.theta)
            for one, its in zip(values.reshape(-1, 11), by.reshape(-1, 11, self.theta.size), strict=True):
                give, lag = (one[:9].reshape(3, 3), its[:9].reshape(3, 3, -1)), its[9:]
                found.append((number, _StalkNow(*give, float(one[9]), float(one[10]), lag)))
        return found

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


@dataclass(frozen=True, eq=False)
class _StalkNow:
    """A stalk at one θ."""

    give: Float[np.ndarray, "3 3"]
    give_by: Float[np.ndarray, "3 3 theta"]
    pulsation: float
    damping: float
    lag_by: Float[np.ndarray, "2 theta"]
    """of pulsation and damping"""


def _stalks(mechanism: Mechanism, number: int) -> ca.Function:
    """θ → of each stalk of a marker its matrix row by row, pulsation and damping (11), and their derivatives."""

    def build(made: Mechanism) -> ca.Function:
        theta = ca.SX.sym("theta", made.theta.size)
        each = [ca.vertcat(rows(one.give), one.pulsation, one.damping) for one in stalks_at(made, number, theta)]
        found = ca.vertcat(ca.SX(0, 1), *each)
        return function("stalks", [theta], [found, rows(ca.jacobian(found, theta))])

    return mechanism.compiled(f"measurement: stalks of marker {number}", build)


def _rotations(course: Float[np.ndarray, "T K 3"]) -> Float[np.ndarray, "T 3 3"]:
    """Body → world, where the last points are those of `AXES`."""
    return np.swapaxes(course[:, -3:] - course[:, -4:-3], 1, 2)


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
