"""First guesses of the windows' initial states: pose from the first markers and the lengths, twist from their rates.

Several orientations are tried, because three marker coordinates and a few lengths may have several solutions: the
equilibrium at the encoders' lengths, the platform level below its marker, and what three markers say.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import skew
from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.identification.mle.starts.by_rates import Begin, begins_by_rates
from fidim_lab.identification.mle.starts.start_poses import (
    Poses,
    Targets,
    Unread,
    at_rest,
    poses_from_rests,
    refined,
    rest_near,
)
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.identification.motion import rigid
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.measurement import MarkerMeasurement
from fidim_lab.model.sensitivity.rates import reads_rates
from fidim_lab.model.sensitivity.starts import Starts, tied
from fidim_lab.model.statics import Equilibrium

OPENING = (0.1, 5)
"""s, and samples at least, from which the first position and velocity are taken"""
SPEED, REST = 1e-2, 0.5
"""m/s of a marker; m/s or rad/s of a free twist"""
STRETCH_RATE = 2e-2
"""m/s of a cable that is a spring"""
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
    is_open: bool = False
    """whether neither lengths nor markers told the orientation"""


@dataclass(frozen=True, eq=False)
class _Opening:
    """Where the markers really are at the begin and how fast they move, (M, 3); NaN for a marker that is not seen."""

    recording: FollowedSamples
    places: np.ndarray
    speeds: np.ndarray
    on_body: np.ndarray
    """where they sit on the body (M, 3), m"""

    @property
    def seen(self) -> np.ndarray:
        """Which markers are (M)."""
        return np.asarray(np.isfinite(self.places - self.on_body).all(axis=1))

    @property
    def is_open(self) -> bool:
        """Whether neither lengths nor markers tell the orientation."""
        blind = not np.isfinite(self.recording.lengths).any()
        return blind and rigid.spread(self.on_body[self.seen]) <= rigid.MIN_SPREAD

    @property
    def level(self) -> Pose:
        """The platform unrotated below what is seen."""
        return Pose(position=(self.places - self.on_body)[self.seen].mean(axis=0), rotation=np.eye(3))

    def misfit(self, pose: Pose) -> float:
        """Largest distance of a marker coordinate from where the pose has it, m."""
        return float(np.nanmax(np.abs(pose.position + self.on_body @ pose.rotation.T - self.places)))


def first_guess(
    mechanism: Mechanism, body: Body, recording: FollowedSamples, theta: Float[np.ndarray, " theta"] | None = None
) -> Guess:
    """Initial state of one window for a body and θ, the mechanism's unless given.

    Raises RefusedError where lengths and markers contradict each other.
    """
    found = first_guesses(mechanism, body, [recording], theta)[0]
    if isinstance(found, RefusedError):
        raise found
    return found


def first_guesses(
    mechanism: Mechanism,
    body: Body,
    recordings: Sequence[FollowedSamples],
    theta: Float[np.ndarray, " theta"] | None = None,
) -> tuple[Guess | RefusedError, ...]:
    """The same for many windows, far sooner than one by one; for each its guess, or why there is none."""
    shared = np.concatenate([body.vector, mechanism.theta if theta is None else theta])
    if reads_rates(mechanism):
        begins = begins_by_rates(mechanism, body, recordings)
        return tuple(_tied(mechanism, shared, one) if isinstance(one, tuple) else one for one in begins)
    openings = [_opening(mechanism, recording, shared) for recording in recordings]
    usable = [opening for opening in openings if opening.seen.any()]
    rests = _rests(mechanism, body, usable)
    best = _searched(mechanism, shared, [(opening, _begins(opening, rests)) for opening in usable])
    for k, pose in _unread(mechanism, body, shared, usable).items():
        best[k] = pose
    doubtful = [k for k, pose in enumerate(best) if usable[k].misfit(pose) > DOUBTFUL]
    turned = _searched(mechanism, shared, [(usable[k], _turned(usable[k].level)) for k in doubtful])
    for k, pose in zip(doubtful, turned, strict=True):
        best[k] = min(best[k], pose, key=usable[k].misfit)
    twists = _twists(mechanism, shared, usable, best)
    guesses = (_guess(*each) for each in zip(usable, best, twists, strict=True))
    return tuple(next(guesses) if opening.seen.any() else _unseen(opening) for opening in openings)


def as_states(guesses: Sequence[Guess]) -> States:
    """Guesses of all windows as one."""
    return States(
        positions=np.array([guess.position for guess in guesses]),
        rotations=np.array([guess.rotation for guess in guesses]),
        twists=np.array([guess.twist for guess in guesses]),
    )


def _guess(opening: _Opening, pose: Pose, twist: np.ndarray) -> Guess | RefusedError:
    misfit = opening.misfit(pose)
    if misfit < CONTRADICTION:
        return Guess(pose.position, pose.rotation, twist, misfit, opening.is_open)
    return RefusedError(
        f"Window {opening.recording.window.id}: no pose has these cable lengths and its markers within "
        f"{CONTRADICTION * 1e3:.0f} mm ({misfit * 1e3:.0f} mm are left).",
        hint="Check the order of the cables, the zero of the encoders, and the units of the markers.",
    )


def _tied(mechanism: Mechanism, shared: np.ndarray, begin: Begin) -> Guess:
    """A begin with the nearest twist that the cables allow."""
    states = States(*(part[np.newaxis] for part in begin))
    return Guess(*begin[:2], tied(mechanism, shared, states, np.zeros(1)).twists[0], 0.0)


def _unseen(opening: _Opening) -> RefusedError:
    return RefusedError(f"Window {opening.recording.window.id}: no marker is seen in its first {OPENING[0]:g} s.")


def _opening(mechanism: Mechanism, recording: FollowedSamples, shared: np.ndarray) -> _Opening:
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
    measurement = MarkerMeasurement(mechanism, shared[BODY:])
    real, by_point = measurement.true_points(places, recording.begin)
    on_body = measurement.places(mechanism.robot.markers[: len(places)])
    return _Opening(recording, real, np.linalg.solve(by_point, speeds[..., np.newaxis])[..., 0], on_body)


def _rests(mechanism: Mechanism, body: Body, openings: Sequence[_Opening]) -> Mapping[bytes, Pose]:
    """Equilibria at the lengths that are known, by these: parts of one window share theirs."""
    found: dict[bytes, Pose] = {}
    tried: set[bytes] = set()
    for opening in openings:
        lengths = opening.recording.lengths
        if not np.isfinite(lengths).all() or lengths.tobytes() in tried:
            continue
        tried.add(lengths.tobytes())
        with suppress(InfeasibleError):
            found[lengths.tobytes()] = pose_from_lengths(mechanism, body, lengths, opening.level).pose
    return found


def _begins(opening: _Opening, rests: Mapping[bytes, Pose]) -> list[Pose]:
    """Where to search from; the likeliest first."""
    poses: list[Pose] = []
    if rigid.spread(opening.on_body[opening.seen]) > rigid.MIN_SPREAD:
        seen = opening.seen[np.newaxis].astype(float)
        p, R, _ = rigid.register(opening.places[np.newaxis], opening.on_body, seen)
        poses.append(Pose(p[0], R[0]))
    rest = rests.get(opening.recording.lengths.tobytes())
    return [*poses, *([] if rest is None else [rest]), opening.level]


def _unread(mechanism: Mechanism, body: Body, shared: np.ndarray, openings: Sequence[_Opening]) -> dict[int, Pose]:
    """Poses of those whose lengths nobody read and whose markers leave the orientation open, by where they rest."""
    asked: dict[int, tuple[Unread, Equilibrium]] = {}
    for k, opening in enumerate(openings):
        if opening.is_open:
            rest = rest_near(mechanism, body, opening.recording)
            if rest is not None:
                asked[k] = (Unread(opening.recording, opening.places, opening.on_body), rest)
    return dict(zip(asked, poses_from_rests(mechanism, shared, list(asked.values())), strict=True))


def _turned(level: Pose) -> list[Pose]:
    """The same place in many orientations."""
    axes = np.array(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3)).reshape(3, -1).T
    axes = axes[np.any(axes != 0, axis=1)]
    return [
        Pose(level.position, level.rotation @ Rotation.from_rotvec(turn * axis / np.linalg.norm(axis)).as_matrix())
        for turn in TURNS
        for axis in axes
    ]


def _searched(mechanism: Mechanism, shared: np.ndarray, asked: Sequence[tuple[_Opening, Sequence[Pose]]]) -> list[Pose]:
    """For each opening the pose that fits best of those found from its begins."""
    if not asked:
        return []
    openings = [opening for opening, begins in asked for _ in begins]
    begins = [pose for _, poses in asked for pose in poses]
    most = max(len(opening.places) for opening in openings)
    targets = Targets(
        places=np.array([_padded(opening.places, most, np.nan) for opening in openings]),
        on_body=np.array([_padded(opening.on_body, most, 0.0) for opening in openings]),
        lengths=np.array([opening.recording.lengths for opening in openings]),
        begins=np.array([opening.recording.begin for opening in openings]),
    )
    found, cost = refined(mechanism, shared, targets, _stacked(begins))
    poses: list[Pose] = []
    first = 0
    for _, tried in asked:
        best = first + int(np.argmin(np.nan_to_num(cost[first : first + len(tried)], nan=np.inf)))
        poses.append(Pose(found.positions[best], found.rotations[best]))
        first += len(tried)
    return poses


def _padded(rows: np.ndarray, count: int, filling: float) -> np.ndarray:
    return np.concatenate([rows, np.full((count - len(rows), 3), filling)])


def _stacked(poses: Sequence[Pose]) -> Poses:
    return Poses(np.array([pose.position for pose in poses]), np.array([pose.rotation for pose in poses]))


def _twists(
    mechanism: Mechanism, shared: np.ndarray, openings: Sequence[_Opening], poses: Sequence[Pose]
) -> Float[np.ndarray, "W 6"]:
    """The free twists that move the markers as they move, small where they do not tell."""
    if not poses:
        return np.zeros((0, 6))
    begins = np.array([opening.recording.begin for opening in openings])
    at, starts = at_rest(mechanism, shared, _stacked(poses), begins)
    wanted = np.array([_twist(opening, at.rotations[w], starts, w) for w, opening in enumerate(openings)])
    return tied(mechanism, shared, replace(at, twists=wanted), begins).twists


def _twist(opening: _Opening, rotation: Float[np.ndarray, "3 3"], starts: Starts, w: int) -> Float[np.ndarray, "6"]:
    free = starts.free_twists[w]
    arms = opening.on_body @ rotation.T
    moves = np.concatenate([np.broadcast_to(np.eye(3), (len(arms), 3, 3)), -skew(arms)], axis=-1)
    seen = np.isfinite(opening.speeds)
    rows = [(moves @ free)[seen] / SPEED, np.eye(free.shape[1]) / REST]
    right = [opening.speeds[seen] / SPEED, np.zeros(free.shape[1])]
    if starts.rates is not None and starts.rates_by is not None:
        rows.append(starts.rates_by[w][:, 6 : 6 + free.shape[1]] / STRETCH_RATE)
        right.append(-starts.rates[w] / STRETCH_RATE)
    return free @ np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
