"""Inertia of what swivels with the pulleys."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import LEAST_RADIUS, Context, Limit
from fidim_lab.effects.wrenches import joint_rate
from fidim_lab.model.slots import PlatformState

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
