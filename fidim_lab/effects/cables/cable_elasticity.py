"""Cables that stretch under their tension, without the encoders seeing it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.geometry import CableExpressions

LARGEST_STRAIN = 0.05
"""of a textile rope near breaking"""
DAMPING = 40.0
"""N s/m of a cable that stretches, where nothing better is known: it keeps the springs quiet"""


@dataclass(frozen=True)
class CableElasticity(NamedEffect):
    """l = l₀ + ρ τ/EA: θ is 1/EA, so that 0 is rigid."""

    id: ClassVar[str] = "cable-elasticity"
    variant: ClassVar[str] = "by length"
    says: ClassVar[str] = "cables stretch with their free length, l = l₀ + ρ τ/EA; parameter 1/EA"
    source: ClassVar[str] = "Hooke; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "1/N", "1/EA is positive", scale=1e-7, low=0.0, high=1e-3, start=5e-6),
    )

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """ρ/EA."""
        return theta[0] * cable.free_length if self.concerns(number) else ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """The same for every cable."""
        del theta
        return ca.SX(DAMPING if self.concerns(number) else 0.0)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A rope near breaking."""
        tension = max(context.tension)
        why = f"no rope stretches by {100 * LARGEST_STRAIN:.0f} % under {tension:.0f} N and holds"
        return {"softness": Limit(LARGEST_STRAIN / tension, why)}


@dataclass(frozen=True)
class CableStiffness(NamedEffect):
    """l = l₀ + τ/k, whatever the length: θ is 1/k."""

    id: ClassVar[str] = "cable-elasticity"
    variant: ClassVar[str] = "whatever the length"
    says: ClassVar[str] = "cables or their mounts stretch by the same amount at any length, l = l₀ + τ/k; parameter 1/k"
    source: ClassVar[str] = "Hooke; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softness", "m/N", "1/k is positive", scale=1e-7, low=0.0, high=1e-3, start=1e-5),
    )

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """1/k."""
        del cable
        return theta[0] if self.concerns(number) else ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """The same for every cable."""
        del theta
        return ca.SX(DAMPING if self.concerns(number) else 0.0)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A metre of rope near breaking."""
        tension = max(context.tension)
        why = f"no cable gives way by {1e3 * LARGEST_STRAIN:.0f} mm under {tension:.0f} N and holds"
        return {"softness": Limit(LARGEST_STRAIN / tension, why)}
