"""Loss where a cable bends round its pulley: a torque against the change of the wrap angle."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import FRICTION, LEAST_RADIUS, Context, Limit, over_rate
from fidim_lab.effects.wrenches import dry, joint_rate, joint_torque, over_cables
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class PulleyFriction(NamedEffect):
    """Torque −viscous φ̇ − dry sign(φ̇), smoothed, on each wrap angle φ."""

    id: ClassVar[str] = "pulley-friction"
    says: ClassVar[str] = "friction of the pulley, torque −viscous φ̇ − dry tanh(φ̇ / 0.01 rad/s) on the wrap angle φ"
    source: ClassVar[str] = "Coulomb and viscous; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("viscous", "N m s", "damping takes energy", scale=0.01, low=0.0, high=100.0, start=0.02),
        Parameter("dry", "N m", "friction takes energy", scale=0.002, low=0.0, high=10.0, start=0.005),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The torque, as a force at each attachment across its cable, in the pulley's plane."""

        def each(cable: CableExpressions) -> ca.SX:
            rate = joint_rate(state, cable, cable.wrap_gradient)
            return joint_torque(cable, cable.wrap_gradient, -theta[0] * rate - theta[1] * dry(rate))

        return over_cables(self, state, each)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r, and the same at the usual rate."""
        torque = context.bearing_torque(self.cable)
        return {"viscous": over_rate(torque, context.wrap_rate), "dry": torque}


@dataclass(frozen=True)
class PulleyFrictionByTension(NamedEffect):
    """Torque −arm τ sign(φ̇), smoothed: a bearing rubs as hard as its cable pulls."""

    id: ClassVar[str] = "pulley-friction"
    variant: ClassVar[str] = "by tension"
    says: ClassVar[str] = "friction of the pulley in proportion to the tension, torque −arm τ tanh(φ̇ / 0.01 rad/s)"
    source: ClassVar[str] = "Coulomb; Euler and Eytelwein for a cable that slips on its groove"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("arm", "m", "friction takes energy", scale=5e-5, low=0.0, high=0.1, start=1e-4),
    )

    def tension_wrench(self, number: int, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The torque, as a force at the attachment across its cable, in the pulley's plane."""
        if not self.concerns(number):
            return ca.SX(6, 1)
        cable = state.cables[number - 1]
        rate = joint_rate(state, cable, cable.wrap_gradient)
        return joint_torque(cable, cable.wrap_gradient, -theta[0] * dry(rate))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ r."""
        chosen = context.radii if self.cable is None else (context.radii[self.cable - 1],)
        radius = max(min(chosen), LEAST_RADIUS)
        why = f"friction on a pulley of {1e3 * radius:.0f} mm cannot exceed μ r (μ = {FRICTION:g})"
        return {"arm": Limit(FRICTION * radius, why)}
