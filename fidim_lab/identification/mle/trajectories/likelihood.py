"""Whitened residuals of recordings at a point of the unknowns, and their exact derivatives.

`simulate` gives residuals only (a third of the price), `linearised` adds the derivatives, window by window. Windows are
integrated in batches of similar length, so that memory does not grow with their number.

The rows of one window: marker coordinates in order of time, marker, axis; known cable lengths; and priors on the
window's own unknowns. Those on pose and twist are so loose that they say nothing where anything else does. Cables that
are springs add two rows each: their tension at the start is about that of rigid cables (or the measured one), and they
stretch no faster than goes with an oscillation of that size. Without, a few markers could not tell them at all. States
that effects have of their own add one row each: they begin about where their effect says.
"""

from collections import ChainMap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, TypeVar

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import can_move
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, body_markers, in_batches, rows_of
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY, sprung
from fidim_lab.model.sensitivity.grid import Grid, Resolution
from fidim_lab.model.sensitivity.integrate import States, Trajectories, integrate
from fidim_lab.model.sensitivity.measurement import MarkerMeasurement, MotionSensor
from fidim_lab.model.sensitivity.starts import (
    Starts,
    linearised_starts,
    moved,
    own_count,
    quiet_springs,
    spreads,
    yielding_encoders,
)
from fidim_lab.model.sensitivity.variation import variations
from fidim_lab.model.side_by_side import side_by_side

T = TypeVar("T")

LOOSE_POSE = 1.0
"""m and rad, from the first guess"""
LOOSE_RATE = 10.0
"""m/s and rad/s, from rest"""
STIFFEST = 2 * np.pi * 300
"""rad/s: springs that oscillate faster are not simulated; cables as stiff as that are rigid"""
SHORTEST_BLOCK = 0.02
"""s: a block shorter than that is not halved, however quick the motion"""


@dataclass(frozen=True, eq=False)
class SpringPrior:
    """What is known of springs at the start of each window."""

    tensions: Float[np.ndarray, "W springs"]
    """N/kg"""
    tension_sd: Float[np.ndarray, "W springs"]
    rate_sd: Float[np.ndarray, "W springs"]
    """m/s of stretch, about 0"""


@dataclass(frozen=True)
class SensorWords:
    """How messages call what shows the motion."""

    name: str
    unit: str
    """a thousandth of which the noise is stated in"""
    key: str
    """of its noise in a robot file"""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """What was recorded, and how well it is known."""

    sensor: ClassVar[SensorWords] = SensorWords("marker", "mm", "marker_noise")
    mechanism: Mechanism
    recordings: tuple[FollowedSamples, ...]
    guesses: States
    """first guesses, at which the loose priors are centred"""
    noise: float
    """standard deviation of a marker coordinate, m"""
    resolution: float
    """standard deviation of an encoder's length, m"""
    springs: SpringPrior | None = None
    """None where no cable is a spring"""

    def whitened(
        self, w: int, rows: Float[np.ndarray, "K ..."], seen: Bool[np.ndarray, "T M 3"]
    ) -> Float[np.ndarray, "K ..."]:
        """Rows of the recorded coordinates of recording `w` (m, or derivatives) over their noise."""
        return _shaped(rows, seen, self.recordings[w].evening) / self.noise

    def coloured(
        self, w: int, rows: Float[np.ndarray, " K"], seen: Bool[np.ndarray, "T M 3"]
    ) -> Float[np.ndarray, " K"]:
        """The inverse of `whitened`."""
        evening = self.recordings[w].evening
        return _shaped(rows, seen, None if evening is None else np.linalg.inv(evening)) * self.noise

    def measurement(self, theta: Float[np.ndarray, " theta"]) -> MotionSensor:
        """What the sensors make of a motion at one θ."""
        return MarkerMeasurement(self.mechanism, theta)

    def loose(self, count: int) -> Float[np.ndarray, " count"]:
        """Standard deviations of what each window begins with about its first guess: pose (6), then free rates."""
        return np.concatenate([np.full(6, LOOSE_POSE), np.full(count - 6, LOOSE_RATE)])

    @property
    def own(self) -> int:
        """Unknowns of each window: pose (6), λ rates; with springs their tensions, and as many more rates; ξ."""
        return own_count(self.mechanism)

    @property
    def begins(self) -> Float[np.ndarray, " W"]:
        """When each recording begins on its window's own clock, s."""
        return np.array([recording.begin for recording in self.recordings])


