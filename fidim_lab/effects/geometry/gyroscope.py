"""How a gyroscope sits on the platform, and its scale."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.model.geometry import rotation_from_gibbs
from fidim_lab.model.slots import Effect


@dataclass(frozen=True)
class GyroscopeMount(Effect):
    """Axes turned against the platform's by a small rotation vector (rad), and readings 1 + scale times too large."""

    parameters: ClassVar[tuple[str, ...]] = ("gyro_turn_x", "gyro_turn_y", "gyro_turn_z", "gyro_scale")
    SD: ClassVar[tuple[float, ...]] = (0.05, 0.05, 0.05, 0.02)
    """of θ beforehand, rad and 1: a phone is laid along an edge within 3°; its maker states a scale within 1 to 3 %"""

    @property
    def absent(self) -> np.ndarray:
        """Along the axes, exact."""
        return np.zeros(4)

    def rate_read(self, rate: ca.SX, theta: ca.SX) -> ca.SX:
        """Turned and scaled."""
        return (1 + theta[3]) * rotation_from_gibbs(theta[:3] / 2) @ rate
