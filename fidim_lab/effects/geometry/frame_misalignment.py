"""The frame of the motion capture is not the robot's frame."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.model.geometry import rotation_from_gibbs
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class FrameMisalignment(NamedEffect):
    """Measured = turned by (rx, ry, rz) about the robot frame's origin, then shifted by (dx, dy, dz).

    Turned by the Gibbs vector of half the angles, as `gravity_tilt`.
    """

    id: ClassVar[str] = "frame-misalignment"
    says: ClassVar[str] = "motion capture reports points rotated by (rx, ry, rz), then shifted by (dx, dy, dz)"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *vector("r", "rad", "turned about", scale=1e-3, most=0.2),
        *vector("d", "m", "shift", scale=5e-4, most=0.2),
    )

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Turned and shifted."""
        del state
        return rotation_from_gibbs(theta[:3] / 2) @ point + theta[3:]