def _shaped(rows: np.ndarray, seen: np.ndarray, evening: np.ndarray | None) -> np.ndarray:
    if evening is None:
        return rows
    whole = np.zeros(seen.shape + rows.shape[1:])
    whole[seen] = rows
    return np.einsum("mij,tmj...->tmi...", evening, whole)[seen]


@dataclass(frozen=True, eq=False)
class Point:
    """One value of all unknowns."""

    shared: Float[np.ndarray, " shared"]
    """nine of the body, then θ"""
    states: States

    @property
    def body(self) -> Body:
        """The body."""
        return Body.from_vector(self.shared[:BODY])


@dataclass(frozen=True, eq=False)
class WindowResidual:
    """The whitened residual of one window: predicted − recorded over its standard deviation."""

    markers: Float[np.ndarray, " K"]
    lengths: Float[np.ndarray, " m"]
    loose: Float[np.ndarray, " priors"]
    """pose and free rates; then, with springs, their tensions and rates of stretch; then effects' own states"""

    @property
    def rows(self) -> Float[np.ndarray, " rows"]:
        """All of them in one."""
        return np.concatenate([self.markers, self.lengths, self.loose])

    @property
    def count(self) -> int:
        """How many recorded numbers were compared."""
        return len(self.markers) + len(self.lengths)


@dataclass(frozen=True, eq=False)
class WindowLinear:
    """One window's residual with its derivatives at a point: all that a score test needs."""

    window: int
    residual: Float[np.ndarray, " rows"]
    by_own: Float[np.ndarray, "rows own"]
    by_shared: Float[np.ndarray, "rows shared"]


@dataclass(frozen=True, eq=False)
class _Batch:
    members: np.ndarray
    """indices of the recordings"""
    trajectories: Trajectories


@dataclass(frozen=True, eq=False)
class Simulation:
    """All recordings simulated at a point, each as far as its `ends`."""

    point: Point
    ends: Float[np.ndarray, " W"]
    """s since each recording's begin"""
    batches: tuple[_Batch, ...]
    starts: Starts
    residuals: tuple[WindowResidual, ...]

    @property
    def intervals(self) -> int:
        """Of the grid: how fine it is."""
        return self.batches[0].trajectories.grid.resolution.intervals

    @property
    def cost(self) -> float:
        """Sum of squares; infinite where a motion could not be simulated."""
        total = sum(float(residual.rows @ residual.rows) for residual in self.residuals)
        return total if np.isfinite(total) else np.inf

    @property
    def count(self) -> int:
        """How many recorded numbers were compared."""
        return sum(residual.count for residual in self.residuals)

    def trajectory_of(self, window: int) -> tuple[Trajectories, int]:
        """The batch of trajectories in which a recording is, and its place there."""
        for batch in self.batches:
            found = np.flatnonzero(batch.members == window)
            if len(found):
                return batch.trajectories, int(found[0])
        raise IndexError(window)


def simulate(
    likelihood: Likelihood, point: Point, ends: Float[np.ndarray, " W"], resolution: Resolution
) -> Simulation | None:
    """Residuals at a point; None for a body that cannot move (its mass matrix is not positive definite)."""
    if not np.isfinite(point.shared).all() or not can_move(point.body):
        return None
    starts = linearised_starts(likelihood.mechanism, point.shared, point.states, likelihood.begins)
    fine = _fine_enough(likelihood, point, resolution)
    if fine is None:
        return None
    measurement = likelihood.measurement(point.shared[BODY:])
    batches = in_batches(likelihood.recordings, measurement, ends, fine)
    parts = side_by_side([partial(_simulated, likelihood, point, starts, ends, *batch) for batch in batches])
    of_batches = [one for part in parts for one in part]
    found = {int(w): residual for batch, of in of_batches for w, residual in zip(batch.members, of, strict=True)}
    residuals = tuple(found[w] for w in range(len(likelihood.recordings)))
    return Simulation(point, ends, tuple(batch for batch, _ in of_batches), starts, residuals)


