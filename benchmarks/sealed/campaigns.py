"""Campaigns with a secret, for the benchmark: planned, simulated in either world, with their truth."""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.app.compose.simulated import simulated_world
from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Campaign, Plan, Robot, Survey
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.random_plan import random_plan
from sim_backends.mujoco_world.forces import SUPPORTED
from sim_backends.mujoco_world.plant import MujocoPlant
from sim_backends.plant.plant import Plant
from sim_backends.plant.sensors import Noise
from sim_backends.simulate import (
    RecordedWindow,
    Sampling,
    SimulatedPlatform,
    can_rest,
    displaced_less,
    simulate_campaign,
)

NATIVE, MUJOCO = "native", "mujoco"
ATTACHMENTS = 0.5
"""of the survey error of an anchor, that of an attachment: a caliper is better than a total station"""
MILDER = 4
"""times that a window in which a cable went slack is recorded again, displaced less"""


@dataclass(frozen=True, eq=False)
class SealedRecipe:
    """All that a campaign with a secret is made from: the same recipe gives the same bytes."""

    name: str
    robot: Robot
    hide: tuple[str, ...]
    """as `fidim simulate --hide`"""
    backend: str
    windows: tuple[int, int]
    """to identify from, and held out"""
    rate: float
    """Hz"""
    lengths: bool
    """whether the encoders are recorded"""
    seed: int
    survey: float = 0.0
    """m: how far the file that goes with the recordings is off the robot, one sd of a coordinate of an anchor"""


def with_survey_errors(robot: Robot, anchors: float, attachments: float, rng: np.random.Generator) -> Robot:
    """The file of a robot whose anchors and attachments are off, each coordinate by a normal error of this sd (m)."""
    moved = [replace(c, d=c.d + anchors * rng.standard_normal(3), a=c.a + _off(attachments, rng)) for c in robot.cables]
    return replace(robot, cables=tuple(moved))


def _off(size: float, rng: np.random.Generator) -> Vector3:
    """Drawn only where there is something to draw, so that older seeds keep their robots."""
    return size * rng.standard_normal(3) if size else np.zeros(3)


def can_hide(backend: str, ids: tuple[str, ...]) -> bool:
    """Whether this world has all of these effects."""
    return backend == NATIVE or all(id in SUPPORTED for id in ids)


def sealed_campaign(recipe: SealedRecipe, *, noise: float = 1.0) -> tuple[Campaign, dict[str, object]]:
    """The campaign and its truth. noise: of the markers, as a part of what the robot file states.

    Raises InfeasibleError where the robot cannot swing, or a cable goes slack however little it is displaced.
    """
    world = simulated_world(recipe.robot, recipe.seed, recipe.hide)
    platform = MujocoPlant(world) if recipe.backend == MUJOCO else Plant(world)
    plan = random_plan(recipe.robot, recipe.name, *recipe.windows, recipe.seed, trial=can_rest(platform))
    for _ in range(MILDER):
        campaign, truth, slack = _recorded(recipe, plan, platform, noise)
        if not slack:
            rng = np.random.default_rng([recipe.seed, 2])
            told = with_survey_errors(recipe.robot, recipe.survey, ATTACHMENTS * recipe.survey, rng)
            how = {"backend": recipe.backend, "seed": recipe.seed, "survey_mm": 1e3 * recipe.survey}
            return replace(campaign, robot=told), truth | how
        plan = displaced_less(plan, slack)
    raise InfeasibleError(f"{recipe.name}: a cable goes slack however little the platform is displaced.")


def quiet_campaign(recipe: SealedRecipe, noise: float) -> Campaign:
    """The same with so much of its noise and the true robot, whose file says how well such a survey knows it."""
    campaign, _ = sealed_campaign(replace(recipe, survey=0.0), noise=noise)
    known = Survey.alike(recipe.robot.n, recipe.survey, ATTACHMENTS * recipe.survey) if recipe.survey else None
    return replace(campaign, robot=replace(campaign.robot, survey=known))


def _recorded(
    recipe: SealedRecipe, plan: Plan, platform: SimulatedPlatform, noise: float
) -> tuple[Campaign, dict[str, object], set[str]]:
    """One recording of all windows, with the windows in which a cable went slack."""
    stated, slack = Noise.of(recipe.robot), set[str]()

    def watch(recorded: RecordedWindow) -> None:
        if recorded.slack:
            slack.add(recorded.window.id)

    campaign, truth = simulate_campaign(
        recipe.robot,
        plan,
        platform.world,
        np.random.default_rng([recipe.seed, 1]),
        replace(stated, marker=noise * stated.marker),
        Sampling(rate=recipe.rate),
        platform=platform,
        watch=watch,
    )
    if not recipe.lengths:
        campaign = replace(campaign, windows=tuple(replace(w, lengths=None) for w in campaign.windows))
    return campaign, truth, slack
