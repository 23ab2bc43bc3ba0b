"""Pulleys of another radius than the robot file says."""

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context
from fidim_lab.model.geometry import CableConstants


@dataclass(frozen=True)
class PulleyRadius(NamedEffect):
    """r + dr, alike for all cables or for one."""

    id: ClassVar[str] = "pulley-radius"
    says: ClassVar[str] = "pulleys of another radius, r + dr"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("dr", "m", "true minus stated radius", scale=5e-4, low=-0.05, high=0.05, start=0.0),
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The other radius."""
        return replace(cable, radius=cable.radius + theta[0]) if self.concerns(number) else cable

    def bounds(self, context: Context | None = None) -> tuple[np.ndarray, np.ndarray]:
        """No radius becomes negative."""
        low, high = super().bounds(context)
        return (low, high) if context is None else (np.maximum(low, -self._least(context)), high)

    def plausible(self, values: np.ndarray, context: Context) -> str | None:
        """A radius is not negative."""
        if values[0] < -self._least(context):
            return (
                f"{self.label}: dr = {1e3 * values[0]:.2f} mm, but a pulley of {1e3 * self._least(context):.1f} mm "
                "would get a negative radius."
            )
        return super().plausible(values, context)

    def _least(self, context: Context) -> float:
        return min(radius for number, radius in enumerate(context.radii, start=1) if self.concerns(number))
