"""Friction of pulleys: about their swivels, and where a cable bends round them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import FRICTION, LEAST_RADIUS, Context, Limit, over_rate
from fidim_lab.effects.wrenches import dry, joint_rate, joint_torque, over_cables
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import ExtraState, PlatformState

STILL = 1e-3
"""rad/s: keeps the derivative of what builds up finite at rest"""


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
class SwivelFrictionGivingWay(NamedEffect):
    """Torque −c b about each swivel axis; b builds up from −1 to 1 over a turn of `give`: ḃ = (σ̇ − |σ̇| b) / give.

    Small swings feel a spring of stiffness c/give, large ones dry friction.
    """

    id: ClassVar[str] = "swivel-friction"
    variant: ClassVar[str] = "giving way"
    says: ClassVar[str] = "dry torque about each swivel axis that builds up over a turn, −c b, ḃ = (σ̇ − |σ̇| b) / give"
    source: ClassVar[str] = "Dahl, A solid friction model, 1968"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *SwivelFriction.parameters,
        Parameter(
            "give",
            "rad",
            "what sticks gives way over some turn",
            scale=0.01,
            low=0.003,
            high=1.0,
            start=0.03,
            scan=(0.015, 0.05, 0.15),
        ),
    )
    cables: int = 1
    """of the robot"""

    @property
    def extra_states(self) -> tuple[ExtraState, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """b of each cable; nothing is known of it at the start but that it is within ±1, of which sd is 0.6."""
        return tuple(ExtraState(f"b{number}", "1", spread=0.6) for number in range(1, self.cables + 1))

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The torques, as forces at the attachments across their pulleys' planes."""
        total = ca.SX.zeros(6)
        for cable, built_up in zip(state.cables, ca.vertsplit(state.extra), strict=True):
            total += joint_torque(cable, cable.swivel_gradient, -theta[0] * built_up)
        return total

    def extra_start(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Nothing has built up."""
        return ca.SX.zeros(self.cables)

    def extra_rates(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """ḃ."""
        rates = ca.vertcat(*(joint_rate(state, cable, cable.swivel_gradient) for cable in state.cables))
        return (rates - ca.sqrt(rates**2 + STILL**2) * state.extra) / theta[1]

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r."""
        return {"c": context.bearing_torque(None)}


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
