"""Motion capture measures lengths too long or too short: the wand it was calibrated with is not as long as stated."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class CaptureScale(NamedEffect):
    """Measured = (1 + scale) times the true place, from the robot frame's origin.

    Scaled about another point the measured places are shifted, too (`frame-misalignment`).
    """

    id: ClassVar[str] = "capture-scale"
    says: ClassVar[str] = "motion capture measures (1 + scale) times the true lengths"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "1", "measured too long by this ratio", scale=1e-3, low=-0.05, high=0.05, start=0.0),
    )

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """(1 + scale) p."""
        del state
        return (1 + theta[0]) * point
