"""Families of the time since the release: one push, a wave, any course."""

import casadi as ca
import numpy as np

from fidim_lab.mismatch.unknown_force.family import Dependence, Family, bells
from fidim_lab.mismatch.unknown_force.reach import Reach, any_force, any_torque
from fidim_lab.model.slots import PlatformState

FREQUENCIES = (0.2, 8.0)
"""Hz"""
HARMONICS = 3
"""of a periodic force"""
KNOCK_HARMONICS = 10
"""of knocks: a platform of a few Hz hardly answers to what is faster"""
KNOCKS_AT = (0.3, 2.5)
KNOCKS_APART = 0.02
"""Hz: from where to where, and by what, frequencies of knocks are tried"""


def moment(reach: Reach) -> Family:
    """One push, at the same time in every window."""

    def bell(state: PlatformState, shape: ca.SX) -> ca.SX:
        return ca.exp(-(((state.time - shape[0]) / ca.exp(shape[1])) ** 2) / 2)

    shapes = tuple(np.array([t, np.log(w)]) for w in (0.15, 0.5) for t in np.arange(0.0, reach.seconds, 1.5 * w))
    return Family(Dependence.MOMENT, "a push at a moment", any_force, bell, shapes, np.array([0.1, 0.3]))


def periodic(reach: Reach) -> list[Family]:
    """A force at one frequency with its harmonics, in step in all windows or at a time of its own in each."""

    def waves(state: PlatformState, shape: ca.SX) -> ca.SX:
        return _waves(state, shape, HARMONICS)

    step = 1 / (2 * max(reach.seconds, 1.0))
    shapes = tuple(np.array([f]) for f in np.arange(*FREQUENCIES, step))
    steps = np.array([0.3 * step])
    in_step, own = "periodic force, the same in every window", "periodic force, at its own time in every window"
    return [
        Family(Dependence.PERIODIC, in_step, any_force, waves, shapes, steps),
        Family(Dependence.PERIODIC, own, any_force, waves, shapes, steps, harmonics=HARMONICS),
    ]


def knocks() -> Family:
    """One short force that comes back again and again, at a time of its own in every window."""

    def waves(state: PlatformState, shape: ca.SX) -> ca.SX:
        return ca.vertcat(1, _waves(state, shape, KNOCK_HARMONICS))

    shapes = tuple(np.array([f]) for f in np.arange(*KNOCKS_AT, KNOCKS_APART))
    label = "knocks, at their own time in every window"
    steps = np.array([0.3 * KNOCKS_APART])
    return Family(Dependence.PERIODIC, label, any_force, waves, shapes, steps, harmonics=KNOCK_HARMONICS, knocks=True)


def _waves(state: PlatformState, shape: ca.SX, harmonics: int) -> ca.SX:
    phase = 2 * ca.pi * shape[0] * state.time
    return ca.vertcat(*(wave(k * phase) for k in range(1, harmonics + 1) for wave in (ca.sin, ca.cos)))


def in_time(reach: Reach) -> list[Family]:
    """Any course in time, the same in all windows."""
    found: list[Family] = []
    for width in (0.15, 0.5, 2.0):
        centres = np.arange(0.0, reach.seconds + width, width)

        def course(state: PlatformState, shape: ca.SX, centres: np.ndarray = centres, width: float = width) -> ca.SX:
            return bells(state.time, ca.SX(ca.DM(centres)), ca.SX(width))

        says = f"changing within {width:g} s"
        found.append(Family(Dependence.TIME, f"force of time, {says}", any_force, course))
        if width == 0.5:
            found.append(Family(Dependence.TIME, f"torque of time, {says}", any_torque, course))
    return found
