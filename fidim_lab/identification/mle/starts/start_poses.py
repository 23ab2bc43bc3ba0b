"""Poses that fit first markers and lengths, of many windows from many starts at once.

One search takes microseconds of arithmetic and milliseconds of Python, so all that are asked for go side by side;
each is damped by itself and ends by itself, as if it were alone.

Without measured cable lengths markers alone may leave the orientation open. One marker's place is a family of poses. A
platform swings about one at which it rests, with its marker in the middle of the motion; most of the others no four
cables could hold, and a fit that begins there ends with a slack cable. With four cables these rests are still a family
of one, of which the least turned is taken: from it the fit reached rests that were turned by changes of 5 cm of each
cable.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import skew
from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.sampling import lengths_at_rest
from fidim_lab.model.sensitivity.starts import Starts, linearised_starts, tied
from fidim_lab.model.statics import Equilibrium

MARKER, LENGTH, AWAY = 1e-3, 1e-4, 0.3
"""weights of the guess: m of a marker, m of cable, m or rad from where the search began"""
ROUNDS = 25
LONGEST_STEP = 0.2
"""m or rad"""


@dataclass(frozen=True, eq=False)
class Poses:
    """K poses."""

    positions: Float[np.ndarray, "K 3"]
    rotations: Float[np.ndarray, "K 3 3"]

    def moved(self, steps: Float[np.ndarray, "K 6"]) -> "Poses":
        """Each after a step [δp; δφ]."""
        turns = Rotation.from_rotvec(steps[:, 3:]).as_matrix()
        return Poses(self.positions + steps[:, :3], self.rotations @ turns)

    def of(self, chosen: np.ndarray) -> "Poses":
        """Some of them."""
        return Poses(self.positions[chosen], self.rotations[chosen])


@dataclass(frozen=True, eq=False)
class Targets:
    """What each of K poses is to fit."""

    places: Float[np.ndarray, "K M 3"]
    """of markers, m; NaN where one is not seen"""
    on_body: Float[np.ndarray, "K M 3"]
    """where they sit, m"""
    lengths: Float[np.ndarray, "K n"]
    """m; NaN where unknown"""
    begins: Float[np.ndarray, " K"]
    """s on the windows' own clocks"""

    def of(self, chosen: np.ndarray) -> "Targets":
        """Some of them."""
        return Targets(self.places[chosen], self.on_body[chosen], self.lengths[chosen], self.begins[chosen])


@dataclass(frozen=True, eq=False)
class _Normal:
    """Sums of squares with their gradients and curvatures."""

    cost: Float[np.ndarray, " K"]
    gradient: Float[np.ndarray, "K 6"]
    curvature: Float[np.ndarray, "K 6 6"]

    def taken(self, chosen: np.ndarray, other: "_Normal", better: Bool[np.ndarray, " C"]) -> "_Normal":
        """With these rows replaced by the other's where that is better."""
        rows = chosen[better]
        cost, gradient, curvature = self.cost.copy(), self.gradient.copy(), self.curvature.copy()
        cost[rows], gradient[rows] = other.cost[better], other.gradient[better]
        curvature[rows] = other.curvature[better]
        return _Normal(cost, gradient, curvature)


def refined(
    mechanism: Mechanism, shared: Float[np.ndarray, " shared"], targets: Targets, begin: Poses
) -> tuple[Poses, Float[np.ndarray, " K"]]:
    """Damped Gauss–Newton on markers and lengths from each begin to its own target; what is left of each.

    What is left includes the way from the begin.
    """
    at = Poses(begin.positions.copy(), begin.rotations.copy())
    now = _normal(mechanism, shared, targets, begin, at)
    damping, going = np.full(len(now.cost), 1e-6), np.ones(len(now.cost), dtype=bool)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(going)
        curvature = now.curvature[rows]
        size = np.diagonal(curvature, axis1=1, axis2=2)
        damped = curvature + damping[rows, np.newaxis, np.newaxis] * size[:, np.newaxis] * np.eye(6)
        steps = -np.linalg.solve(damped, now.gradient[rows, :, np.newaxis])[..., 0]
        steps *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(steps).max(axis=1, keepdims=True), 1e-12))
        there = at.of(rows).moved(steps)
        then = _normal(mechanism, shared, targets.of(rows), begin.of(rows), there)
        better = then.cost < now.cost[rows]
        settled = better & (then.cost > now.cost[rows] * (1 - 1e-9))
        damping[rows] = np.where(better, damping[rows] / 10, np.maximum(10 * damping[rows], 1e-6))
        at.positions[rows[better]], at.rotations[rows[better]] = there.positions[better], there.rotations[better]
        now = now.taken(rows, then, better)
        going[rows[settled]] = False
        if not going.any():
            break
    return at, now.cost


