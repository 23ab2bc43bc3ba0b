"""Drag of the air on the platform as a whole, at its centre of mass; and drag by powers of speed that no air has."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.effects.effect import NamedEffect, Parameter, UnknownEffect
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_centre, turning
from fidim_lab.model.slots import PlatformState

REST_RATE = 1e-6
"""rad/s: keeps the derivative finite at rest"""

STILL = 1e-6
"""m/s: keeps ‖v‖ differentiable at rest"""
CREEP = 1e-3
"""m/s, up to which a flat drag is linear: every window begins at rest, where its slope would have no end"""


@dataclass(frozen=True)
class AirDragLinear(NamedEffect):
    """F = −c v_G."""

    id: ClassVar[str] = "air-drag-linear"
    says: ClassVar[str] = "linear air drag at the centre of mass, F = −c v_G"
    source: ClassVar[str] = "Stokes; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N s/m", "drag takes energy", scale=0.1, low=0.0, high=100.0, start=0.2),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c v_G at G."""
        return at_centre(state, -theta[0] * state.velocity(state.centre))

    def wider(self, values: np.ndarray, robot: Robot) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """Of a lower power of the speed, as strong at 1 m/s."""
        return ((FlatDrag(), np.array([values[0], FlatDrag().absent[1]])),) if values[0] > 0 else ()

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That of a sail at the fastest speed."""
        return {"c": context.linear_drag}


@dataclass(frozen=True)
class AirDragQuadratic(NamedEffect):
    """F = −c ‖v_G‖ v_G."""

    id: ClassVar[str] = "air-drag-quadratic"
    says: ClassVar[str] = "quadratic air drag at the centre of mass, F = −c ‖v_G‖ v_G, c = ½ ρ C A"
    source: ClassVar[str] = "Newton's drag law; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N s²/m²", "drag takes energy", scale=0.2, low=0.0, high=100.0, start=0.5),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c ‖v_G‖ v_G at G."""
        velocity = state.velocity(state.centre)
        speed = ca.sqrt(ca.dot(velocity, velocity) + STILL**2)
        return at_centre(state, -theta[0] * speed * velocity)

    def wider(self, values: np.ndarray, robot: Robot) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """Of a higher power of the speed, as strong at 1 m/s."""
        return ((SteepDrag(), np.array([values[0], SteepDrag().absent[1]])),) if values[0] > 0 else ()

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """½ ρ C A of a sail."""
        return {"c": context.quadratic_drag}


def _by_power(state: PlatformState, theta: ca.SX, still: float) -> ca.SX:
    """−c ‖v_G‖^(p − 1) v_G at G; θ = (c, p)."""
    velocity = state.velocity(state.centre)
    squared = ca.dot(velocity, velocity) + still**2
    return at_centre(state, -theta[0] * squared ** (0.5 * (theta[1] - 1)) * velocity)


_STRENGTH = Parameter("c", "N at 1 m/s", "drag takes energy", scale=0.2, low=0.0, high=1e3, start=0.5)


@dataclass(frozen=True)
class SteepDrag(UnknownEffect):
    """F = −c ‖v_G‖^(p − 1) v_G with p well above 2, v in m/s: no air does that, whatever does.

    Without it drags of the catalogue are put together with what is not there, until they imitate it.
    """

    variant: ClassVar[str] = "a drag steeper than air's"
    says: ClassVar[str] = "a force against the velocity of the centre of mass, F = −c ‖v_G‖^(p − 1) v_G"
    source: ClassVar[str] = "a power law, for want of a better one"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        _STRENGTH,
        Parameter("p", "1", "that of air has 1 to 2", scale=0.5, low=2.5, high=8.0, start=3.0, scan=(3.0,)),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c ‖v_G‖^(p − 1) v_G at G."""
        return _by_power(state, theta, STILL)

    def narrower(self, values: np.ndarray) -> tuple[NamedEffect, np.ndarray]:
        """Of the square, as strong at 1 m/s."""
        return AirDragQuadratic(), values[:1]


@dataclass(frozen=True)
class FlatDrag(UnknownEffect):
    """F = −c ‖v_G‖^(p − 1) v_G with p well below 1, v in m/s: grease, or something that the platform slides along."""

    variant: ClassVar[str] = "a drag flatter than air's"
    says: ClassVar[str] = SteepDrag.says
    source: ClassVar[str] = SteepDrag.source
    parameters: ClassVar[tuple[Parameter, ...]] = (
        _STRENGTH,
        Parameter("p", "1", "that of air has 1 to 2", scale=0.5, low=0.0, high=0.75, start=0.5, scan=(0.5,)),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−c ‖v_G‖^(p − 1) v_G at G."""
        return _by_power(state, theta, CREEP)

    def narrower(self, values: np.ndarray) -> tuple[NamedEffect, np.ndarray]:
        """Of the speed itself, as strong at 1 m/s."""
        return AirDragLinear(), values[:1]


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
