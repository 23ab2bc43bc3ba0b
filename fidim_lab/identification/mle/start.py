"""First guesses of the windows' initial states: pose from the first markers and the lengths, twist from their rates.

Several orientations are tried, because three marker coordinates and a few lengths may have several solutions: the
equilibrium at the encoders' lengths, the platform level below its marker, and what three markers say.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.identification import rigid
from fidim_lab.identification.mle.recordings import Recording
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.measurement import Measurement
from fidim_lab.model.sensitivity.starts import Starts, linearised_starts, tied

OPENING = (0.1, 5)
"""s, and samples at least, from which the first position and velocity are taken"""
MARKER, LENGTH, AWAY = 1e-3, 1e-4, 0.3
"""weights of the guess: m of a marker, m of cable, m or rad from where the search began"""
SPEED, REST = 1e-2, 0.5
"""m/s of a marker; m/s or rad/s of a free twist"""
STRETCH_RATE = 2e-2
"""m/s of a cable that is a spring"""
ROUNDS = 25
LONGEST_STEP = 0.2
"""m or rad"""
DOUBTFUL = 2e-3
"""m between a marker and its guess beyond which other orientations are tried: the search may have ended in another
solution's valley"""
TURNS = (0.3, 0.6)
"""rad by which these are turned, about each axis and each diagonal"""
CONTRADICTION = 0.05
"""m between a marker and the pose that fits lengths and markers best: beyond, they do not belong together"""


@dataclass(frozen=True, eq=False)
class Guess:
    """Where one window starts."""

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    twist: Float[np.ndarray, "6"]
    misfit: float
    """largest distance between a marker and where the guess has it, m"""


@dataclass(frozen=True, eq=False)
class _Opening:
    """Where the markers really are at the begin and how fast they move, (M, 3); NaN for a marker that is not seen."""

    places: np.ndarray
    speeds: np.ndarray
    on_body: np.ndarray
    """where they sit on the body (M, 3), m"""


def first_guess(
    mechanism: Mechanism, body: Body, recording: Recording, theta: Float[np.ndarray, " theta"] | None = None
) -> Guess:
    """Initial state of one window for a body and θ, the mechanism's unless given.

    Raises RefusedError where lengths and markers contradict each other.
    """
    shared = np.concatenate([body.vector, mechanism.theta if theta is None else theta])
    opening = _opening(mechanism, recording, shared)
    poses = _poses(mechanism, body, recording, opening)
    best = _best(_refined(mechanism, shared, recording, opening, poses))
    if _misfit(best, opening) > DOUBTFUL:
        turned = _refined(mechanism, shared, recording, opening, _turned(poses[-1]))
        best = min(best, _best(turned), key=lambda pose: _misfit(pose, opening))
    misfit = _misfit(best, opening)
    if not misfit < CONTRADICTION:
        raise RefusedError(
            f"Window {recording.window.id}: no pose has these cable lengths and its markers within "
            f"{CONTRADICTION * 1e3:.0f} mm ({misfit * 1e3:.0f} mm are left).",
            hint="Check the order of the cables, the zero of the encoders, and the units of the markers.",
        )
    return Guess(best.position, best.rotation, _twist(mechanism, shared, recording, opening, best), misfit)


def as_states(guesses: Sequence[Guess]) -> States:
    """Guesses of all windows as one."""
    return States(
        positions=np.array([guess.position for guess in guesses]),
        rotations=np.array([guess.rotation for guess in guesses]),
        twists=np.array([guess.twist for guess in guesses]),
    )


