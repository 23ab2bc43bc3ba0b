"""Posts that bend under their cables' pull: the entry points give way sideways, unseen by the encoders."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.cables.cable_elasticity import DAMPING
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.geometry import CableExpressions

LARGEST_YIELD = 0.02
"""m: a post that bends more under one cable is seen to move"""


@dataclass(frozen=True)
class FrameCompliance(NamedEffect):
    """Each entry point moves by δ = C τ t, C = 1/k diag(1, 1, 0): a post is soft across itself and stiff along itself.

    t (world frame) is the cable's direction from pulley to platform, τ its tension (N). The path from D to A gets
    longer by t·δ, so that to first order in C

        l = l₀ + τ κ,    κ = t·C t = (tx² + ty²)/k    (m/N)

    and the energy that is stored, ½ τ² κ at a given tension, depends on the pose: beside its pull −τ ∂l the cable gives
    the platform ½ τ² ∂κ, which is what the direction of a cable changes by where its entry point has moved across it
    (`anchor_yields`). Winch and pulley stand on the same post. One post does not move another's cable.

    A square steel tube of 60 × 3 mm (E I = 74 kN m²) gives way at a height of 2 m by h³/(3 E I) = 3.6e-5 m/N, a braced
    frame by a tenth of that: 0.1–1 mm under 30 N.
    """

    id: ClassVar[str] = "frame-compliance"
    says: ClassVar[str] = "posts bend sideways under their cables, δ = τ (tx, ty, 0)/k; parameter 1/k"
    source: ClassVar[str] = "Hooke; deflection of a cantilever, F h³/(3 E I)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "m/N", "1/k is positive", scale=1e-7, low=0.0, high=1e-3, start=1e-5),
    )
    anchor_yields: ClassVar[bool] = True

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """(tx² + ty²)/k."""
        return theta[0] * ca.sumsqr(cable.direction[:2]) if self.concerns(number) else ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """The same for every cable."""
        del theta
        return ca.SX(DAMPING if self.concerns(number) else 0.0)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A frame that stands."""
        tension = max(context.tension)
        why = f"a frame that yields {1e3 * LARGEST_YIELD:.0f} mm under {tension:.0f} N is seen to move"
        return {"softness": Limit(LARGEST_YIELD / tension, why)}
