"""Resistance in the bearings about which the pulleys swivel: dry or viscous, of one cable or alike for all."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.forces import dry, joint_rate, joint_torque, over_cables
from fidim_lab.effects.plausibility import Context, Limit, over_rate
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class SwivelFriction(NamedEffect):
    """Torque −c sign(σ̇), smoothed, about each swivel axis."""

    id: ClassVar[str] = "swivel-friction"
    says: ClassVar[str] = "dry torque about each swivel axis, −c tanh(σ̇ / 0.01 rad/s)"
    source: ClassVar[str] = "Coulomb; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N m", "friction takes energy", scale=0.002, low=0.0, high=10.0, start=0.005),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The torque, as a force at each attachment across its pulley's plane."""
        return over_cables(
            self,
            state,
            lambda cable: joint_torque(
                cable, cable.swivel_gradient, -theta[0] * dry(joint_rate(state, cable, cable.swivel_gradient))
            ),
        )

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r."""
        return {"c": context.bearing_torque(self.cable)}


@dataclass(frozen=True)
class SwivelDamping(NamedEffect):
    """Torque −c σ̇ about each swivel axis."""

    id: ClassVar[str] = "swivel-damping"
    says: ClassVar[str] = "viscous torque about each swivel axis, −c σ̇"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "N m s", "damping takes energy", scale=0.01, low=0.0, high=100.0, start=0.02),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The torque, as a force at each attachment across its pulley's plane."""
        return over_cables(
            self,
            state,
            lambda cable: joint_torque(
                cable, cable.swivel_gradient, -theta[0] * joint_rate(state, cable, cable.swivel_gradient)
            ),
        )

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r at the usual rate."""
        return {"c": over_rate(context.bearing_torque(self.cable), context.swivel_rate)}
