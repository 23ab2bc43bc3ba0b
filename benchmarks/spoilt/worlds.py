"""Worlds whose recordings are spoilt: robots with four, three and two cables of several sizes, each with its own body.

`swung`: the independent simulator's free motion about several equilibria. `yawed`: the classical test of a bifilar
pendulum, pure yaw of a symmetric one, by an integration of its own. Both without marker noise.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fidim_lab.data.records import Body, Campaign, Plan, Robot, Role, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.random_plan import Taste, random_plan
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import World, make_world, rotation
from sim_backends.simulate import Sampling, simulate_campaign

EXAMPLES = Path(__file__).parents[2] / "examples" / "robots"
ROBOTS = (PAPERS_ROBOT, EXAMPLES / "trifilar.toml", EXAMPLES / "bifilar.toml")
SIZES = (0.7, 1.0, 1.4)
"""times what the robot file has, all lengths alike"""
FURTHER = ((0.15, 0.1, 0.05), (-0.1, 0.15, 0.0), (-0.12, -0.14, 0.1))
"""m, body frame, of three more markers where the robot file has one"""
IDENTIFY, VALIDATE, SECONDS, RATE = 4, 1, 6.0, 100.0
TASTES = {2: Taste(depth=(3.0, 6.0)), 3: Taste(depth=(2.0, 4.5)), 4: Taste()}
"""by the number of cables: pendulums hang on cords of one to two metres (docs/pendulums.md)"""
ADDED = (0.03, 0.15)
"""of the platform's mass, that hangs on it in one window"""


@dataclass(frozen=True, eq=False)
class Known:
    campaign: Campaign
    body: Body
    """the true one"""
    heavier: Campaign | None = None
    """the same windows of the platform with a mass put on it"""


def scaled(robot: Robot, size: float, *, one_marker: bool) -> Robot:
    """The robot with all its lengths so many times as large; with its main marker alone, or with four."""
    cables = tuple(replace(c, d=size * c.d, a=size * c.a, radius=size * c.radius) for c in robot.cables)
    nominal = Body(size * robot.nominal.com, size**2 * robot.nominal.inertia)
    extra = () if one_marker else robot.extra_markers or tuple(np.array(marker) for marker in FURTHER)
    return replace(
        robot,
        cables=cables,
        nominal=nominal,
        marker=size * robot.marker,
        extra_markers=tuple(size * marker for marker in extra),
    )


@cache
def swung(seed: int, number: int, *, one_marker: bool) -> Known:
    """World `number` of a seed. Bodies with which a cable goes slack are drawn again."""
    rng = np.random.default_rng([seed, number, 1])
    size = float(rng.choice(SIZES))
    robot = scaled(read_robot(ROBOTS[number % len(ROBOTS)]), size, one_marker=one_marker)
    noise = replace(Noise.of(robot), marker=0.0)
    for attempt in range(12):
        world = make_world(robot, np.random.default_rng([seed, number, attempt]))
        try:
            draws = 1000 * seed + 20 * number + attempt
            plan = random_plan(robot, f"spoilt-{number}", IDENTIFY, VALIDATE, draws, TASTES[robot.n])
            made, heavier = (
                _recorded(robot, plan, one, noise, np.random.default_rng([seed, number, attempt, 2]))
                for one in (world, _loaded(world, rng))
            )
        except InfeasibleError:
            continue
        if made is not None:
            return Known(made, world.body, heavier)
    raise SystemExit(f"seed {seed}, world {number}: a cable goes slack in every draw")


def _recorded(robot: Robot, plan: Plan, world: World, noise: Noise, rng: np.random.Generator) -> Campaign | None:
    """None where a cable goes slack."""
    recording = Sampling(SECONDS, RATE)
    campaign, truth = simulate_campaign(robot, plan, world, rng, noise, recording, platform=Plant(world))
    return None if truth["slack"] else campaign