def at_rest(mechanism: Mechanism, shared: np.ndarray, at: Poses, begins: np.ndarray) -> tuple[States, Starts]:
    """Starts at rest, springs as quiet as they can be."""
    still = np.zeros((len(at.positions), 6))
    states = tied(mechanism, shared, States(at.positions, at.rotations, still), begins)
    states = replace(states, twists=still)
    return states, linearised_starts(mechanism, shared, states, begins)


def _arms(targets: Targets, at: Poses) -> Float[np.ndarray, "K M 3"]:
    return targets.on_body @ np.swapaxes(at.rotations, 1, 2)


def _normal(mechanism: Mechanism, shared: np.ndarray, targets: Targets, begin: Poses, at: Poses) -> _Normal:
    """Of markers and lengths that are known, and of the way from the begin."""
    count, markers = targets.places.shape[:2]
    lengths, by_pose = lengths_at_rest(mechanism, shared, at.positions, at.rotations, targets.begins)
    seen, known = np.isfinite(targets.places), np.isfinite(targets.lengths)
    by_marker = np.zeros((count, markers, 3, 6))
    by_marker[..., :3] = np.eye(3)
    by_marker[..., 3:] = -at.rotations[:, np.newaxis] @ skew(targets.on_body)
    missed = at.positions[:, np.newaxis] + _arms(targets, at) - targets.places
    turn = Rotation.from_matrix(np.swapaxes(begin.rotations, 1, 2) @ at.rotations).as_rotvec()
    residual = [
        np.where(seen, missed, 0.0).reshape(count, -1) / MARKER,
        np.where(known, lengths - targets.lengths, 0.0) / LENGTH,
        np.concatenate([at.positions - begin.positions, turn], axis=1) / AWAY,
    ]
    jacobian = [
        (by_marker * seen[..., np.newaxis]).reshape(count, -1, 6) / MARKER,
        by_pose * known[..., np.newaxis] / LENGTH,
        np.broadcast_to(np.eye(6) / AWAY, (count, 6, 6)),
    ]
    left, by = np.concatenate(residual, axis=1), np.concatenate(jacobian, axis=1)
    turned = np.swapaxes(by, 1, 2)
    return _Normal((left**2).sum(axis=1), (turned @ left[..., np.newaxis])[..., 0], turned @ by)


@dataclass(frozen=True, eq=False)
class Unread:
    """What is seen of one window at its begin."""

    recording: FollowedSamples
    places: Float[np.ndarray, "M 3"]
    """of its markers, m; NaN where one is not seen"""
    on_body: Float[np.ndarray, "M 3"]
    """where they sit, m"""

    def moved_to(self, pose: Pose) -> Pose:
        """The pose with its markers where they are seen."""
        by = np.nanmean(self.places - self.on_body @ pose.rotation.T, axis=0)
        return Pose(by, pose.rotation)


def rest_near(mechanism: Mechanism, body: Body, recording: FollowedSamples) -> Equilibrium | None:
    """Where the platform rests with its main marker in the middle of a window; None where it cannot, or is not seen."""
    place = recording.window.equilibrium
    if place is None:
        place = recording.window.middle(mechanism.robot.markers)
    if place is None:
        return None
    try:
        return equilibrium_at(mechanism, body, place)
    except InfeasibleError:
        return None


def poses_from_rests(
    mechanism: Mechanism, shared: Float[np.ndarray, " shared"], asked: Sequence[tuple[Unread, Equilibrium]]
) -> list[Pose]:
    """The pose of each window at its begin, if it swings about this rest: by the rest's lengths and its markers."""
    if not asked:
        return []
    most = max(len(one.places) for one, _ in asked)
    places = np.full((len(asked), most, 3), np.nan)
    on_body = np.zeros((len(asked), most, 3))
    for k, (one, _) in enumerate(asked):
        places[k, : len(one.places)], on_body[k, : len(one.on_body)] = one.places, one.on_body
    begins = Poses(
        np.array([rest.pose.position for _, rest in asked]), np.array([rest.pose.rotation for _, rest in asked])
    )
    lengths = np.array([rest.lengths for _, rest in asked])
    targets = Targets(places, on_body, lengths, np.array([one.recording.begin for one, _ in asked]))
    found, _ = refined(mechanism, shared, targets, begins)
    turned = zip(found.positions, found.rotations, strict=True)
    return [one.moved_to(Pose(*pose)) for (one, _), pose in zip(asked, turned, strict=True)]