def _opening(mechanism: Mechanism, recording: Recording, shared: np.ndarray) -> _Opening:
    """A parabola through the first samples of every coordinate, without what the cameras add."""
    seconds, samples = OPENING
    places, speeds = (np.full(recording.markers.shape[1:], np.nan) for _ in range(2))
    for m, axis in np.ndindex(places.shape):
        known = np.flatnonzero(np.isfinite(recording.markers[:, m, axis]))
        use = known[(recording.t[known] <= seconds) | (np.arange(len(known)) < samples)]
        if len(use) < 3 or recording.t[use[0]] > seconds:
            continue
        fitted = np.polynomial.Polynomial.fit(recording.t[use], recording.markers[use, m, axis], 2)
        places[m, axis], speeds[m, axis] = fitted(0.0), fitted.deriv()(0.0)
    measurement = Measurement(mechanism, shared[BODY:])
    real, by_point = measurement.true_points(places, recording.begin)
    on_body = measurement.places(mechanism.robot.markers[: len(places)])
    return _Opening(real, np.linalg.solve(by_point, speeds[..., np.newaxis])[..., 0], on_body)


def _poses(mechanism: Mechanism, body: Body, recording: Recording, opening: _Opening) -> list[Pose]:
    """Where to search from; the likeliest first."""
    body_markers = opening.on_body
    offsets = opening.places - body_markers
    seen = np.asarray(np.isfinite(offsets).all(axis=1))
    if not seen.any():
        raise RefusedError(f"Window {recording.window.id}: no marker is seen in its first {OPENING[0]:g} s.")
    level = Pose(position=offsets[seen].mean(axis=0), rotation=np.eye(3))
    poses: list[Pose] = []
    if rigid.spread(body_markers[seen]) > rigid.MIN_SPREAD:
        p, R, _ = rigid.register(opening.places[np.newaxis], body_markers, seen[np.newaxis].astype(float))
        poses.append(Pose(p[0], R[0]))
    if np.isfinite(recording.lengths).all():
        with suppress(InfeasibleError):
            poses.append(pose_from_lengths(mechanism, body, recording.lengths, level).pose)
    return [*poses, level]


def _turned(level: Pose) -> list[Pose]:
    """The same place in many orientations."""
    axes = np.array(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3)).reshape(3, -1).T
    axes = axes[np.any(axes != 0, axis=1)]
    return [
        Pose(level.position, level.rotation @ Rotation.from_rotvec(turn * axis / np.linalg.norm(axis)).as_matrix())
        for turn in TURNS
        for axis in axes
    ]


def _best(found: list[tuple[Pose, float]]) -> Pose:
    return min(found, key=lambda one: one[1])[0]


def _refined(
    mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, begins: Sequence[Pose]
) -> list[tuple[Pose, float]]:
    """Damped Gauss–Newton on markers and lengths from each of some poses, all at once; what is left with each pose.

    What is left includes the way from the begin.
    """
    begin = _Poses(np.array([pose.position for pose in begins]), np.array([pose.rotation for pose in begins]))
    now = begin
    residual, jacobian = _pose_residuals(mechanism, shared, recording, opening, begin, now)
    cost = (residual**2).sum(axis=1)
    damping, going = np.full(len(cost), 1e-6), np.ones(len(cost), dtype=bool)
    for _ in range(ROUNDS):
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian
        size = np.diagonal(normal, axis1=1, axis2=2)
        damped = normal + damping[:, np.newaxis, np.newaxis] * size[:, np.newaxis] * np.eye(6)
        steps = -np.linalg.solve(damped, np.einsum("kri,kr->ki", jacobian, residual)[..., np.newaxis])[..., 0]
        steps *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(steps).max(axis=1, keepdims=True), 1e-12))
        there = now.moved(steps)
        trial = _pose_residuals(mechanism, shared, recording, opening, begin, there)
        then = (trial[0] ** 2).sum(axis=1)
        better = going & (then < cost)
        settled = better & (then > cost * (1 - 1e-9))
        damping = np.where(better, damping / 10, np.maximum(10 * damping, 1e-6))
        now, cost = there.where(better, now), np.where(better, then, cost)
        residual = np.where(better[:, np.newaxis], trial[0], residual)
        jacobian = np.where(better[:, np.newaxis, np.newaxis], trial[1], jacobian)
        going &= ~settled
        if not going.any():
            break
    return [(Pose(p, R), float(c)) for p, R, c in zip(now.positions, now.rotations, cost, strict=True)]


