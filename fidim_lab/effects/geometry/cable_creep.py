"""A cable that grows while it is held, unseen by its encoder."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter


@dataclass(frozen=True)
class CableCreep(NamedEffect):
    """l₀(t) = l₀ + δ (1 − e^(−t/T)), t since the start of the window.

    δ < 0 is a cable that recovers after a larger load. T has no score at δ = 0: it is scanned.
    """

    id: ClassVar[str] = "cable-creep"
    says: ClassVar[str] = "one cable creeps, l₀(t) = l₀ + δ (1 − e^(−t/T)), from the start of each window"
    source: ClassVar[str] = "Kelvin–Voigt; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("delta", "m", "final creep", scale=1e-4, low=-0.05, high=0.05, start=1e-3),
        Parameter(
            "T", "s", "time constant", scale=1.0, low=0.1, high=100.0, start=4.0, scan=(0.5, 1.0, 2.0, 4.0, 8.0, 20.0)
        ),
    )

    def length_drift(self, number: int, time: ca.SX, theta: ca.SX) -> ca.SX:
        """δ (1 − e^(−t/T))."""
        return -theta[0] * ca.expm1(-time / theta[1]) if self.concerns(number) else ca.SX(0)
