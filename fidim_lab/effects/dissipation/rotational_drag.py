"""Resistance to the platform's rotation: air, a hose."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import turning
from fidim_lab.model.slots import PlatformState

REST_RATE = 1e-6
"""rad/s: keeps the derivative finite at rest"""


@dataclass(frozen=True)
class RotationalDrag(NamedEffect):
    """T = −c ω."""

    id: ClassVar[str] = "rotational-drag"
    says: ClassVar[str] = "viscous torque against the rotation, T = −c ω"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N m s", "drag takes energy", scale=0.01, low=0.0, high=10.0, start=0.02),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c ω."""
        return turning(-theta[0] * state.spin)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That of a sail."""
        return {"c": context.rotational_drag}


@dataclass(frozen=True)
class RotationalDragPerAxis(NamedEffect):
    """T = −R diag(c) Rᵀ ω: another drag about each axis of the body."""

    id: ClassVar[str] = "rotational-drag"
    variant: ClassVar[str] = "per body axis"
    says: ClassVar[str] = (
        "viscous torque against the rotation, with a coefficient for each body axis, T = −R diag(c) Rᵀ ω"
    )
    source: ClassVar[str] = "spec/irma4u.md §3.3: yaw is damped most on IRMA4U"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(f"c{axis}", "N m s", f"drag about {axis} takes energy", scale=0.01, low=0.0, high=10.0, start=0.02)
        for axis in "xyz"
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−R diag(c) Rᵀ ω."""
        return turning(-state.rotation @ (theta * (state.rotation.T @ state.spin)))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That of a sail, about each axis."""
        return {parameter.name: context.rotational_drag for parameter in self.parameters}


@dataclass(frozen=True)
class RotationalDragQuadratic(NamedEffect):
    """T = −c ‖ω‖ ω."""

    id: ClassVar[str] = "rotational-drag-quadratic"
    says: ClassVar[str] = "quadratic air drag on the rotation, T = −c ‖ω‖ ω"
    source: ClassVar[str] = "Rayleigh's drag of each surface element, whose speed is proportional to ω"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N m s²", "drag takes energy", scale=0.02, low=0.0, high=10.0, start=0.02),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c ‖ω‖ ω."""
        spin = state.spin
        return turning(-theta[0] * ca.sqrt(ca.dot(spin, spin) + REST_RATE**2) * spin)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That of a sail which turns about the platform's far side."""
        drag = context.quadratic_drag
        return {"c": Limit(drag.size * context.width**3, drag.why)}
