"""A steady force on the platform; one that turns with it, with a torque: a fan or a leaking air hose on board."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_centre, turning
from fidim_lab.model.slots import PlatformState

SHARE_OF_WEIGHT = 0.3
"""more would not be called a disturbance"""


@dataclass(frozen=True)
class ConstantForce(NamedEffect):
    """A steady force (fx, fy, fz) at G, world frame."""

    id: ClassVar[str] = "constant-force"
    says: ClassVar[str] = "a steady force (fx, fy, fz) at the centre of mass, world frame"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector("f", "N", "force", scale=0.05, most=1000.0)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The force at G."""
        return at_centre(state, theta)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A share of the weight."""
        return {parameter.name: share_of_weight(context) for parameter in self.parameters}


def share_of_weight(context: Context) -> Limit:
    """The largest force that still is a disturbance, N."""
    why = f"that is over {100 * SHARE_OF_WEIGHT:.0f} % of the weight of {context.weight:.0f} N"
    return Limit(SHARE_OF_WEIGHT * context.weight, why)


@dataclass(frozen=True)
class BodyForce(NamedEffect):
    """F = R f at G, T = R τ: steady in the body frame."""

    id: ClassVar[str] = "body-force"
    says: ClassVar[str] = "a steady force (fx, fy, fz) at the centre of mass and torque (tx, ty, tz), both in body axes"
    source: ClassVar[str] = "Newton; a thrust on board"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *vector("f", "N", "force", scale=0.05, most=1000.0),
        *vector("t", "N m", "torque", scale=0.01, most=100.0),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Turned into the world frame."""
        return at_centre(state, state.rotation @ theta[:3]) + turning(state.rotation @ theta[3:])

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A share of the weight, at the platform's edge."""
        force = share_of_weight(context)
        torque = Limit(force.size * context.width, f"{force.why} at its edge")
        return {one.name: force if one.name.startswith("f") else torque for one in self.parameters}
