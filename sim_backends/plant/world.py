"""The true robot of a simulation: what the robot file says, moved away from it by a seed and by hidden effects.

`hidden_body` draws the body, `make_world` puts everything together. A `World` is frozen: the plant never changes it.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import Matrix3, Vector3
from fidim_lab.data.records import Body, Cable, Robot, WinchTorque
from fidim_lab.errors import SetupError
from sim_backends.plant.hidden import HiddenEffect

MOST_DRAWS = 1000


@dataclass(frozen=True, eq=False)
class World:
    """What is true in a simulation. Frames and units as in `fidim_lab.data.records`."""

    cables: tuple[Cable, ...]
    mass: float
    """kg"""
    body: Body
    """centre of mass and inertia about P for each kg of `mass`"""
    markers: np.ndarray
    """(M, 3) body frame, m; the main one first"""
    gravity: Vector3
    winches: tuple[WinchTorque, ...] | None
    hidden: tuple[HiddenEffect, ...] = ()

    @property
    def n(self) -> int:
        """Number of cables."""
        return len(self.cables)

    def effects(self, *ids: str) -> tuple[HiddenEffect, ...]:
        """The hidden effects with one of these ids."""
        return tuple(effect for effect in self.hidden if effect.id in ids)

    @property
    def middle(self) -> Vector3:
        """Middle of the entry points, m: where effects that are fixed in the room are counted from."""
        return np.mean([cable.d for cable in self.cables], axis=0)


def make_world(
    robot: Robot, rng: np.random.Generator, hidden: tuple[HiddenEffect, ...] = (), *, body: Body | None = None
) -> World:
    """A true robot: its body drawn by `rng` (or given), its geometry and gravity moved by the hidden effects.

    Args:
        robot: what the robot file says.
        rng: draws the body and the mass (within 1 %); always draws as often, whatever is given.
        hidden: effects from `hidden.parse_effect`.
        body: the true body where it is known, for each kg.

    Raises:
        SetupError: no physical body lies near the nominal one, or an effect makes the geometry impossible.
    """
    drawn = hidden_body(robot, rng)
    mass = robot.mass * (1.0 + rng.uniform(-0.01, 0.01))
    world = World(
        cables=robot.cables,
        mass=mass,
        body=body or drawn,
        markers=robot.markers,
        gravity=robot.gravity,
        winches=robot.winches,
        hidden=hidden,
    )
    for effect in hidden:
        world = _moved(world, effect)
    return world


def hidden_body(robot: Robot, rng: np.random.Generator) -> Body:
    """A body that can exist, 10–20 % away from the nominal one, its centre of mass some mm off in x and y.

    The principal moments about G are scaled one by one and the principal axes turned by some degrees, so that the
    products are not zero. s_z moves by 2–12 %.

    Raises:
        SetupError: the nominal body is too far from any that can exist.
    """
    nominal = robot.nominal
    for _ in range(MOST_DRAWS):
        com = nominal.com * np.array([1.0, 1.0, 1.0 + _away(rng, 0.02, 0.12)]) + np.append(rng.normal(0, 3e-3, 2), 0.0)
        moments, axes = np.linalg.eigh(nominal.inertia_about_com)
        moments = moments * (1.0 + np.array([_away(rng, 0.1, 0.2) for _ in range(3)]))
        axes = rotation(rng.normal(0.0, 0.02, 3)) @ axes
        about_com = axes @ np.diag(moments) @ axes.T
        if exists(about_com):
            return Body.from_about_com(com, about_com)
    raise SetupError(
        f"The robot's nominal inertia {np.array2string(nominal.inertia, precision=4)} m² about P belongs to no body "
        "that can exist, nor to one near it.",
        hint="Check nominal_com and nominal_inertia in the robot file.",
    )


def exists(about_com: Matrix3) -> bool:
    """Whether a rigid body can have this inertia about its centre of mass: moments positive, triangle inequality."""
    small, middle, large = np.linalg.eigvalsh(about_com)
    return bool(small > 0 and small + middle > large)


def _away(rng: np.random.Generator, least: float, most: float) -> float:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(least, most))


def rotation(vector: Vector3) -> Matrix3:
    """Rotation matrix that turns about `vector` by its length, rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    k = np.cross(np.eye(3), vector / angle)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def _moved(world: World, effect: HiddenEffect) -> World:
    """The world with one geometric effect put into it; unchanged by any other."""
    match effect.id:
        case "anchor-offset":
            return _with_cable(world, effect, "d")
        case "attachment-offset":
            return _with_cable(world, effect, "a")
        case "pulley-radius":
            cables = tuple(replace(cable, radius=cable.radius + effect["dr"]) for cable in world.cables)
            if min(cable.radius for cable in cables) < 0:
                raise SetupError(f"--hide pulley-radius: dr = {effect['dr']} m leaves a pulley with a negative radius.")
            return replace(world, cables=cables)
        case "gravity-tilt":
            tilt = rotation(np.array([effect["rx"], effect["ry"], 0.0]))
            return replace(world, gravity=tilt @ world.gravity)
        case "marker-offset":
            markers = world.markers.copy()
            markers[0] += effect.vector("dx", "dy", "dz")
            return replace(world, markers=markers)
        case _:
            return world


def _with_cable(world: World, effect: HiddenEffect, point: str) -> World:
    offset = effect.vector("dx", "dy", "dz")
    cables = tuple(
        replace(cable, **{point: getattr(cable, point) + offset}) if effect.concerns(i) else cable
        for i, cable in enumerate(world.cables)
    )
    return replace(world, cables=cables)
