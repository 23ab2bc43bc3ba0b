"""A cable that is tied to the platform elsewhere than the robot file says."""

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.model.geometry import CableConstants


@dataclass(frozen=True)
class AttachmentOffset(NamedEffect):
    """a_i + (dx, dy, dz), body frame."""

    id: ClassVar[str] = "attachment-offset"
    says: ClassVar[str] = "attachment elsewhere, a_i + (dx, dy, dz), body frame"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector("d", "m", "true minus stated attachment", scale=1e-3, most=0.1)

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The moved attachment."""
        return replace(cable, a=cable.a + theta) if self.concerns(number) else cable
