"""Campaigns without model error, each with a body, places and noise of its own, from the independent simulator."""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Body, Campaign, Plan, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.random_plan import random_plan
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, can_rest, simulate_campaign


@dataclass(frozen=True, eq=False)
class Known:
    campaign: Campaign
    body: Body
    """the true one"""


def papers_robot() -> Robot:
    return read_robot(PAPERS_ROBOT)


def simulated(
    seed: int,
    equilibria: int = 12,
    validation: int = 0,
    *,
    noisy: bool = True,
    further: tuple[tuple[float, float, float], ...] = (),
) -> Known:
    """A campaign with the marker noise of the robot file, 0.1 mm, or with none; with further markers (body frame, m).

    Seeds whose cables go slack are drawn again.
    """
    robot = replace(papers_robot(), extra_markers=tuple(np.array(marker) for marker in further))
    noise = replace(Noise.of(robot), **({} if noisy else {"marker": 0.0}))
    for attempt in range(10):
        world = make_world(robot, np.random.default_rng([seed, attempt, 0]))
        plant = Plant(world)
        numbers = equilibria, validation, 100 * seed + attempt
        plan: Plan = random_plan(robot, f"seed-{seed}", *numbers, trial=can_rest(plant))
        rng = np.random.default_rng([seed, attempt, 1])
        campaign, truth = simulate_campaign(robot, plan, world, rng, noise, Sampling(), platform=plant)
        if not truth["slack"]:
            return Known(campaign, world.body)
    raise SystemExit(f"seed {seed}: a cable goes slack in every draw")
