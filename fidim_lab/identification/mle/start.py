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
from fidim_lab.model.sensitivity.integrate import States
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
    """Where the markers are at the begin and how fast they move, (M, 3); NaN for a marker that is not seen."""

    places: np.ndarray
    speeds: np.ndarray


def first_guess(
    mechanism: Mechanism, body: Body, recording: Recording, theta: Float[np.ndarray, " theta"] | None = None
) -> Guess:
    """Initial state of one window for a body and θ, the mechanism's unless given.

    Raises RefusedError where lengths and markers contradict each other.
    """
    shared = np.concatenate([body.vector, mechanism.theta if theta is None else theta])
    opening = _opening(recording)
    poses = _poses(mechanism, body, recording, opening)
    best = _best([_refined(mechanism, shared, recording, opening, pose) for pose in poses])
    if _misfit(mechanism, best, opening) > DOUBTFUL:
        turned = [_refined(mechanism, shared, recording, opening, pose) for pose in _turned(poses[-1])]
        best = min(best, _best(turned), key=lambda pose: _misfit(mechanism, pose, opening))
    misfit = _misfit(mechanism, best, opening)
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


def _opening(recording: Recording) -> _Opening:
    """A parabola through the first samples of every coordinate."""
    seconds, samples = OPENING
    places, speeds = (np.full(recording.markers.shape[1:], np.nan) for _ in range(2))
    for m, axis in np.ndindex(places.shape):
        known = np.flatnonzero(np.isfinite(recording.markers[:, m, axis]))
        use = known[(recording.t[known] <= seconds) | (np.arange(len(known)) < samples)]
        if len(use) < 3 or recording.t[use[0]] > seconds:
            continue
        fitted = np.polynomial.Polynomial.fit(recording.t[use], recording.markers[use, m, axis], 2)
        places[m, axis], speeds[m, axis] = fitted(0.0), fitted.deriv()(0.0)
    return _Opening(places, speeds)


def _poses(mechanism: Mechanism, body: Body, recording: Recording, opening: _Opening) -> list[Pose]:
    """Where to search from; the likeliest first."""
    robot = mechanism.robot
    body_markers = robot.markers[: len(opening.places)]
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
    mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, begin: Pose
) -> tuple[Pose, float]:
    """Damped Gauss–Newton on markers and lengths; the pose and what is left, the way from the begin included."""
    pose, cost = begin, np.inf
    damping = 1e-6
    residual, jacobian = _pose_residual(mechanism, shared, recording, opening, begin, pose)
    cost = float(residual @ residual)
    for _ in range(ROUNDS):
        normal = jacobian.T @ jacobian
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), jacobian.T @ residual)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        there = Pose(pose.position + step[:3], pose.rotation @ Rotation.from_rotvec(step[3:]).as_matrix())
        trial = _pose_residual(mechanism, shared, recording, opening, begin, there)
        now = float(trial[0] @ trial[0])
        if now < cost:
            settled = now > cost * (1 - 1e-9)
            pose, cost, (residual, jacobian) = there, now, trial
            damping /= 10
            if settled:
                break
        else:
            damping = max(10 * damping, 1e-6)
    return pose, cost


def _at_rest(mechanism: Mechanism, shared: np.ndarray, pose: Pose, begin: float) -> tuple[States, Starts]:
    """One window's start at rest, springs as quiet as they can be."""
    clock = np.array([begin])
    at = tied(mechanism, shared, States(pose.position[np.newaxis], pose.rotation[np.newaxis], np.zeros((1, 6))), clock)
    at = replace(at, twists=np.zeros((1, 6)))
    return at, linearised_starts(mechanism, shared, at, clock)


def _pose_residual(
    mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, begin: Pose, pose: Pose
) -> tuple[np.ndarray, np.ndarray]:
    starts = _at_rest(mechanism, shared, pose, recording.begin)[1]
    body_markers = mechanism.robot.markers[: len(opening.places)]
    arms = body_markers @ pose.rotation.T
    seen = np.isfinite(opening.places)
    by_marker = np.zeros((*opening.places.shape, 6))
    by_marker[..., :3] = np.eye(3)
    by_marker[..., 3:] = -pose.rotation @ _skew(body_markers)
    known = np.isfinite(recording.lengths)
    turn = Rotation.from_matrix(begin.rotation.T @ pose.rotation).as_rotvec()
    residual = [
        (pose.position + arms - opening.places)[seen] / MARKER,
        (starts.lengths[0] - recording.lengths)[known] / LENGTH,
        np.concatenate([pose.position - begin.position, turn]) / AWAY,
    ]
    jacobian = [by_marker[seen] / MARKER, starts.lengths_by[0][known, :6] / LENGTH, np.eye(6) / AWAY]
    return np.concatenate(residual), np.vstack(jacobian)


def _misfit(mechanism: Mechanism, pose: Pose, opening: _Opening) -> float:
    arms = mechanism.robot.markers[: len(opening.places)] @ pose.rotation.T
    return float(np.nanmax(np.abs(pose.position + arms - opening.places)))


def _twist(mechanism: Mechanism, shared: np.ndarray, recording: Recording, opening: _Opening, pose: Pose) -> np.ndarray:
    """The free twist that moves the markers as they move, small where they do not tell."""
    at, starts = _at_rest(mechanism, shared, pose, recording.begin)
    free = starts.free_twists[0]
    arms = mechanism.robot.markers[: len(opening.places)] @ pose.rotation.T
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