def _simulated(
    likelihood: Likelihood, point: Point, starts: Starts, ends: np.ndarray, members: np.ndarray, grid: Grid
) -> list[tuple[_Batch, list[WindowResidual]]]:
    """One batch; and others, of windows that move too quickly for its grid."""
    trajectories = _integrated(likelihood, point, starts, members, grid)
    coarse = trajectories.is_coarse
    if not coarse.any() or grid.resolution.block < SHORTEST_BLOCK:
        return [_judged(likelihood, point, starts, ends, _Batch(members, trajectories))]
    finer = _simulated(likelihood, point, starts, ends, members[coarse], grid.halved)
    if coarse.all():
        return finer
    kept = _Batch(members[~coarse], trajectories.of(~coarse))
    return [_judged(likelihood, point, starts, ends, kept), *finer]


def _integrated(likelihood: Likelihood, point: Point, starts: Starts, members: np.ndarray, grid: Grid) -> Trajectories:
    """The motions of some windows."""
    begins, unstretched = likelihood.begins[members], rows_of(starts.unstretched, members)
    states, extra = point.states.of(members), rows_of(starts.extra, members)
    return integrate(likelihood.mechanism, point.shared, states, grid, begins, unstretched, extra)


def _judged(
    likelihood: Likelihood, point: Point, starts: Starts, ends: np.ndarray, batch: _Batch
) -> tuple[_Batch, list[WindowResidual]]:
    """A batch with its residuals."""
    trajectories, robot = batch.trajectories, likelihood.mechanism.robot
    measurement = likelihood.measurement(point.shared[BODY:])
    stated = body_markers(likelihood.recordings, robot, batch.members)
    nodal = measurement.at_nodes(trajectories, stated)
    residuals: list[WindowResidual] = []
    for place, w in enumerate(int(w) for w in batch.members):
        if trajectories.breaks_down(place, measurement.latest(float(ends[w]))):
            nodal[place] = np.nan
        residuals.append(_residual(likelihood, point, starts, w, float(ends[w]), trajectories.grid, nodal[place]))
    return batch, residuals


def linearised(likelihood: Likelihood, simulation: Simulation, *, held: bool = False) -> list[WindowLinear]:
    """Residuals with derivatives of all windows, in their order; held: without those by what is shared."""
    return of_each(likelihood, simulation, lambda window: window, held=held)


def of_each(
    likelihood: Likelihood, simulation: Simulation, make: Callable[[WindowLinear], T], *, held: bool = False
) -> list[T]:
    """What `make` makes of each window, in their order; derivatives take memory, so none is kept for longer.

    held: without derivatives by what is shared.
    """

    def of_batch(batch: _Batch) -> dict[int, T]:
        return {window.window: make(window) for window in _linearised(likelihood, simulation, batch, held=held)}

    found = ChainMap(*side_by_side([partial(of_batch, batch) for batch in simulation.batches]))
    return [found[w] for w in sorted(found)]


def _linearised(likelihood: Likelihood, simulation: Simulation, batch: _Batch, *, held: bool) -> Iterator[WindowLinear]:
    """One batch."""
    point, own, starts = simulation.point, likelihood.own, simulation.starts
    starts = starts.by_own(own) if held else starts
    measurement = likelihood.measurement(point.shared[BODY:])
    by = variations(
        likelihood.mechanism,
        batch.trajectories,
        point.shared,
        starts.states_by[batch.members],
        unstretched=rows_of(starts.unstretched_by, batch.members),
        held=held,
    )
    stated = body_markers(likelihood.recordings, likelihood.mechanism.robot, batch.members)
    nodal = measurement.varied_at_nodes(batch.trajectories, by, stated)
    for place, w in enumerate(batch.members):
        recording = likelihood.recordings[w]
        use, seen = recording.seen_until(simulation.ends[w])
        count, t = seen.shape[1], recording.t[use]
        extra = None if starts.extra is None else (starts.extra[w], starts.states_by[w][12:])
        given = (stated[:count], nodal[place], t, recording.begin, extra)
        by_markers = measurement.seen_by(batch.trajectories, place, *given, held=held)[seen]
        known = np.isfinite(recording.lengths)
        jacobian = np.zeros((len(simulation.residuals[w].rows), starts.states_by.shape[2]))
        jacobian[: len(by_markers)] = likelihood.whitened(int(w), by_markers, seen)
        lengths = slice(len(by_markers), len(by_markers) + int(known.sum()))
        jacobian[lengths] = starts.lengths_by[w][known] / likelihood.resolution
        jacobian[lengths.stop :] = priors_by(likelihood, starts, int(w))
        yield WindowLinear(int(w), simulation.residuals[w].rows, jacobian[:, :own], jacobian[:, own:])


