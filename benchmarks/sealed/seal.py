"""Making the campaigns and sealing their truth."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.sealed.campaigns import MUJOCO, NATIVE, SealedRecipe, can_hide, sealed_campaign
from benchmarks.sealed.cases import Case, SecretKind, case_of, case_with
from benchmarks.sealed.folder import BenchmarkFolder, Json, write_json
from benchmarks.sealed.robots import random_setup
from fidim_lab.data.campaign import INDEX, write_campaign
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import FidimError, InfeasibleError

MUJOCO_SHARE = 0.25
"""of the campaigns whose effects MuJoCo has"""
MUJOCO_NOISE = 4e-4
"""m: at least so much marker noise in MuJoCo, whose own error (soft constraints: 0.01–0.08 mm rms after 10 s) `explain`
would rightly find in less"""
SURVEY_SHARE = 1 / 3
"""of the other campaigns, in which the robot file is off"""
SURVEY_ERRORS = 0.2e-3, 2e-3
"""m, of a coordinate of an anchor: what surveys of cable robots are off by"""
ROBOTS = 12
"""drawn for one campaign until one can swing"""


@dataclass(frozen=True)
class SealTask:
    """One campaign to be made."""

    out: Path
    seed: int
    number: int
    windows: tuple[int, int]
    without: str = ""
    """the effect that every campaign hides, because the catalogue is to lack it; empty: what the deck deals"""
    kind: SecretKind | None = None
    """of every campaign; None: what the deck deals"""
    surveyed: bool = False
    """whether every robot file is off; otherwise some are"""

    @property
    def name(self) -> str:
        """b0001 …"""
        return f"b{self.number:04d}"


def seal(task: SealTask) -> str:
    """Make one campaign and write its truth; nothing where both are there. Returns its name.

    Raises InfeasibleError where no robot that was drawn can swing.
    """
    folder = BenchmarkFolder(task.out)
    if folder.sealed(task.name).exists() and (folder.campaign(task.name) / INDEX).exists():
        return task.name
    refused: list[str] = []
    for recipe, case in recipes(task):
        try:
            campaign, truth = sealed_campaign(recipe)
        except FidimError as error:  # an effect may also make the geometry impossible
            refused.append(error.message)
            continue
        shutil.rmtree(folder.campaign(task.name), ignore_errors=True)
        write_campaign(folder.campaign(task.name), campaign)
        write_json(folder.sealed(task.name), _truth(recipe, case, truth))
        return task.name
    raise InfeasibleError(f"{task.name}: none of {ROBOTS} robots can swing. {refused[-1]}", hint="Take another --seed.")


def recipes(task: SealTask) -> Iterator[tuple[SealedRecipe, Case]]:
    """What to try for one campaign, in order: robot after robot, each in MuJoCo first where that was drawn."""
    paper = read_robot(PAPERS_ROBOT)
    for attempt in range(ROBOTS):
        rng = np.random.default_rng([task.seed, task.number, 12, attempt])
        setup = random_setup(paper, rng)
        dealt = partial(case_with, task.without) if task.without else partial(case_of, kind=task.kind)
        case = dealt(task.seed, task.number, setup.robot.mass, setup.robot.n)
        recipe = SealedRecipe(
            name=task.name,
            robot=setup.robot,
            hide=tuple(effect.hide for effect in case.effects),
            backend=NATIVE,
            windows=task.windows,
            rate=setup.rate,
            lengths=setup.lengths,
            seed=int(rng.integers(2**31)),
        )
        in_mujoco = rng.random() < MUJOCO_SHARE and can_hide(MUJOCO, tuple(effect.id for effect in case.effects))
        off = task.surveyed or (rng.random() < SURVEY_SHARE and not task.without)
        size = float(np.exp(rng.uniform(*np.log(SURVEY_ERRORS))))
        if in_mujoco and not task.surveyed:
            yield replace(recipe, robot=_in_mujoco(setup.robot), backend=MUJOCO), case
        yield replace(recipe, survey=size if off else 0.0), case


def _in_mujoco(robot: Robot) -> Robot:
    noise = max(robot.sensors.marker_noise, MUJOCO_NOISE)
    return replace(robot, sensors=replace(robot.sensors, marker_noise=noise))


def recipe_of(task: SealTask, truth: Json) -> SealedRecipe:
    """The recipe by which a campaign was made: the one with this seed and backend."""
    found = [r for r, _ in recipes(task) if (r.seed, r.backend) == (truth["seed"], truth["backend"])]
    if not found:
        raise InfeasibleError(f"{task.name}: its truth was made by another version of the benchmark.")
    return found[0]


def _truth(recipe: SealedRecipe, case: Case, truth: dict[str, object]) -> Json:
    """As `fidim simulate` writes it, with kind and sizes. Random bits keep short secrets from being guessed by hash."""
    hidden = [{"id": h.id, "size": h.size, "unit": h.unit, "hide": h.hide} for h in case.effects]
    more = {"kind": case.kind.value, "hidden": hidden, "marker_noise": recipe.robot.sensors.marker_noise}
    salt = np.random.default_rng().bytes(16).hex()
    return json.loads(json.dumps(truth | more | {"rate": recipe.rate, "salt": salt}))
