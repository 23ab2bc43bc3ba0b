"""Points of the platform at which an unknown wrench may act."""

from enum import Enum

import casadi as ca

from fidim_lab.model.slots import PlatformState


class ForcePoint(Enum):
    """Where on the platform a force acts."""

    CENTRE_OF_MASS = "the centre of mass"
    REFERENCE = "the reference point P"

    def arm(self, state: PlatformState) -> ca.SX:
        """From P (3), m."""
        return state.centre if self is ForcePoint.CENTRE_OF_MASS else ca.SX.zeros(3)

    def place(self, state: PlatformState) -> ca.SX:
        """In the room (3), m."""
        return state.position + self.arm(state)
