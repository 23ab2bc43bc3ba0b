"""Scales of the recorded motion, shared by all families."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.effects.wrenches import at_arm
from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.mismatch.unknown_force.responses import Responses
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True, eq=False)
class Reach:
    """The platform's places and speeds, from which scales are taken."""

    positions: Float[np.ndarray, "S 3"]
    """of the centre of mass, m"""
    references: Float[np.ndarray, "S 3"]
    """of P"""
    speed: float
    """m/s, the 99th percentile"""
    spin: float
    """rad/s"""
    seconds: float

    @staticmethod
    def of(found: Responses, com: Float[np.ndarray, " 3"]) -> "Reach":
        """Of the windows of a fit, at the centre of mass; com in the body frame, m."""
        along = [one.along for one in found.windows]
        references = np.concatenate([a.positions for a in along])
        positions = np.concatenate([a.positions + a.rotations @ com for a in along])
        thin = np.s_[:: max(1, len(positions) // 4000)]
        twists = np.concatenate([a.twists for a in along])
        return Reach(
            positions=positions[thin],
            references=references[thin],
            speed=float(np.percentile(np.linalg.norm(twists[:, :3], axis=1), 99)),
            spin=float(np.percentile(np.linalg.norm(twists[:, 3:], axis=1), 99)),
            seconds=max(float(a.t[-1]) for a in along),
        )

    def places(self, point: ForcePoint) -> Float[np.ndarray, "S 3"]:
        """Where this point was, m."""
        return self.positions if point is ForcePoint.CENTRE_OF_MASS else self.references

    @property
    def size(self) -> float:
        """m, diagonal of the box that was visited."""
        return float(np.linalg.norm(np.ptp(self.positions, axis=0)))


def centres_of(points: Float[np.ndarray, "S a"], width: float, most: int) -> Float[np.ndarray, "K a"]:
    """Points of a cloud about 1.2 widths apart that cover it: always the one farthest from those taken so far."""
    chosen = [int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    away = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < most and away.max() > 1.2 * width:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]


def velocity(state: PlatformState) -> ca.SX:
    """Of the centre of mass (3), m/s."""
    return state.velocity(state.centre)


def pushed(state: PlatformState, forces: ca.SX) -> ca.SX:
    """Wrenches (6 × d) of forces (3 × d) on the centre of mass."""
    return ca.horzcat(*(at_arm(state.centre, forces[:, k]) for k in range(forces.size2())))


def turned(torques: ca.SX) -> ca.SX:
    """Wrenches (6 × d) of torques (3 × d)."""
    return ca.vertcat(ca.SX.zeros(3, torques.size2()), torques)


def any_force(state: PlatformState, shape: ca.SX) -> ca.SX:
    """On the centre of mass along x, y, z (6 × 3)."""
    return pushed(state, ca.SX.eye(3))


def any_torque(state: PlatformState, shape: ca.SX) -> ca.SX:
    """About x, y, z (6 × 3)."""
    return turned(ca.SX.eye(3))


def drag_on(point: ForcePoint, state: PlatformState, shape: ca.SX) -> ca.SX:
    """A force on a point along its velocity (6 × 1)."""
    arm = point.arm(state)
    return at_arm(arm, state.velocity(arm))


def force_on(point: ForcePoint, state: PlatformState, shape: ca.SX) -> ca.SX:
    """On a point along x, y, z (6 × 3)."""
    return ca.horzcat(*(at_arm(point.arm(state), ca.SX(ca.DM.eye(3)[:, k])) for k in range(3)))
