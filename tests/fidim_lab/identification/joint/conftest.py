"""One platform on four, three and two of the same cables: true motions, and robot files that were surveyed."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign, Motion, Robot, Role, Sensors, Survey, Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

EXTRA = (np.array([0.15, 0.1, 0.1]), np.array([-0.1, 0.14, 0.12]))
ANCHOR, ATTACHMENT = 1e-3, 0.5e-3
CABLES = {4: (0, 1, 2, 3), 3: (0, 1, 2), 2: (0, 2)}
"""which of the four hold the platform"""

Surveyed = Callable[..., list[Campaign]]


def only(robot: Robot, which: tuple[int, ...]) -> Robot:
    """The robot on some of its cables."""
    survey = robot.survey
    if survey is not None:
        chosen = list(which)
        survey = replace(survey, anchor=survey.anchor[chosen], attachment=survey.attachment[chosen])
    return replace(robot, cables=tuple(robot.cables[k] for k in which), survey=survey)


@pytest.fixture(scope="session")
def base(irma4: Robot) -> Robot:
    survey = Survey.alike(4, ANCHOR, ATTACHMENT)
    return replace(irma4, extra_markers=EXTRA, sensors=Sensors(1e-4, 2e-5), survey=survey)


@pytest.fixture(scope="session")
def body(irma4: Robot) -> Body:
    """The true one, some per cent off CAD."""
    inertia = irma4.nominal.inertia * [1.08, 0.95, 0.93, 1, 1, 1] + [0, 0, 0, 6e-4, -4e-4, 5e-4]
    return Body(irma4.nominal.com + np.array([0.004, -0.006, 0.008]), inertia)


def motion_of(mechanism: Mechanism, body: Body, k: int, seconds: float) -> tuple[np.ndarray, Motion]:
    """Lengths and motion, struck at rest along all free twists; drawn until no cable goes slack."""
    robot = mechanism.robot
    random = np.random.default_rng(10 * robot.n + k)
    t = np.arange(round(seconds * 100) + 1) / 100
    while True:
        lengths = random.uniform(1.25, 1.55, robot.n)
        try:
            rest = pose_from_lengths(mechanism, body, lengths)
        except InfeasibleError:
            continue
        xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        free = np.linalg.svd(xi)[2][robot.n :].T
        found = simulate_free_motion(
            mechanism, body, rest.pose, free @ (0.25 * random.choice([-1.0, 1.0], free.shape[1])), t
        )
        if found.slack_time is None:
            return lengths, found.motion


@pytest.fixture(scope="session")
def surveyed(base: Robot, body: Body) -> Surveyed:
    """Campaigns by 4, 3 and 2 cables whose one robot file has the errors of its survey."""
    motions: dict[tuple[object, ...], tuple[np.ndarray, Motion]] = {}

    def make(
        seed: int,
        *,
        cables: tuple[int, ...] = (4, 3, 2),
        windows: int = 4,
        seconds: float = 3.0,
        effect: NamedEffect | None = None,
        theta: tuple[float, ...] = (),
    ) -> list[Campaign]:
        random = np.random.default_rng(seed)
        stated = replace(
            base,
            cables=tuple(
                replace(c, d=c.d + ANCHOR * random.standard_normal(3), a=c.a + ATTACHMENT * random.standard_normal(3))
                for c in base.cables
            ),
        )
        found: list[Campaign] = []
        for n in cables:
            robot, recorded = only(stated, CABLES[n]), list[Window]()
            for k in range(windows):
                key = (n, k, seconds, effect, theta)
                if key not in motions:
                    mechanism = Mechanism(only(base, CABLES[n]), () if effect is None else (effect,), theta)
                    motions[key] = motion_of(mechanism, body, k, seconds)
                lengths, motion = motions[key]
                places = motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, robot.markers)
                places = places + robot.sensors.marker_noise * random.standard_normal(places.shape)
                read = lengths + robot.sensors.encoder_resolution * random.standard_normal(n)
                every = np.tile(read, (len(places), 1))
                recorded.append(Window(f"w{k + 1}", Role.IDENTIFY, motion.t, places, every, None))
            found.append(Campaign(f"cables-{n}", robot, 100.0, tuple(recorded)))
        return found

    return make
