"""The forces of `outside`: what a laboratory may have and the catalogue does not.

As in `terms`, each is a function of the `Platform` that gives a `Wrench` about G in the world frame.
"""

from collections.abc import Mapping

import casadi as ca

from fidim_lab.arrays import Vector3
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import Platform
from sim_backends.plant.mechanics.wrench import Term, Wrench


def _at_centre(force: ca.SX) -> Wrench:
    return Wrench(force, ca.SX.zeros(3))


def _from(platform: Platform, effect: HiddenEffect) -> ca.SX:
    """G from the middle of the effect, m."""
    place: Vector3 = effect.vector("x", "y", "z") + platform.world.middle
    return platform.centre - ca.DM(place)


def _gradient(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = _from(platform, effect)
    return _at_centre(effect["k"] * ca.vertcat(away[1], away[0], 0.0))


def _rotor(platform: Platform, effect: HiddenEffect) -> Wrench:
    spin = platform.rotation @ ca.SX(effect.vector("hx", "hy", "hz"))
    return Wrench(ca.SX.zeros(3), ca.cross(spin, platform.omega))


def _knock(platform: Platform, effect: HiddenEffect) -> Wrench:
    """A train of Gaussian bumps, written as a smooth periodic function (von Mises)."""
    if platform.still:
        return _at_centre(ca.SX.zeros(3))
    turns = 2 * ca.pi / effect["period"]
    sharpness = 1.0 / (turns * effect["w"]) ** 2
    bump = ca.exp(sharpness * (ca.cos(turns * platform.now[0]) - 1.0))
    return _at_centre(bump * ca.SX(effect.vector("fx", "fy", "fz")))


def _cubic(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_centre(-effect["c"] * ca.dot(platform.velocity, platform.velocity) * platform.velocity)


def _eddy(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = _from(platform, effect) / effect["w"]
    return _at_centre(-effect["c"] * ca.exp(-ca.dot(away, away) / 2) * platform.velocity)


def _ripple(platform: Platform, effect: HiddenEffect) -> Wrench:
    total = Wrench(ca.SX.zeros(3), ca.SX.zeros(3))
    for end, cable in zip(platform.cables, platform.world.cables, strict=True):
        across = end.tangent.across
        angle = ca.atan2(ca.dot(across, ca.SX(cable.x)), ca.dot(across, ca.SX(cable.y)))
        force = effect["c"] * ca.sin(effect["teeth"] * angle) / end.tangent.lever * across
        total = Wrench(total.force + force, total.moment + ca.cross(end.point.arm, force))
    return total


OUTSIDE_TERMS: Mapping[str, Term] = {
    "unknown-gradient": _gradient,
    "unknown-rotor": _rotor,
    "unknown-knock": _knock,
    "unknown-cubic": _cubic,
    "unknown-eddy": _eddy,
    "unknown-ripple": _ripple,
}
