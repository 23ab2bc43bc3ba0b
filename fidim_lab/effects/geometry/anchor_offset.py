"""A pulley that is not where the robot file says."""

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.model.geometry import CableConstants


@dataclass(frozen=True)
class AnchorOffset(NamedEffect):
    """d_i + (dx, dy, dz), world frame."""

    id: ClassVar[str] = "anchor-offset"
    says: ClassVar[str] = "pulley entry point elsewhere, d_i + (dx, dy, dz), world frame"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector(
        "d", "m", "true minus stated entry point", scale=1e-3, most=0.2
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The moved entry point."""
        return replace(cable, d=cable.d + theta) if self.concerns(number) else cable