def stepped(
    likelihood: Likelihood,
    simulation: Simulation,
    own: Float[np.ndarray, "W own"],
    shared: Float[np.ndarray, " shared"],
) -> Point:
    """The point after a step of every window's own unknowns and of the shared parameters."""
    there = simulation.point.shared + shared
    states = moved(likelihood.mechanism, there, simulation.point.states, simulation.starts, own, likelihood.begins)
    return Point(there, states)


def _residual(
    likelihood: Likelihood,
    point: Point,
    starts: Starts,
    w: int,
    end: float,
    grid: Grid,
    nodal: Float[np.ndarray, "N ..."],
) -> WindowResidual:
    recording = likelihood.recordings[w]
    use, seen = recording.seen_until(end)
    measurement = likelihood.measurement(point.shared[BODY:])
    own = None if starts.extra is None else starts.extra[w]
    predicted = measurement.seen(nodal, seen.shape[1], grid, recording.t[use], recording.begin, own)
    known = np.isfinite(recording.lengths)
    guess, at = likelihood.guesses, point.states
    turn = Rotation.from_matrix(guess.rotations[w].T @ at.rotations[w]).as_rotvec()
    away = np.concatenate([at.positions[w] - guess.positions[w], turn, starts.free_twists[w].T @ at.twists[w]])
    priors = away / likelihood.loose(len(away))
    if likelihood.springs is not None and at.tensions is not None and starts.rates is not None:
        known_springs = likelihood.springs
        off = (at.tensions[w] - known_springs.tensions[w]) / known_springs.tension_sd[w]
        priors = np.concatenate([priors, off, starts.rates[w] / known_springs.rate_sd[w]])
    if starts.extra is not None:
        astray = np.zeros(starts.extra.shape[1]) if at.astray is None else at.astray[w]
        priors = np.concatenate([priors, astray / spreads(likelihood.mechanism)])
    return WindowResidual(
        markers=likelihood.whitened(w, (predicted - recording.markers[use])[seen], seen),
        lengths=(starts.lengths[w] - recording.read(yielding_encoders(likelihood.mechanism)))[known]
        / likelihood.resolution,
        loose=priors,
    )


def priors_by(likelihood: Likelihood, starts: Starts, w: int) -> Float[np.ndarray, "priors P"]:
    """Derivatives of the priors' rows by [own; shared]."""
    loose = 6 + starts.free_twists.shape[2]
    columns, spread = starts.states_by.shape[2], spreads(likelihood.mechanism)
    own = np.zeros((likelihood.own, columns))
    own[:, : likelihood.own] = np.eye(likelihood.own)
    last = likelihood.own - len(spread)
    parts = [own[:loose] / likelihood.loose(loose)[:, np.newaxis]]
    if likelihood.springs is not None and starts.rates_by is not None:
        parts.append(own[loose:last] / likelihood.springs.tension_sd[w][:, np.newaxis])
        parts.append(starts.rates_by[w] / likelihood.springs.rate_sd[w][:, np.newaxis])
    parts.append(own[last:] / spread[:, np.newaxis])
    return np.vstack(parts)


def _fine_enough(likelihood: Likelihood, point: Point, resolution: Resolution) -> Resolution | None:
    """The resolution that the springs ask for; None where they are none, or stiffer than is simulated."""
    if not sprung(likelihood.mechanism):
        return resolution
    if likelihood.mechanism.quiet:
        return resolution.for_stiff
    fastest = quiet_springs(likelihood.mechanism, point.shared, point.states, likelihood.begins).fastest
    return resolution.for_frequency(fastest) if fastest < STIFFEST else None
