"""Friction where a cable is tied to the platform: a torque against the platform's rotation relative to its cable."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.forces import DRY_RATE, at_arm, over_cables, turning
from fidim_lab.effects.plausibility import Context, Limit, over_rate
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class AttachmentFriction(NamedEffect):
    """Torque −(viscous + dry/‖s‖) s on the platform, s = ω − t × Ȧ/ρ its rotation against the cable.

    The cable hands the reaction on as a force across itself, at the attachment: −torque × t/ρ. The sum of both takes
    the power torque · s ≤ 0.
    """

    id: ClassVar[str] = "attachment-friction"
    says: ClassVar[str] = "torque at each attachment, −(viscous + dry/√(s² + 0.01²)) s, s = ω − t × Ȧ/ρ"
    source: ClassVar[str] = "Coulomb and viscous; MODEL.md §5, REAL.md §3.3"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("viscous", "N m s", "damping takes energy", scale=0.005, low=0.0, high=20.0, start=0.01),
        Parameter("dry", "N m", "friction takes energy", scale=0.002, low=0.0, high=10.0, start=0.005),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Torque and the cable's reaction."""

        def each(cable: CableExpressions) -> ca.SX:
            t, rho = cable.direction, cable.free_length
            slip = state.spin - ca.cross(t, state.velocity(cable.arm)) / rho
            speed = ca.sqrt(ca.dot(slip, slip) + DRY_RATE**2)
            torque = -(theta[0] + theta[1] / speed) * slip
            return turning(torque) + at_arm(cable.arm, ca.cross(t, torque) / rho)

        return over_cables(self, state, each)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r of an eyelet or knot, and the same at the usual rate."""
        torque = context.joint_torque(self.cable)
        return {"viscous": over_rate(torque, context.slip_rate), "dry": torque}
