"""A held winch that gives way under tension: its encoder sees it, unlike the stretch of a cable."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.cables.cable_elasticity import DAMPING
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.geometry import CableExpressions

LARGEST_YIELD = 0.02
"""m: more is a winch that does not hold"""


@dataclass(frozen=True)
class WinchHoldCompliance(NamedEffect):
    """l = l₀ + τ/k at one winch, and the encoder reads l: θ is 1/k."""

    id: ClassVar[str] = "winch-hold-compliance"
    says: ClassVar[str] = "a held winch yields, l = l₀ + τ/k, and its encoder sees it; parameter 1/k"
    source: ClassVar[str] = "Hooke; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "m/N", "1/k is positive", scale=1e-7, low=0.0, high=1e-3, start=1e-5),
    )
    encoder_sees_stretch: ClassVar[bool] = True

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """1/k."""
        del cable
        return theta[0] if self.concerns(number) else ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """Of the drive's control."""
        del theta
        return ca.SX(DAMPING if self.concerns(number) else 0.0)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A winch that holds."""
        tension = max(context.tension) if self.cable is None else context.tension[self.cable - 1]
        why = f"a winch that yields {1e3 * LARGEST_YIELD:.0f} mm under {tension:.0f} N does not hold"
        return {"softness": Limit(LARGEST_YIELD / tension, why)}
