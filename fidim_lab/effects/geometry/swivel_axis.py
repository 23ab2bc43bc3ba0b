"""A swivel axis that is not where the robot file says: the pulley is mounted askew.

Not in the catalogue: it is a nuisance of the survey (`identification.survey`), no effect that `explain` looks for.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.model.geometry import CableConstants, rotation_from_gibbs


@dataclass(frozen=True)
class SwivelAxis(NamedEffect):
    """The triad x, y, z of cable i turned by (rx, ry) about its own x and y; D stays."""

    id: ClassVar[str] = "swivel-axis"
    says: ClassVar[str] = "swivel axis elsewhere: z turned by (rx, ry) about the swivel's own x and y"
    source: ClassVar[str] = "geometry of Table 1"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(f"r{axis}", "rad", f"turned about the swivel's {axis}", scale=5e-3, low=-0.2, high=0.2, start=0.0)
        for axis in "xy"
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The turned triad."""
        if not self.concerns(number):
            return cable
        triad = ca.horzcat(cable.x, cable.y, cable.z)
        turned = triad @ rotation_from_gibbs(ca.vertcat(theta / 2, 0))
        return replace(cable, x=turned[:, 0], y=turned[:, 1], z=turned[:, 2])
