"""A cable round its swivelling pulley, as CasADi expressions, from the tangent to the pulley's circle.

Derived here from the circle (centre, tangent point, arc), not from the closed formulas of the reference model, so that
the two can check each other.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fidim_lab.data.records import Cable


@dataclass(frozen=True, eq=False)
class Tangent:
    """One cable where it leaves its pulley; all vectors in the world frame, expressions (3, 1)."""

    length: ca.SX
    """from D round the pulley to A, m"""
    free: ca.SX
    """ρ, the straight part from B to A, m"""
    wrap: ca.SX
    """φ, angle of the arc, rad"""
    along: ca.SX
    """unit vector from B to A: gradient of the length"""
    normal: ca.SX
    """unit vector in the pulley's plane in which A moves when the wrap grows: φ̇ = normal·Ȧ/ρ"""
    outward: ca.SX
    """u, unit vector from the swivel axis to A, across the axis"""
    across: ca.SX
    """unit vector normal to the pulley's plane: σ̇ = across·Ȧ/h"""
    lever: ca.SX
    """h, distance of A from the swivel axis, m"""

    def swivel_rate(self, velocity: ca.SX) -> ca.SX:
        """σ̇, rad/s, of an attachment that moves with `velocity` against D."""
        return ca.dot(self.across, velocity) / self.lever

    def wrap_rate(self, velocity: ca.SX) -> ca.SX:
        """φ̇, rad/s."""
        return ca.dot(self.normal, velocity) / self.free

    def curvature(self, velocity: ca.SX) -> ca.SX:
        """l̈ of an attachment that moves with this velocity and no acceleration, m/s²."""
        turning = ca.dot(self.along, self.outward) * self.lever * self.swivel_rate(velocity) ** 2
        return self.free * self.wrap_rate(velocity) ** 2 + turning


def tangent(from_entry: ca.SX, cable: Cable) -> Tangent:
    """The cable to an attachment at `from_entry` = A − D, (3, 1), world frame, m.

    Singular (NaN) where A lies on the swivel axis or inside the pulley.
    """
    x, y, z = (ca.DM(axis) for axis in (cable.x, cable.y, cable.z))
    r = cable.radius
    east, north, height = ca.dot(x, from_entry), ca.dot(y, from_entry), ca.dot(z, from_entry)
    lever = ca.sqrt(east**2 + north**2)
    outward = (east * x + north * y) / lever
    across = (east * y - north * x) / lever
    # In the pulley's plane (outward, z), from the centre of the circle at r·outward.
    out, distance_squared = lever - r, (lever - r) ** 2 + height**2
    free = ca.sqrt(distance_squared - r**2)
    # Unit radius to the tangent point: A's direction turned by arccos(r/L) towards the side where the cable comes up.
    touch_out = (r * out - free * height) / distance_squared
    touch_up = (r * height + free * out) / distance_squared
    along_out, along_up = (out - r * touch_out) / free, (height - r * touch_up) / free
    along = along_out * outward + along_up * z
    wrap = ca.atan2(touch_up, -touch_out)
    wrap = wrap + 2 * np.pi * (wrap < 0)
    return Tangent(
        length=r * wrap + free,
        free=free,
        wrap=wrap,
        along=along,
        normal=along_up * outward - along_out * z,
        outward=outward,
        across=across,
        lever=lever,
    )
