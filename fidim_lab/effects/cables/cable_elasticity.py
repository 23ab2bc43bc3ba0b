"""Springs in the cables' way, each also with a damper beside it: what `explain` looks for, and fits.

Forms of one thing, which the platform feels nearly alike: a cable that stretches with its length, one that does so
whatever its length, a winch that yields where its encoder sees it, and posts that bend sideways.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.geometry import CableExpressions

LARGEST_STRAIN = 0.05
"""of a textile rope near breaking"""
LARGEST_YIELD = 0.02
"""m: more is a winch that does not hold"""
LARGEST_BEND = 0.02
"""m: a post that bends more under one cable is seen to move"""
DAMPING = 40.0
"""N s/m of a cable that stretches, where nothing better is known: it keeps the springs quiet"""
DAMPER = Parameter(
    "damping", "N s/m", "a damping is positive", scale=5.0, low=0.5, high=2e3, start=DAMPING, scan=(DAMPING,)
)
"""of a cable's stretch, or of a winch's yielding: beside a motion of tens of newtons ten times a second it takes a
thousandth of the energy in 10 s, which moves the markers by their noise. It has no score where nothing stretches"""
Forms = tuple[tuple[NamedEffect, np.ndarray], ...]


@dataclass(frozen=True)
class _Spring(NamedEffect):
    """θ is a compliance, and where its form has a `DAMPER` the damping; both the same for every cable it concerns."""

    source: ClassVar[str] = "Hooke; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "m/N", "1/k is positive", scale=1e-7, low=0.0, high=1e-3, start=1e-5),
    )

    def lever(self, cable: CableExpressions) -> ca.SX:
        """What of a cable's tension stretches it by θ for each newton: for every cable alike."""
        return ca.SX(1)

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """θ times the lever."""
        return theta[0] * self.lever(cable) if self.concerns(number) else ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """The damper's, or the usual one."""
        damping = theta[-1] if DAMPER in self.parameters else ca.SX(DAMPING)
        return damping if self.concerns(number) else ca.SX(0)


@dataclass(frozen=True)
class CableElasticity(_Spring):
    """l = l₀ + ρ τ/EA: θ is 1/EA, so that 0 is rigid."""

    id: ClassVar[str] = "cable-elasticity"
    variant: ClassVar[str] = "by length"
    says: ClassVar[str] = "cables stretch with their free length, l = l₀ + ρ τ/EA; parameter 1/EA"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "1/N", "1/EA is positive", scale=1e-7, low=0.0, high=1e-3, start=5e-6),
    )

    def lever(self, cable: CableExpressions) -> ca.SX:
        """ρ."""
        return cable.free_length

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A rope near breaking."""
        tension = max(context.tension)
        why = f"no rope stretches by {100 * LARGEST_STRAIN:.0f} % under {tension:.0f} N and holds"
        return {"softness": Limit(LARGEST_STRAIN / tension, why)}


@dataclass(frozen=True)
class CableStiffness(_Spring):
    """l = l₀ + τ/k, whatever the length: θ is 1/k."""

    id: ClassVar[str] = "cable-elasticity"
    variant: ClassVar[str] = "whatever the length"
    says: ClassVar[str] = "cables or their mounts stretch by the same amount at any length, l = l₀ + τ/k; parameter 1/k"

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A metre of rope near breaking."""
        tension = max(context.tension)
        why = f"no cable gives way by {1e3 * LARGEST_STRAIN:.0f} mm under {tension:.0f} N and holds"
        return {"softness": Limit(LARGEST_STRAIN / tension, why)}


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


@dataclass(frozen=True)
class FrameCompliance(_Spring):
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
    anchor_yields: ClassVar[bool] = True

    def lever(self, cable: CableExpressions) -> ca.SX:
        """tx² + ty²."""
        return ca.sumsqr(cable.direction[:2])

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A frame that stands."""
        tension = max(context.tension)
        why = f"a frame that yields {1e3 * LARGEST_BEND:.0f} mm under {tension:.0f} N is seen to move"
        return {"softness": Limit(LARGEST_BEND / tension, why)}


@dataclass(frozen=True)
class DampedElasticity(CableElasticity):
    """l = l₀ + ρ τ/EA."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*CableElasticity.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance at the usual length, whatever the length, or of the cable's winch."""
        return _others(self, values * (context.free_length, 1.0), context)


@dataclass(frozen=True)
class DampedStiffness(CableStiffness):
    """l = l₀ + τ/k."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*CableStiffness.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance at the usual length, going with the length, or of the cable's winch."""
        return _others(self, values, context)


@dataclass(frozen=True)
class DampedWinch(WinchHoldCompliance):
    """l = l₀ + τ/k at one winch."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*WinchHoldCompliance.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance of the cable, which the encoder does not see."""
        return _others(self, values, context)


@dataclass(frozen=True)
class DampedFrame(FrameCompliance):
    """δ = τ (tx, ty, 0)/k at every entry point."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*FrameCompliance.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance of the cables."""
        return _others(self, values * (context.level, 1.0), context)


def _others(form: NamedEffect, values: np.ndarray, context: Context) -> Forms:
    """The forms besides this one, of the same 1/k (m/N) and damping; all winches do not yield alike."""
    cable = form.cable
    forms: list[tuple[NamedEffect, np.ndarray]] = [
        (DampedElasticity(cable), values / (context.free_length, 1.0)),
        (DampedStiffness(cable), values),
    ]
    forms.append((DampedFrame(), values / (context.level, 1.0)) if cable is None else (DampedWinch(cable), values))
    return tuple((other, theta) for other, theta in forms if other != form)
