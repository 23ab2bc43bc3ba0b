"""Friction where a cable is tied to the platform: a torque against the platform's rotation relative to its cable."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit, over_rate
from fidim_lab.effects.wrenches import DRY_RATE, at_arm, over_cables, turning
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import ExtraState, PlatformState

REST_RATE = 0.01
"""rad/s: a platform that turns more slowly lets what has given way creep no farther"""


@dataclass(frozen=True)
class AttachmentFriction(NamedEffect):
    """Torque −(viscous + dry/‖s‖) s on the platform, s = ω − t × Ȧ/ρ its rotation against the cable.

    The cable hands the reaction on as a force across itself, at the attachment: −torque × t/ρ. The sum of both takes
    the power torque · s ≤ 0.
    """

    id: ClassVar[str] = "attachment-friction"
    says: ClassVar[str] = "torque at each attachment, −(viscous + dry/√(s² + 0.01²)) s, s = ω − t × Ȧ/ρ"
    source: ClassVar[str] = "Coulomb and viscous; spec/model.md §5, spec/irma4u.md §3.3"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("viscous", "N m s", "damping takes energy", scale=0.005, low=0.0, high=20.0, start=0.01),
        Parameter("dry", "N m", "friction takes energy", scale=0.002, low=0.0, high=10.0, start=0.005),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Torque and the cable's reaction."""

        def each(cable: CableExpressions) -> ca.SX:
            slip = _slip(state, cable)
            speed = ca.sqrt(ca.dot(slip, slip) + DRY_RATE**2)
            return _on_both(cable, -(theta[0] + theta[1] / speed) * slip)

        return over_cables(self, state, each)

    def wider(self, values: np.ndarray, robot: Robot) -> "tuple[tuple[NamedEffect, np.ndarray], ...]":
        """At all attachments alike: by the cables' tension, giving way before it slips, and more of it about z."""
        giving = AttachmentFrictionGivingWay()
        dry = values[1]
        return ((giving, np.array([*values, dry, giving.absent[-1]])),) if self.cable is None and dry > 0 else ()

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r of an eyelet or knot, and the same at the usual rate."""
        torque = context.joint_torque(self.cable)
        return {"viscous": over_rate(torque, context.slip_rate), "dry": torque}


@dataclass(frozen=True)
class AttachmentFrictionGivingWay(NamedEffect):
    """Coulomb's friction at the attachments, that gives way before it slips (Dahl, 1968), more of it about z.

    Dry friction goes with what presses, the cable's tension T. Torque −(viscous s + dry T/T₀ R b) at each attachment,
    s as in `AttachmentFriction`, and −dry_z T/T₀ c R e_z / n for each cable on the platform: whatever turns about the
    body's own z axis alone, twisted ends or a lead. T₀ is the weight over n, a usual tension. b and c, the shares of
    the dry friction that have built up, are extra states: ḃ = (Rᵀω − ‖ω‖ b)/give, ċ = (ω_z − |ω_z| c)/give in the body
    frame; cables turn far less than the platform. At a reversal the friction takes about `give` to turn round, so it
    holds small swings like a spring of stiffness dry/give and damps large ones like dry friction. Dry friction is felt
    where cables are springs.
    """

    id: ClassVar[str] = "attachment-friction"
    variant: ClassVar[str] = "by tension, giving way, more about z"
    says: ClassVar[str] = (
        "torque at each attachment, −(viscous s + dry T/T₀ b), and −dry_z T/T₀ c about the body's z axis; T the "
        "cable's tension, T₀ the weight over the number of cables; b and c build up over a turn of `give`"
    )
    source: ClassVar[str] = "Coulomb; Dahl, A solid friction model, 1968; spec/irma4u.md §4"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *AttachmentFriction.parameters,
        Parameter("dry_z", "N m", "friction takes energy", scale=0.01, low=0.0, high=10.0, start=0.05),
        Parameter(
            "give",
            "rad",
            "what gives way does so over some turn",
            scale=0.01,
            low=0.003,
            high=1.0,
            start=0.03,
            scan=(0.03,),
        ),
    )
    extra_states: ClassVar[tuple[ExtraState, ...]] = tuple(
        ExtraState(name, "1", spread=1.0) for name in ("bx", "by", "bz", "c")
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Viscous friction with the cables' reactions."""
        return over_cables(self, state, lambda cable: _on_both(cable, -theta[0] * _slip(state, cable)))

    def tension_wrench(self, number: int, state: PlatformState, theta: ca.SX) -> ca.SX:
        """What has built up."""
        if not self.concerns(number):
            return ca.SX(6, 1)
        n = len(state.cables)
        usual = state.mass * ca.norm_2(state.gravity) / n
        at_attachment = _on_both(state.cables[number - 1], -theta[1] * state.rotation @ state.extra[:3])
        about_z = turning(-theta[2] / n * state.extra[3] * state.rotation[:, 2])
        return (at_attachment + about_z) / usual

    def extra_start(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Nothing has built up."""
        return ca.SX.zeros(4)

    def extra_rates(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """[ḃ; ċ]."""
        spin = state.rotation.T @ state.spin
        whole, about_z = ca.sqrt(ca.dot(spin, spin) + REST_RATE**2), ca.sqrt(spin[2] ** 2 + REST_RATE**2)
        return ca.vertcat(spin - whole * state.extra[:3], spin[2] - about_z * state.extra[3]) / theta[3]

    def narrower(self, values: np.ndarray) -> tuple[NamedEffect, np.ndarray]:
        """Friction that slips at once, at any tension."""
        return AttachmentFriction(), values[:2]

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """μ T r of an eyelet or knot, of all of them about z, and the same at the usual rate."""
        torque = context.joint_torque(None)
        of_all = Limit(len(context.tension) * torque.size, torque.why)
        return {"viscous": over_rate(torque, context.slip_rate), "dry": torque, "dry_z": of_all}


def _slip(state: PlatformState, cable: CableExpressions) -> ca.SX:
    """s: the platform's rotation against a cable, rad/s."""
    return state.spin - ca.cross(cable.direction, state.velocity(cable.arm)) / cable.free_length


def _on_both(cable: CableExpressions, torque: ca.SX) -> ca.SX:
    """A torque (N m) on the platform, and what its reaction on the cable gives across it."""
    return turning(torque) + at_arm(cable.arm, ca.cross(cable.direction, torque) / cable.free_length)
