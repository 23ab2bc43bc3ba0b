"""Cables fixed to the platform, and a hose from above, twist as it turns, and turn it back; laid ropes untwist."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import turning
from fidim_lab.model.slots import PlatformState

STIFFEST = 10.0
"""N m²: G J of a solid steel rod of 6 mm, which no drum winds up"""
STIFFEST_HOSE = 10.0
"""N m/rad: the same rod, a metre long"""
TURNS = 3.0
"""rad: of what was fixed twisted, at most"""


@dataclass(frozen=True)
class CableTorsion(NamedEffect):
    """Potential Σ (½ k φ² − p φ)/ρ over the cables: φ is how far the platform has turned about the cable, ρ its length.

    φ = 2 atan(ε · t/η) with the unit quaternion (η, ε) of R and the cable's direction t, 0 at R = 1. A cable that was
    fixed without twist at another heading φ₀ has p = k φ₀. In k and p the torque is linear. The turn of the swivel at
    the cable's upper end is left out: it is small where cables hang at a slant.
    """

    id: ClassVar[str] = "cable-torsion"
    says: ClassVar[str] = (
        "twisted cables turn the platform back, potential Σ (½ k φ² − p φ)/ρ, φ: rotation about each cable"
    )
    source: ClassVar[str] = "torsion of a rod, T = G J φ/ρ"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("k", "N m²", "torsional rigidity G J of a cable", scale=0.01, low=0.0, high=10.0, start=0.02),
        Parameter("p", "N m² rad", "k times the turn without twist", scale=0.01, low=-50.0, high=50.0, start=0.0),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−∂V."""
        turns = [(_turn(state, cable.direction), cable.free_length) for cable in state.cables]
        each = (_energy(turn, theta) / length for turn, length in turns)
        return -state.gradient(sum(each, ca.SX(0)))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A rod stiffer than any cable, wound up by hand."""
        why = "a cable that a drum winds up twists more easily than a steel rod of 6 mm"
        return {"k": Limit(STIFFEST, why), "p": Limit(STIFFEST * TURNS, why)}


@dataclass(frozen=True)
class HoseTorsion(NamedEffect):
    """Potential ½ k ψ² − p ψ, ψ the platform's turn about the vertical: one hose or wire from above."""

    id: ClassVar[str] = "cable-torsion"
    variant: ClassVar[str] = "a hose from above"
    says: ClassVar[str] = "a twisted hose from above turns the platform back, potential ½ k ψ² − p ψ, ψ: its twist"
    source: ClassVar[str] = "torsion of a rod"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("k", "N m/rad", "a stiffness is positive", scale=0.01, low=0.0, high=10.0, start=0.02),
        Parameter("p", "N m", "torque at R = 1", scale=0.01, low=-50.0, high=50.0, start=0.0),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−∂V."""
        return -state.gradient(_energy(_turn(state, ca.SX([0.0, 0.0, 1.0])), theta))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That rod again."""
        why = "a hose twists more easily than a steel rod of 6 mm"
        return {"k": Limit(STIFFEST_HOSE, why), "p": Limit(STIFFEST_HOSE * TURNS, why)}


def _energy(turn: ca.SX, theta: ca.SX) -> ca.SX:
    """½ k φ² − p φ."""
    return theta[0] / 2 * turn**2 - theta[1] * turn


def _turn(state: PlatformState, axis: ca.SX) -> ca.SX:
    """The platform's turn (rad) about an axis (3), world frame, since R = 1; what it leaned aside left out."""
    rotation = state.rotation
    skew = ca.vertcat(rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    return 2 * ca.atan2(ca.dot(skew, axis), 1 + ca.trace(rotation))


LARGEST = 0.005
"""m: torque for each newton of a single-layer rope of 30 mm, of which a rope of this size has about 0.17 diameters"""


@dataclass(frozen=True)
class LayTorque(NamedEffect):
    """T = c τ t on the platform, t along the cable from pulley to platform."""

    id: ClassVar[str] = "lay-torque"
    says: ClassVar[str] = (
        "torque of a laid rope about its own axis, T = c τ t, t from pulley to platform; c > 0 unwinds it"
    )
    source: ClassVar[str] = "Feyrer, Wire Ropes, torque of the tensioned rope, M = c₁ d S"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c", "m", "torque for each newton", scale=5e-5, low=-0.05, high=0.05, start=0.0),
    )

    def tension_wrench(self, number: int, state: PlatformState, theta: ca.SX) -> ca.SX:
        """c t as a torque."""
        return turning(theta[0] * state.cables[number - 1].direction) if self.concerns(number) else ca.SX(6, 1)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """That of a thick rope of one layer."""
        return {"c": Limit(LARGEST, "no rope of a cable robot unlays with more")}
