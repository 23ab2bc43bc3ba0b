"""Wrenches [force; torque about P] (6), N and N m, that effects are made of, and smooth dry friction."""

from collections.abc import Callable

import casadi as ca

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.slots import PlatformState

DRY_RATE = 0.01
"""rad/s within which dry friction builds up: 0.001–0.03 fit alike, 0.1 does not (spec/findings.md)"""


def dry(rate: ca.SX) -> ca.SX:
    """The sign of a rate (rad/s), smooth around 0."""
    return ca.tanh(rate / DRY_RATE)


def at_arm(arm: ca.SX, force: ca.SX) -> ca.SX:
    """A force (3), N, on the point of the platform at `arm` from P (world frame, m)."""
    return ca.vertcat(force, ca.cross(arm, force))


def at_centre(state: PlatformState, force: ca.SX) -> ca.SX:
    """A force (3), N, on the centre of mass."""
    return at_arm(state.centre, force)


def turning(torque: ca.SX) -> ca.SX:
    """A torque (3), N m, without force."""
    return ca.vertcat(ca.SX.zeros(3), torque)


def joint_rate(state: PlatformState, cable: CableExpressions, gradient: ca.SX) -> ca.SX:
    """Rate (rad/s) of a cable's angle whose gradient by the attachment (3), rad/m, is given."""
    return ca.dot(gradient, state.velocity(cable.arm))


def joint_torque(cable: CableExpressions, gradient: ca.SX, torque: ca.SX) -> ca.SX:
    """What a torque (N m) on a cable's angle does to the platform, through its attachment."""
    return at_arm(cable.arm, torque * gradient)


def over_cables(effect: NamedEffect, state: PlatformState, each: Callable[[CableExpressions], ca.SX]) -> ca.SX:
    """Sum (6) of a wrench of every cable that the effect concerns."""
    numbered = enumerate(state.cables, start=1)
    return sum((each(cable) for number, cable in numbered if effect.concerns(number)), ca.SX.zeros(6))
