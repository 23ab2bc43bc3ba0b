"""A steady force and torque that turn with the platform: a fan or a leaking air hose on board."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.loads.constant_force import share_of_weight
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_centre, turning
from fidim_lab.model.slots import PlatformState


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
