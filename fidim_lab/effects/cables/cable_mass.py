"""Weight and inertia of cables, to first order in their linear density, and inertia of their swivels."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import LEAST_RADIUS, Context, Limit
from fidim_lab.effects.wrenches import joint_rate
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class CableMass(NamedEffect):
    """Straight cables of linear density μ that hang and swing with the platform.

    A point at distance y from the attachment moves with (ρ − y) φ̇ in the pulley's plane and (h − y sin φ) σ̇ across it
    (the motors are locked, so no cable runs): kinetic energy ½ μ [ρ³/3 φ̇² + ρ (h² + h h_B + h_B²)/3 σ̇²], with
    h_B = r (1 − cos φ) the distance of B from the swivel axis. The weight is −∂V of V = −μ g · ∫ x ds over the straight
    part and the arc. The shortening by sag is of second order in μ, the arc's own swinging 10⁻⁵ of the rest: left out.
    """

    id: ClassVar[str] = "cable-mass"
    says: ClassVar[str] = "weight and inertia of straight cables of linear density μ, to first order"
    source: ClassVar[str] = "Lagrange; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu", "kg/m", "density is positive", scale=1e-3, low=0.0, high=1.0, start=0.01),
    )

    def kinetic_energy(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """½ μ Σ [ρ³/3 φ̇² + ρ (h² + h h_B + h_B²)/3 σ̇²]."""
        total = ca.SX(0)
        for cable in state.cables:
            rho, near = cable.free_length, cable.constants.radius * (1 - ca.cos(cable.wrap_angle))
            far = ca.norm_2(_across(state, cable))
            wrap = joint_rate(state, cable, cable.wrap_gradient)
            swivel = joint_rate(state, cable, cable.swivel_gradient)
            total += rho**3 / 3 * wrap**2 + rho * (far**2 + far * near + near**2) / 3 * swivel**2
        return theta[0] / 2 * total

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−∂V, V the potential energy of all cables."""
        moment = sum((_moment(state, cable) for cable in state.cables), ca.SX.zeros(3))
        return theta[0] * state.gradient(ca.dot(state.gravity, moment))


def _across(state: PlatformState, cable: CableExpressions) -> ca.SX:
    """From the swivel axis to the attachment, square to the axis (3), m."""
    c, z = state.position + cable.arm - cable.constants.d, cable.constants.z
    return c - ca.dot(c, z) * z


def _moment(state: PlatformState, cable: CableExpressions) -> ca.SX:
    """∫ x ds along a cable from D to A, m²."""
    rho, phi, r = cable.free_length, cable.wrap_angle, cable.constants.radius
    across = _across(state, cable)
    straight = rho * (state.position + cable.arm) - rho**2 / 2 * cable.direction
    outward = (phi - ca.sin(phi)) * across / ca.norm_2(across)
    return straight + r * phi * cable.constants.d + r**2 * (outward + (1 - ca.cos(phi)) * cable.constants.z)


HOUSING = 5.0
"""times a pulley's radius: how far the mass of what swivels can lie from the axis"""


@dataclass(frozen=True)
class SwivelInertia(NamedEffect):
    """J σ̈ about each swivel axis, from the kinetic energy ½ J σ̇²."""

    id: ClassVar[str] = "swivel-inertia"
    says: ClassVar[str] = "inertia of pulley and housing about each swivel axis: kinetic energy ½ J σ̇²"
    source: ClassVar[str] = "Lagrange; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("J", "kg m²", "inertia is positive", scale=1e-3, low=0.0, high=1.0, start=2e-3),
    )

    def kinetic_energy(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """½ J Σ σ̇²."""
        rates = (
            joint_rate(state, cable, cable.swivel_gradient)
            for number, cable in enumerate(state.cables, start=1)
            if self.concerns(number)
        )
        return theta[0] / 2 * sum((rate**2 for rate in rates), ca.SX(0))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A housing as heavy as the platform, near its axis."""
        radius = HOUSING * max(*context.radii, LEAST_RADIUS)
        why = f"not even {context.mass:.0f} kg at {1e3 * radius:.0f} mm from the axis have as much"
        return {"J": Limit(context.mass * radius**2, why)}
