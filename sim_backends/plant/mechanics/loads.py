"""Loads that a session puts on the platform or takes off: point masses that are fixed to it, and change with time.

In free motion a mass that grows by grams an hour takes hardly any momentum along: ṁ is left out.
"""

from collections.abc import Iterable

import casadi as ca

from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import Platform, PlatformPoint
from sim_backends.plant.paid_out import HOUR
from sim_backends.plant.world import World


def loads_in(world: World) -> tuple[HiddenEffect, ...]:
    """All that may be on the platform for some time."""
    return world.effects("body-step", "body-drift")


def mass_of(load: HiddenEffect, t: ca.SX | float) -> ca.SX | float:
    """kg, at t (s of the session)."""
    return load["m"] * (t >= load["at"]) if load.id == "body-step" else load["rate"] * t / HOUR


def loads_of(body: Platform) -> Iterable[tuple[ca.SX | float, PlatformPoint]]:
    """The mass (kg) of each load now, and where it is."""
    for load in loads_in(body.world):
        yield mass_of(load, body.now[0]), body.point(load.vector("x", "y", "z"))


def loaded(body: Platform, mass: ca.SX, force: ca.SX) -> tuple[ca.SX, ca.SX]:
    """M and the force on [velocity of G; spin], G being the platform's own, with all loads."""
    gravity = ca.DM(body.world.gravity)
    for load, point in loads_of(body):
        lever = ca.horzcat(ca.SX.eye(3), -ca.skew(point.arm) @ body.rotation)
        mass = mass + load * lever.T @ lever
        force = force + load * lever.T @ (gravity - point.centripetal)
    return mass, force
