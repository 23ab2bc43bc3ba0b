"""Poses that fit first markers and lengths, of many windows from many starts at once.

One search takes microseconds of arithmetic and milliseconds of Python, so all that are asked for go side by side;
each is damped by itself and ends by itself, as if it were alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.integrate import States
from fidim_lab.model.sensitivity.lengths import lengths_at_rest
from fidim_lab.model.sensitivity.starts import Starts, linearised_starts, tied

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


def skew(vectors: Float[np.ndarray, "K M 3"]) -> Float[np.ndarray, "K M 3 3"]:
    """[x]× of each."""
    return np.swapaxes(np.cross(vectors[..., np.newaxis, :], np.eye(3)), -1, -2)


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
