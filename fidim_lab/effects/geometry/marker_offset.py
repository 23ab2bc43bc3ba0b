"""A marker that is not where the robot file says."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector


@dataclass(frozen=True)
class MarkerOffset(NamedEffect):
    """Marker + (dx, dy, dz), body frame; of one marker, the main one unless said otherwise."""

    id: ClassVar[str] = "marker-offset"
    says: ClassVar[str] = "a marker elsewhere on the platform, m + (dx, dy, dz), body frame"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector("d", "m", "true minus stated place", scale=5e-4, most=0.1)

    number: int = 1
    """1-based, the main marker first"""

    @property
    def label(self) -> str:
        """With the marker's number where it is not the main one."""
        return self.id if self.number == 1 else f"{self.id} (marker {self.number})"

    def marker(self, number: int, place: ca.SX, theta: ca.SX) -> ca.SX:
        """The moved place."""
        return place + theta if number == self.number else place
