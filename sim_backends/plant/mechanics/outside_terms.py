"""The forces of `outside`: what a laboratory may have and the catalogue does not.

As in `terms`, each is a function of the `Platform` that gives a `Wrench` about G in the world frame.
"""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from fidim_lab.arrays import Vector3
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import Platform
from sim_backends.plant.mechanics.wrench import Term, Wrench

GUSTS = 12
"""how many sines a gusty force is made of"""
REST = 1e-3
"""m/s below which a drag by a power of speed is linear, so that it has a derivative at rest"""
SURFACE = 0.01
"""m over which the drag of a bath begins"""
FIELD = ca.DM([0.45, 0.0, -0.9])
"""direction of a magnetic field, world frame"""


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


def _gusts(platform: Platform, effect: HiddenEffect) -> Wrench:
    """A sum of sines from 0.1 to 3 Hz, weaker upwards."""
    if platform.still:
        return _at_centre(ca.SX.zeros(3))
    rng = np.random.default_rng(int(effect["seed"]))
    amplitudes = rng.normal(size=(GUSTS, 3)) * np.array([1.0, 1.0, 0.3])
    amplitudes *= effect["f"] * np.sqrt(2.0 / np.sum(amplitudes**2))
    pulsations, phases = 2 * np.pi * rng.uniform(0.1, 3.0, GUSTS), rng.uniform(0, 2 * np.pi, GUSTS)
    return _at_centre(ca.DM(amplitudes.T) @ ca.sin(ca.DM(pulsations) * platform.now[0] + ca.DM(phases)))


def _facing(effect: HiddenEffect) -> ca.DM:
    return ca.DM([np.cos(effect["about"]), np.sin(effect["about"]), 0.0])


def _stop(platform: Platform, effect: HiddenEffect) -> Wrench:
    facing = _facing(effect)
    return _at_centre(-effect["k"] * ca.fmax(0.0, ca.dot(facing, _from(platform, effect))) * facing)


def _slack(platform: Platform, effect: HiddenEffect) -> Wrench:
    away, width = _from(platform, effect), effect["w"]
    return _at_centre(-effect["k"] * (away - ca.fmin(width, ca.fmax(-width, away))))


def _sail(platform: Platform, effect: HiddenEffect) -> Wrench:
    facing = platform.rotation @ _facing(effect)
    into = ca.dot(facing, platform.velocity)
    return _at_centre(-effect["c"] * ca.sqrt(into**2 + REST**2) * into * facing)


def _offset_drag(platform: Platform, effect: HiddenEffect) -> Wrench:
    thing = platform.point(effect.vector("bx", "by", "bz"))
    force = -effect["c"] * _speed(thing.velocity) * thing.velocity
    return Wrench(force, ca.cross(thing.arm, force))


def _power(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_centre(-effect["c"] * _speed(platform.velocity) ** (effect["p"] - 1) * platform.velocity)


def _lift(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_centre(effect["k"] * ca.cross(platform.omega, platform.velocity))


def _dipole(platform: Platform, effect: HiddenEffect) -> Wrench:
    return Wrench(ca.SX.zeros(3), ca.cross(platform.rotation @ ca.SX(effect.vector("mx", "my", "mz")), FIELD))


def _bath(platform: Platform, effect: HiddenEffect) -> Wrench:
    above = platform.centre[2] - (effect["z"] + platform.world.middle[2])
    return _at_centre(-effect["c"] * (1 - ca.tanh(above / SURFACE)) / 2 * platform.velocity)


def _speed(velocity: ca.SX) -> ca.SX:
    return ca.sqrt(ca.dot(velocity, velocity) + REST**2)


OUTSIDE_TERMS: Mapping[str, Term] = {
    "unknown-gradient": _gradient,
    "unknown-rotor": _rotor,
    "unknown-knock": _knock,
    "unknown-cubic": _cubic,
    "unknown-eddy": _eddy,
    "unknown-ripple": _ripple,
    "unknown-gusts": _gusts,
    "unknown-stop": _stop,
    "unknown-slack": _slack,
    "unknown-sail": _sail,
    "unknown-offset-drag": _offset_drag,
    "unknown-power": _power,
    "unknown-lift": _lift,
    "unknown-dipole": _dipole,
    "unknown-bath": _bath,
}
