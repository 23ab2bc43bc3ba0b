"""A held winch that gives way under tension: its encoder sees it, unlike the stretch of a cable."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.effects.plausibility import Context, Limit

LARGEST_YIELD = 0.02
"""m: more is a winch that does not hold"""


@dataclass(frozen=True)
class WinchHoldCompliance(CableStiffness):
    """l = l₀ + τ/k at one winch, and the encoder reads l: θ is 1/k."""

    id: ClassVar[str] = "winch-hold-compliance"
    variant: ClassVar[str] = ""
    says: ClassVar[str] = "a held winch yields, l = l₀ + τ/k, and its encoder sees it; parameter 1/k"
    encoder_sees_stretch: ClassVar[bool] = True

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A winch that holds."""
        tension = max(context.tension) if self.cable is None else context.tension[self.cable - 1]
        why = f"a winch that yields {1e3 * LARGEST_YIELD:.0f} mm under {tension:.0f} N does not hold"
        return {"softness": Limit(LARGEST_YIELD / tension, why)}
