"""Ropes of wires laid in a helix untwist under tension: a torque about each cable that goes with its tension."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import turning
from fidim_lab.model.slots import PlatformState

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
        del context
        return {"c": Limit(LARGEST, "no rope of a cable robot unlays with more")}
