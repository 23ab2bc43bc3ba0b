"""The places of the model into which physics that was left out can be put (DESIGN.md, decision 2).

An effect overrides the slots it needs and leaves the others neutral; θ = 0 is "absent" for every one of them. The
baseline and a completed model are the same code with a different list of effects.
"""

from dataclasses import dataclass

import casadi as ca

from fidim_lab.model.geometry import CableConstants, CableExpressions


@dataclass(frozen=True, eq=False)
class PlatformState:
    """What a slot may depend on, as expressions in the world frame, SI."""

    time: ca.SX
    """s since the start of the window"""
    position: ca.SX
    rotation: ca.SX
    """body → world (3 × 3)"""
    twist: ca.SX
    """[ṗ; ω] (6)"""
    cables: tuple[CableExpressions, ...]


class Effect:
    """An effect that does nothing; subclasses override what they change. θ holds the effect's own parameters."""

    parameters: tuple[str, ...] = ()
    """names of θ, in order"""

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The constants of cable `number` (1-based), changed."""
        del number, theta
        return cable

    def cable_length(self, number: int, theta: ca.SX) -> ca.SX:
        """What is added to the length of cable `number` (1-based), m; must not depend on the pose."""
        del number, theta
        return ca.SX(0)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """A further wrench [force; torque about P] on the platform, per unit mass (6), N/kg and N m/kg."""
        del state, theta
        return ca.SX.zeros(6)
