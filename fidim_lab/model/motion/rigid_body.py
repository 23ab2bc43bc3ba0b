"""The platform as a rigid body per unit mass: M, C v and φ of Eq. 8–9, as CasADi expressions and as numbers.

Everything is divided by the mass, so tensions come out in N/kg; the mass itself cannot be seen in free motion.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fidim_lab.arrays import Positions, Rotations, Series, Twists
from fidim_lab.data.records import Body
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class BodyExpressions:
    """Eq. 9 per unit mass at one rotation, world frame."""

    com: ca.SX
    """s′ = R ᴾs′ (3), m"""
    inertia: ca.SX
    """R ᴾI′ Rᵀ about P (3 × 3), m²"""

    @staticmethod
    def of(parameters: ca.SX, rotation: ca.SX) -> "BodyExpressions":
        """From the nine base parameters in the order of PARAMETER_NAMES and the rotation body → world."""
        xx, yy, zz, xy, xz, yz = (parameters[3 + index] for index in range(6))
        inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
        return BodyExpressions(com=rotation @ parameters[:3], inertia=rotation @ inertia @ rotation.T)

    @property
    def mass_matrix(self) -> ca.SX:
        """M/m (6 × 6)."""
        cross = skew(self.com)
        return ca.vertcat(ca.horzcat(ca.SX.eye(3), -cross), ca.horzcat(cross, self.inertia))

    def gyroscopic(self, angular_velocity: ca.SX) -> ca.SX:
        """C v/m (6)."""
        return ca.vertcat(
            ca.cross(angular_velocity, ca.cross(angular_velocity, self.com)),
            ca.cross(angular_velocity, self.inertia @ angular_velocity),
        )

    def gravity_wrench(self, gravity: np.ndarray) -> ca.SX:
        """φ/m (6) for the gravitational acceleration in the world frame, m/s²."""
        return ca.vertcat(ca.SX(ca.DM(gravity)), ca.cross(self.com, ca.SX(ca.DM(gravity))))


def energy(mechanism: Mechanism, body: Body, positions: Positions, rotations: Rotations, twists: Twists) -> Series:
    """Kinetic and potential energy over mass, J/kg; the potential is zero where G is at the world's origin.

    Constant in free motion with rigid cables and no effects.
    """
    velocities, spins = twists[:, :3], twists[:, 3:]
    arms = rotations @ body.com
    body_spins = np.einsum("nji,nj->ni", rotations, spins)
    kinetic = (
        0.5 * np.sum(velocities**2, axis=1)
        + np.sum(velocities * np.cross(spins, arms), axis=1)
        + 0.5 * np.einsum("ni,ij,nj->n", body_spins, body.inertia_matrix, body_spins)
    )
    return kinetic - (positions + arms) @ mechanism.robot.gravity
