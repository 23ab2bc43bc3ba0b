"""Cable, swivel pulley and rotation as CasADi expressions (spec/model.md §1, paper §2.1 and Eq. 1).

Written once here; lengths, Ξ, dynamics and effects are all built from `cable_expressions`. For numbers use `Mechanism`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fidim_lab.arrays import Matrix3, Vector3
from fidim_lab.data.records import Cable


def skew(vector: ca.SX) -> ca.SX:
    """The matrix [v]× with [v]× w = v × w."""
    return ca.skew(vector)


def rotation_from_gibbs(gibbs: ca.SX) -> ca.SX:
    """Rotation matrix of a Gibbs (Rodrigues) vector g = tan(θ/2) · axis; singular only at θ = π.

    R = I + 2 ([g]× + [g]×²) / (1 + g·g), exactly orthogonal for every g.
    """
    cross = skew(gibbs)
    return ca.SX.eye(3) + (2 / (1 + ca.dot(gibbs, gibbs))) * (cross + cross @ cross)


def gibbs_rate(gibbs: ca.SX, angular_velocity: ca.SX) -> ca.SX:
    """ġ for the angular velocity ω in the world frame, where the rotation is R(g) R_reference.

    ġ = ½ (ω + ω × g + g (g·ω)).
    """
    return (angular_velocity + ca.cross(angular_velocity, gibbs) + gibbs * ca.dot(gibbs, angular_velocity)) / 2


def rotation_matrix(gibbs: Vector3) -> Matrix3:
    """The rotation of a Gibbs vector as numbers; the same formula as `rotation_from_gibbs`."""
    x, y, z = gibbs
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + (2.0 / (1.0 + gibbs @ gibbs)) * (cross + cross @ cross)


@dataclass(frozen=True, eq=False)
class CableConstants:
    """A `Cable` whose entries may be symbols, so that an effect can move an anchor or change a radius."""

    d: ca.SX
    a: ca.SX
    radius: ca.SX
    x: ca.SX
    y: ca.SX
    z: ca.SX

    @staticmethod
    def of(cable: Cable) -> "CableConstants":
        """The constants as the robot file has them."""
        d, a, x, y, z = (ca.SX(ca.DM(vector)) for vector in (cable.d, cable.a, cable.x, cable.y, cable.z))
        return CableConstants(d=d, a=a, radius=ca.SX(cable.radius), x=x, y=y, z=z)


@dataclass(frozen=True, eq=False)
class CableExpressions:
    """One cable at one pose, as expressions; names and symbols of spec/model.md §1. World frame, SI."""

    length: ca.SX
    """l = r φ + ρ, m"""
    direction: ca.SX
    """t, unit vector from B to A (3)"""
    arm: ca.SX
    """R a, from P to the attachment (3), m"""
    swivel_angle: ca.SX
    """σ, rad, in (−π, π]"""
    wrap_angle: ca.SX
    """φ, rad, in [0, 2π)"""
    free_length: ca.SX
    """ρ from B to A, m"""
    axis_distance: ca.SX
    """h of the attachment from the swivel axis, m; the pulley has no plane where it vanishes"""
    clearance: ca.SX
    """L² − r², m²: negative where the attachment is inside the pulley"""
    swivel_gradient: ca.SX
    """of σ with respect to the attachment (3), rad/m: σ̇ = swivel_gradient · Ȧ"""
    wrap_gradient: ca.SX
    """of φ with respect to the attachment (3), rad/m: φ̇ = wrap_gradient · Ȧ"""
    constants: CableConstants
    """what it was made of"""

    @property
    def screw(self) -> ca.SX:
        """The cable's row of Ξ as a column: [t; R a × t] (Eq. 4)."""
        return ca.vertcat(self.direction, ca.cross(self.arm, self.direction))


def cable_expressions(cable: Cable | CableConstants, position: ca.SX, rotation: ca.SX) -> CableExpressions:
    """One cable as a function of the pose.

    position (3) of P in the world frame, m; rotation (3 × 3) body → world. Source: spec/model.md §1.
    A radius that is the number 0 gives the point-to-point cable itself, regular on the swivel axis too; a symbolic
    radius tends to it. Singular for r > 0 where h → 0, and where L ≤ r: see `axis_distance` and `clearance`.
    """
    constants = CableConstants.of(cable) if isinstance(cable, Cable) else cable
    r = constants.radius
    arm = rotation @ constants.a
    c = position + arm - constants.d
    cx, cy, cz = ca.dot(c, constants.x), ca.dot(c, constants.y), ca.dot(c, constants.z)
    h = ca.sqrt(cx**2 + cy**2)
    e = h - r
    span = e**2 + cz**2  # L²
    clearance = span - r**2
    if r.is_zero():
        free = ca.norm_2(c)
        direction = c / free
        wrap = ca.atan2(h, cz)
    else:
        free = ca.sqrt(clearance)
        sine, cosine = (free * e + r * cz) / span, (free * cz - r * e) / span
        direction = (sine / h) * (cx * constants.x + cy * constants.y) + cosine * constants.z
        wrap = ca.atan2(-sine, -cosine) + ca.pi  # in [0, 2π) without a jump at π
    out = (cx * constants.x + cy * constants.y) / h
    return CableExpressions(
        length=r * wrap + free,
        direction=direction,
        arm=arm,
        swivel_angle=ca.atan2(cy, cx),
        wrap_angle=wrap,
        free_length=free,
        axis_distance=ca.SX(1.0) if r.is_zero() else h,
        clearance=clearance,
        swivel_gradient=(cx * constants.y - cy * constants.x) / h**2,
        # t turns towards cos φ u − sin φ z while φ grows
        wrap_gradient=(ca.dot(direction, constants.z) * out - ca.dot(direction, out) * constants.z) / free,
        constants=constants,
    )