def _loaded(world: World, rng: np.random.Generator) -> World:
    """With a point mass somewhere between the attachments and the centre of mass."""
    share = rng.uniform(*ADDED)
    at = rng.uniform(0.2, 0.9) * world.cables[rng.integers(world.n)].a + rng.uniform(0.2, 0.9) * world.body.com
    of_point = (at @ at) * np.eye(3) - np.outer(at, at)
    body = Body(
        com=(world.body.com + share * at) / (1 + share),
        inertia=(world.body.inertia + share * of_point[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]) / (1 + share),
    )
    return replace(world, body=body, mass=(1 + share) * world.mass)


def yawed(rng: np.random.Generator, *, drag: bool, several: bool) -> Known:
    """Pure yaw of a symmetric bifilar pendulum. `drag`: it dies out. `several`: each window with other cords."""
    arm, plumb = rng.uniform(0.1, 0.4), rng.uniform(0.6, 2.2)
    izz, s_z = (arm * rng.uniform(0.7, 1.5)) ** 2, -rng.uniform(0.05, 0.3)
    about_com = izz * rng.uniform(0.55, 0.95, 2)
    inertia = np.array([about_com[0] + s_z**2, about_com[1] + s_z**2, izz, 0.0, 0.0, 0.0])
    body = Body(np.array([0.0, 0.0, s_z]), inertia)
    guess = Body(body.com * rng.uniform(0.9, 1.1), inertia * rng.uniform(0.85, 1.15))
    robot = _bifilar(arm, plumb, guess)
    slowing = (0.1 * izz * rng.uniform(0.1, 1.0), izz * rng.uniform(0.0, 0.5)) if drag else (0.0, 0.0)
    t = np.arange(round((10.0 if not drag else 20.0) * 50) + 1) / 50.0
    windows = []
    for k in range(IDENTIFY):
        length = plumb * (rng.uniform(0.65, 1.0) if several else 1.0)
        yaw = _yaw(t, rng.uniform(0.1, 0.5), (arm, length, izz), slowing)
        sunk = np.sqrt(length**2 - 4 * (arm * np.sin(yaw / 2)) ** 2)
        places = np.stack([np.zeros_like(t), np.zeros_like(t), plumb - sunk], axis=1)
        turns = np.stack([rotation(np.array([0.0, 0.0, angle])) for angle in yaw])
        markers = places[:, np.newaxis] + np.einsum("nij,mj->nmi", turns, robot.markers)
        lengths = np.full((len(t), 2), length)
        role = Role.VALIDATE if k == IDENTIFY - 1 else Role.IDENTIFY
        windows.append(Window(f"w{k + 1}", role, t, markers, lengths, None))
    return Known(Campaign("yaw-only", robot, 50.0, tuple(windows)), body)


def _bifilar(arm: float, plumb: float, nominal: Body) -> Robot:
    """Two cords of a length, tied to eyelets on the y axis."""
    like = read_robot(EXAMPLES / "bifilar.toml")
    sides = (np.array([0.0, -arm, 0.0]), np.array([0.0, arm, 0.0]))
    up = np.array([0.0, 0.0, plumb])
    cables = tuple(replace(cable, d=side + up, a=side) for cable, side in zip(like.cables, sides, strict=True))
    sensors = replace(like.sensors, marker_noise=2e-4)
    return replace(like, cables=cables, nominal=nominal, sensors=sensors, extra_markers=like.extra_markers)


def _yaw(t: np.ndarray, begin: float, pendulum: tuple[float, float, float], slowing: tuple[float, float]) -> np.ndarray:
    """Angle (rad) by Lagrange: kinetic energy (I + z′²) ω²/2, height z(θ) = −√(L² − 4 b² sin²(θ/2)), per unit mass."""
    b, length, izz = pendulum

    def rate(_: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        height = np.sqrt(length**2 - 4 * (b * np.sin(angle / 2)) ** 2)
        slope = b**2 * np.sin(angle) / height
        bend = b**2 * np.cos(angle) / height + slope**2 / height
        torque = -9.81 * slope - slowing[0] * speed - slowing[1] * abs(speed) * speed
        return [speed, (torque - slope * bend * speed**2) / (izz + slope**2)]

    solved = solve_ivp(rate, (0.0, t[-1]), (begin, 0.0), t_eval=t, rtol=1e-10, atol=1e-12)
    return solved.y[0]
