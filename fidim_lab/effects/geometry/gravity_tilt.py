"""Gravity that is not along −z of the robot's frame: the frame stands askew."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.wrenches import at_centre
from fidim_lab.model.geometry import rotation_from_gibbs
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class GravityTilt(NamedEffect):
    """Gravity turned by the rotation vector (rx, ry, 0); its size stays.

    Turned by the Gibbs vector of half the angles, which differs from the rotation vector by a twelfth of its third
    power (10⁻⁷ at 10 mrad).
    """

    id: ClassVar[str] = "gravity-tilt"
    says: ClassVar[str] = "gravity turned by (rx, ry, 0) against the robot's frame"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(f"r{axis}", "rad", f"turned about {axis}", scale=1e-3, low=-0.2, high=0.2, start=0.0) for axis in "xy"
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The change of the weight, at G."""
        turn = rotation_from_gibbs(ca.vertcat(theta / 2, 0))
        return at_centre(state, state.mass * (turn @ state.gravity - state.gravity))