@dataclass(frozen=True, eq=False)
class _Poses:
    positions: Float[np.ndarray, "K 3"]
    rotations: Float[np.ndarray, "K 3 3"]

    def moved(self, steps: Float[np.ndarray, "K 6"]) -> "_Poses":
        turns = Rotation.from_rotvec(steps[:, 3:]).as_matrix()
        return _Poses(self.positions + steps[:, :3], self.rotations @ turns)

    def where(self, chosen: np.ndarray, other: "_Poses") -> "_Poses":
        """These where chosen, else the other's."""
        positions = np.where(chosen[:, np.newaxis], self.positions, other.positions)
        return _Poses(positions, np.where(chosen[:, np.newaxis, np.newaxis], self.rotations, other.rotations))


def _at_rest(mechanism: Mechanism, shared: np.ndarray, at: _Poses, begin: float) -> tuple[States, Starts]:
    """Starts at rest, springs as quiet as they can be."""
    clock, still = np.full(len(at.positions), begin), np.zeros((len(at.positions), 6))
    states = tied(mechanism, shared, States(at.positions, at.rotations, still), clock)
    states = replace(states, twists=still)
    return states, linearised_starts(mechanism, shared, states, clock)


def _pose_residuals(
    mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, begin: _Poses, at: _Poses
) -> tuple[Float[np.ndarray, "K rows"], Float[np.ndarray, "K rows 6"]]:
    starts = _at_rest(mechanism, shared, at, recording.begin)[1]
    body_markers = opening.on_body
    count, seen = len(at.positions), np.isfinite(opening.places)
    arms = body_markers @ np.swapaxes(at.rotations, 1, 2)
    by_marker = np.zeros((count, *opening.places.shape, 6))
    by_marker[..., :3] = np.eye(3)
    by_marker[..., 3:] = -at.rotations[:, np.newaxis] @ _skew(body_markers)
    known = np.isfinite(recording.lengths)
    turn = Rotation.from_matrix(np.swapaxes(begin.rotations, 1, 2) @ at.rotations).as_rotvec()
    residual = [
        (at.positions[:, np.newaxis] + arms - opening.places)[:, seen] / MARKER,
        (starts.lengths - recording.lengths)[:, known] / LENGTH,
        np.concatenate([at.positions - begin.positions, turn], axis=1) / AWAY,
    ]
    away = np.broadcast_to(np.eye(6) / AWAY, (count, 6, 6))
    jacobian = [by_marker[:, seen] / MARKER, starts.lengths_by[:, known, :6] / LENGTH, away]
    return np.concatenate(residual, axis=1), np.concatenate(jacobian, axis=1)


def _misfit(pose: Pose, opening: _Opening) -> float:
    arms = opening.on_body @ pose.rotation.T
    return float(np.nanmax(np.abs(pose.position + arms - opening.places)))


def _twist(mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, pose: Pose) -> np.ndarray:
    """The free twist that moves the markers as they move, small where they do not tell."""
    only = _Poses(pose.position[np.newaxis], pose.rotation[np.newaxis])
    at, starts = _at_rest(mechanism, shared, only, recording.begin)
    free = starts.free_twists[0]
    arms = opening.on_body @ pose.rotation.T
    moves = np.concatenate([np.broadcast_to(np.eye(3), (len(arms), 3, 3)), -_skew(arms)], axis=-1)
    seen = np.isfinite(opening.speeds)
    rows = [(moves @ free)[seen] / SPEED, np.eye(free.shape[1]) / REST]
    right = [opening.speeds[seen] / SPEED, np.zeros(free.shape[1])]
    if starts.rates is not None and starts.rates_by is not None:
        rows.append(starts.rates_by[0][:, 6 : 6 + free.shape[1]] / STRETCH_RATE)
        right.append(-starts.rates[0] / STRETCH_RATE)
    twist = free @ np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    begin = np.array([recording.begin])
    return tied(mechanism, shared, replace(at, twists=twist[np.newaxis]), begin).twists[0]


def _skew(vectors: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "M 3 3"]:
    return np.cross(vectors[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)
