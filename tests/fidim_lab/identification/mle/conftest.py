"""Robots with one to five cables, and recordings of theirs made by the project's other integrator."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Cable, Motion, Robot, Role, Sensors, Window
from fidim_lab.model.kinematics import equilibrium_at, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.slots import Effect

SENSORS = Sensors(marker_noise=1e-4, encoder_resolution=2e-5)
EXTRA = (np.array([0.15, 0.1, 0.1]), np.array([-0.1, 0.14, 0.12]))

Record = Callable[..., list[Window]]


def hanging_robot(n: int) -> Robot:
    """n cables from an uneven ring of anchors to a skewed ring of attachments; three markers."""
    cables = []
    for index in range(n):
        angle = 2 * np.pi * index / n + 0.3
        out, side, up = (
            np.array([np.cos(angle), np.sin(angle), 0]),
            np.array([-np.sin(angle), np.cos(angle), 0]),
            np.eye(3)[2],
        )
        skewed = angle + 0.5 * (-1) ** index
        across = np.array([np.cos(skewed), np.sin(skewed), 0.0])
        d = (0.0 if n == 1 else 1.1 + 0.1 * index) * out + (1.0 + 0.03 * index) * up
        a = (0.05 if n == 1 else 0.25 + 0.02 * index) * across + (0.25 + 0.04 * (-1) ** index) * up
        cables.append(Cable(d=d, a=a, radius=0.025, x=-out, y=np.cross(side, -out), z=side))
    nominal = Body(np.array([0.0, 0.0, 0.13]), np.array([0.06, 0.07, 0.05, 0.0, 0.0, 0.0]))
    return Robot(tuple(cables), 11.0, nominal, np.array([0.02, -0.03, 0.05]), EXTRA, sensors=SENSORS)


def true_body(robot: Robot) -> Body:
    """Some per cent to twenty per cent off the nominal one."""
    off = np.array([0.006, -0.008, 0.05 * robot.nominal.com[2]])
    inertia = robot.nominal.inertia * [1.12, 0.94, 0.92, 1, 1, 1] + [0, 0, 0, 8e-4, -6e-4, 5e-4]
    return Body(robot.nominal.com + off, inertia)


def rest_of(mechanism: Mechanism, body: Body, k: int):
    """The k-th of a few equilibria."""
    n = mechanism.n
    if n == 4:
        place = [(1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3), (1.4, 0.05, -0.25)][k % 4]
        return equilibrium_at(mechanism, body, np.array(place))
    if n == 5:
        return equilibrium_at(
            mechanism, body, np.array([-0.1 + 0.04 * (k % 3), -0.1 + 0.05 * (k % 2), -0.1 - 0.03 * k])
        )
    return pose_from_lengths(mechanism, body, 1.3 + 0.06 * np.array([(k * (i + 2)) % 3 - 1 for i in range(n)]))


def motion_of(mechanism: Mechanism, body: Body, k: int, t: np.ndarray, kick: float) -> tuple[np.ndarray, Motion]:
    """Lengths and motion, struck at rest along all free twists."""
    rest = rest_of(mechanism, body, k)
    xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
    free = np.linalg.svd(xi)[2][mechanism.n :].T
    rates = kick * np.random.default_rng(k).choice([-1.0, 1.0], free.shape[1]) * (1 + 0.3 * np.arange(free.shape[1]))
    found = simulate_free_motion(mechanism, body, rest.pose, free @ rates, t)
    assert found.slack_time is None, f"the test's own motion {k} lets cable {found.slack_cable} go slack"
    return rest.lengths, found.motion


@pytest.fixture(scope="session")
def four(irma4: Robot) -> Robot:
    return replace(irma4, sensors=SENSORS)


@pytest.fixture(scope="session")
def robot_with(four: Robot) -> Callable[[int], Robot]:
    return lambda n: four if n == 4 else hanging_robot(n)


@pytest.fixture(scope="session")
def record() -> Record:
    """Windows of one robot with white noise: as many as asked for, exact motions made once."""
    motions: dict[tuple, tuple[np.ndarray, Motion]] = {}

    def make(
        robot: Robot,
        count: int = 4,
        *,
        seconds: float = 2.0,
        rate: float = 100.0,
        seed: int = 0,
        markers: int = 1,
        kick: float = 0.3,
        noise: float | None = None,
        effects: Sequence[Effect] = (),
        theta: Sequence[float] | None = None,
        body: Body | None = None,
    ) -> list[Window]:
        random = np.random.default_rng(seed)
        mechanism = Mechanism(robot, effects, theta)
        t = np.arange(round(seconds * rate) + 1) / rate
        sigma = robot.sensors.marker_noise if noise is None else noise
        windows = []
        for k in range(count):
            key = (robot.n, k, seconds, rate, kick, theta if theta is None else tuple(theta), id(body))
            if key not in motions:
                motions[key] = motion_of(mechanism, body or true_body(robot), k, t, kick)
            lengths, motion = motions[key]
            places = motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, robot.markers[:markers])
            places = places + sigma * random.standard_normal(places.shape)
            read = lengths + robot.sensors.encoder_resolution * random.standard_normal(robot.n)
            windows.append(Window(f"w{k + 1}", Role.IDENTIFY, t, places, np.tile(read, (len(t), 1)), None))
        return windows

    return make


@pytest.fixture(scope="session")
def truth() -> Callable[[Robot], Body]:
    return true_body
