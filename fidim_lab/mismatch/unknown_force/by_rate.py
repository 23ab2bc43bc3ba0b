"""Families of rates: of the velocity, of the rotation, and at the joints of one cable."""

from functools import partial

import casadi as ca
import numpy as np

from fidim_lab.effects.wrenches import joint_rate, joint_torque
from fidim_lab.mismatch.unknown_force.family import Dependence, Family, monomials
from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.mismatch.unknown_force.reach import (
    Reach,
    any_force,
    any_torque,
    drag_on,
    pushed,
    turned,
    velocity,
)
from fidim_lab.model.slots import PlatformState

POWERS = (1.0, 2.0, 3.0, 4.0)
"""of a rate, that a force may grow with"""
TEETH = (4.0, 100.0, 2.0)
"""in one turn: from where to where, and by what they are tried"""

_drag = partial(drag_on, ForcePoint.CENTRE_OF_MASS)


def _drag_by_axis(state: PlatformState, shape: ca.SX) -> ca.SX:
    return pushed(state, ca.diag(velocity(state)))


def _spin_drag(state: PlatformState, shape: ca.SX) -> ca.SX:
    return turned(state.spin)


def _spin_drag_by_axis(state: PlatformState, shape: ca.SX) -> ca.SX:
    return turned(state.rotation @ ca.diag(state.rotation.T @ state.spin))


def _across_the_spin(state: PlatformState, shape: ca.SX) -> ca.SX:
    """−ω × h for each body axis of h: what a wheel that spins inside does to the platform that turns it."""
    return turned(-ca.skew(state.spin) @ state.rotation)


def _about_body_axes(state: PlatformState, shape: ca.SX) -> ca.SX:
    return turned(state.rotation)


def _steady(state: PlatformState, shape: ca.SX) -> ca.SX:
    return ca.SX(1)


def _length(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.dot(vector, vector) + 1e-9)


def of_speed(reach: Reach) -> list[Family]:
    """Drag by powers of the speed, alike in all directions or not, and any odd force of the velocity."""

    def power(exponent: float, state: PlatformState, shape: ca.SX) -> ca.SX:
        return (_length(velocity(state)) / reach.speed) ** (exponent - 1)

    def cubic(state: PlatformState, shape: ca.SX) -> ca.SX:
        return monomials(velocity(state) / reach.speed, (1, 2, 3))

    found: list[Family] = []
    for q in POWERS:
        law, says = partial(power, q), f"speed^{q:g}"
        found.append(Family(Dependence.SPEED, f"drag ~ {says}", _drag, law, power=q))
        found.append(Family(Dependence.SPEED, f"drag ~ {says}, by axis", _drag_by_axis, law, power=q))
    found.append(Family(Dependence.VELOCITY, "force of the velocity", any_force, cubic))
    return found


def of_spin(reach: Reach) -> list[Family]:
    """Torques against and across the turning, forces while something turns, and a torque of the orientation."""

    def power(exponent: float, state: PlatformState, shape: ca.SX) -> ca.SX:
        return (_length(state.spin) / reach.spin) ** exponent

    def spin(state: PlatformState, shape: ca.SX) -> ca.SX:
        return state.rotation.T @ state.spin / reach.spin

    def tilted(state: PlatformState, shape: ca.SX) -> ca.SX:
        r = state.rotation
        return monomials(ca.vertcat(r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]) / 2, (1, 2))

    found: list[Family] = []
    for q in POWERS:
        law, says = partial(power, q - 1), f"turning rate^{q:g}"
        found.append(Family(Dependence.SPIN, f"torque ~ {says}", _spin_drag, law, power=q))
        found.append(Family(Dependence.SPIN, f"torque ~ {says}, by body axis", _spin_drag_by_axis, law, power=q))
    found.append(Family(Dependence.ACROSS, "torque across the turning", _across_the_spin, _steady))
    found.append(Family(Dependence.SPIN, "any torque ~ turning rate", _about_body_axes, spin, power=1.0))
    for q in POWERS[:2]:
        law, says = partial(power, q), f"turning rate^{q:g}"
        found.append(Family(Dependence.TURNING, f"force ~ {says}", any_force, law, power=q))
        found.append(Family(Dependence.TURNING, f"steady torque ~ {says}", any_torque, law, power=q))
        found.append(Family(Dependence.TURNING, f"drag ~ {says}", _drag, law, power=q))
    found.append(Family(Dependence.ORIENTATION, "torque of the orientation", any_torque, tilted))
    return found


def of_teeth() -> list[Family]:
    """Torques on all swivels, or all pulleys, that come back so many times in one turn: teeth, detents."""

    def teeth(which: str, state: PlatformState, shape: ca.SX) -> ca.SX:
        columns: list[ca.SX] = []
        for one in state.cables:
            torque = joint_torque(one, getattr(one, f"{which}_gradient"), ca.SX(1))
            angle = shape[0] * getattr(one, f"{which}_angle")
            columns += [torque * ca.sin(angle), torque * ca.cos(angle)]
        return ca.horzcat(*columns)

    shapes, steps = tuple(np.array([n]) for n in np.arange(*TEETH)), np.array([0.3 * TEETH[2]])
    return [
        Family(Dependence.DETENT, f"teeth of all {joint}", partial(teeth, which), _steady, shapes, steps)
        for which, joint in (("swivel", "swivels"), ("wrap", "pulleys"))
    ]


def of_cable(cable: int) -> list[Family]:
    """A torque on the swivel, on the wrap, or about the cable itself at its attachment, of rate and angle there."""

    def joint(which: str, state: PlatformState, shape: ca.SX) -> ca.SX:
        one = state.cables[cable - 1]
        return joint_torque(one, getattr(one, f"{which}_gradient"), ca.SX(1))

    def laws(which: str, state: PlatformState, shape: ca.SX) -> ca.SX:
        one = state.cables[cable - 1]
        rate = joint_rate(state, one, getattr(one, f"{which}_gradient"))
        angle = getattr(one, f"{which}_angle")
        return ca.vertcat(rate, ca.tanh(rate / 0.01), rate**3, ca.sin(angle), ca.cos(angle), ca.tanh(rate / 0.1))

    def about(state: PlatformState, shape: ca.SX) -> ca.SX:
        return turned(state.cables[cable - 1].direction)

    def twisting(state: PlatformState, shape: ca.SX) -> ca.SX:
        rate = ca.dot(state.spin, state.cables[cable - 1].direction)
        return ca.vertcat(rate, ca.tanh(rate / 0.01), rate**3, ca.SX(1))

    about_cable = f"torque about cable {cable} at its attachment"
    return [
        *(
            Family(
                Dependence.CABLE,
                f"torque on the {name} of cable {cable}",
                partial(joint, which),
                partial(laws, which),
                cable=cable,
            )
            for which, name in (("swivel", "swivel"), ("wrap", "pulley"))
        ),
        Family(Dependence.CABLE, about_cable, about, twisting, cable=cable),
    ]
