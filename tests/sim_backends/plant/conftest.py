"""Robots and ways to let a plant swing, for the tests of the simulated world."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Cable, Robot
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World, make_world

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
ASIDE = np.array([0.03, -0.02])

MakeWorld = Callable[..., World]
Swing = Callable[..., tuple[Plant, np.ndarray]]


@pytest.fixture(scope="session")
def world_of(irma4: Robot) -> MakeWorld:
    """A world of the four-cable robot with these effects hidden; the nominal body unless `seed` draws one."""

    def build(*effects: str, seed: int | None = None) -> World:
        hidden = tuple(parse_effect(text, irma4.n) for text in effects)
        body = irma4.nominal if seed is None else None
        return make_world(irma4, np.random.default_rng(seed or 0), hidden, body=body)

    return build


@pytest.fixture(scope="session")
def swing(world_of: MakeWorld) -> Swing:
    """Displace, release, let swing: the plant afterwards and the main marker at 100 Hz (N, 3)."""

    def release(*effects: str, duration: float = 2.0, step: float | None = None) -> tuple[Plant, np.ndarray]:
        plant = Plant(world_of(*effects))
        if step is not None:
            plant._motion._longest = step
        plant.place(plant.rest(LENGTHS, displacement=ASIDE), LENGTHS)
        plant.begin_window(1)
        seen = [plant.markers()[0]]
        for k in range(1, round(duration * 100) + 1):
            plant.advance(k / 100)
            seen.append(plant.markers()[0])
        return plant, np.array(seen)

    return release


def _ring(n: int, radius: float = 0.02) -> Robot:
    """A robot whose n cables come from a ring and meet the platform on a smaller one, pulleys standing upright."""
    angles = 2 * np.pi * np.arange(n) / n
    cables = []
    for k, angle in enumerate(angles):
        # Neither symmetric nor all through one point: such a robot would have dependent cables.
        turn = angle + 0.4 * (-1) ** k + 0.1 * k
        inner = np.array([0.2 * np.cos(turn), 0.2 * np.sin(turn), 0.25 + 0.01 * k])
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        # The cable enters each pulley along a horizontal tangent of the ring.
        z, x = np.cross([0.0, 0.0, 1.0], out), -out
        cables.append(Cable(d=1.0 * out + [0, 0, 0.6], a=inner, radius=radius, x=x, y=np.cross(z, x), z=z))
    return Robot(
        cables=tuple(cables),
        mass=9.0,
        nominal=Body(com=np.array([0.002, -0.003, 0.17]), inertia=np.array([0.05, 0.06, 0.035, 1e-4, -2e-4, 3e-4])),
        marker=np.array([0.05, 0.02, 0.0]),
    )


def _true_world(robot: Robot) -> World:
    """The robot as it says it is, nothing hidden."""
    return replace(make_world(robot, np.random.default_rng(0), body=robot.nominal), mass=robot.mass)


def _paper_length(cable: Cable, attachment: np.ndarray) -> float:
    """Cable length by the closed formulas of spec/model.md §1, point by point: another derivation than the plant's."""
    c = attachment - cable.d
    h, cz, r = np.hypot(c @ cable.x, c @ cable.y), c @ cable.z, cable.radius
    e = h - r
    squared = e**2 + cz**2
    rho = np.sqrt(squared - r**2)
    phi = np.arctan2(e * rho + r * cz, rho * cz - r * e) % (2 * np.pi)
    return float(r * phi + rho)


def _lengths_of(world: World, plant: Plant) -> np.ndarray:
    """True geometric cable lengths at the plant's pose, m."""
    pose = plant.pose
    return np.array([_paper_length(cable, pose.position + pose.rotation @ cable.a) for cable in world.cables])


@pytest.fixture(scope="session")
def ring() -> Callable[..., Robot]:
    return _ring


@pytest.fixture(scope="session")
def true_world() -> Callable[[Robot], World]:
    return _true_world


@pytest.fixture(scope="session")
def lengths_of() -> Callable[[World, Plant], np.ndarray]:
    return _lengths_of
