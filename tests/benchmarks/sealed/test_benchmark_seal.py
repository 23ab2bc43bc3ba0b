"""Recipes of sealed campaigns: the same from seed and number, in MuJoCo only where it has the effects; loudness."""

import pickle
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sealed.campaigns import MUJOCO, NATIVE, quiet_campaign, sealed_campaign
from benchmarks.sealed.cases import SecretKind
from benchmarks.sealed.child import ChildOutcome, ChildTask, in_child
from benchmarks.sealed.seal import MUJOCO_NOISE, MUJOCO_SHARE, SURVEY_ERRORS, SealTask, recipe_of, recipes
from fidim_lab.data.robot_file import read_robot, write_robot
from sim_backends.mujoco_world.forces import SUPPORTED

TASKS = [SealTask(Path("nowhere"), 7, number, (6, 3)) for number in range(1, 41)]


def alike(a, b, tmp_path) -> bool:
    for name, recipe in (("a", a), ("b", b)):
        write_robot(tmp_path / name, recipe.robot)
    same_robot = (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    return same_robot and (a.hide, a.seed, a.backend, a.rate) == (b.hide, b.seed, b.backend, b.rate)


def test_a_recipe_is_found_again_from_its_truth(tmp_path):
    for task in TASKS[:5]:
        for recipe, _ in recipes(task):
            again = recipe_of(task, {"seed": recipe.seed, "backend": recipe.backend})
            assert alike(recipe, again, tmp_path)


def test_another_robot_is_drawn_where_one_cannot_swing(tmp_path):
    found = [recipe for recipe, _ in recipes(TASKS[0])]
    assert len({recipe.seed for recipe in found}) >= 12
    assert not alike(found[0], found[-1], tmp_path)


def test_mujoco_takes_its_share_of_what_it_can_hide_and_the_native_world_follows():
    in_mujoco = possible = 0
    for task in TASKS:
        tried = list(recipes(task))
        recipe, case = tried[0]
        ids = {hidden.id for hidden in case.effects}
        possible += ids <= set(SUPPORTED)
        if recipe.backend == MUJOCO:
            in_mujoco += 1
            assert ids <= set(SUPPORTED)
            assert tried[1][0].backend == NATIVE
            assert tried[1][0].seed == recipe.seed
            assert recipe.robot.sensors.marker_noise >= MUJOCO_NOISE  # its own error is no secret
    assert 0 < in_mujoco < 2.5 * MUJOCO_SHARE * possible


def test_a_part_of_the_robot_files_is_off_in_the_native_world_and_all_where_asked(tmp_path):
    first = [next(recipes(task))[0] for task in TASKS]
    assert 0 < sum(recipe.survey > 0 for recipe in first) < len(first) / 2
    assert all(recipe.backend == NATIVE for recipe in first if recipe.survey)
    for task in TASKS[:5]:
        recipe, _ = next(recipes(replace(task, surveyed=True, kind=SecretKind.NOTHING)))
        assert not recipe.hide
        assert SURVEY_ERRORS[0] <= recipe.survey <= SURVEY_ERRORS[1]


def test_the_recordings_are_of_the_true_robot_and_loudness_is_judged_against_its_survey():
    recipe, _ = next(recipes(replace(TASKS[0], surveyed=True, kind=SecretKind.NOTHING, windows=(1, 0))))
    campaign, truth = sealed_campaign(recipe)
    exact, _ = sealed_campaign(replace(recipe, survey=0.0))
    assert np.array_equal(campaign.windows[0].markers, exact.windows[0].markers)
    off = np.array([wrong.d - true.d for wrong, true in zip(campaign.robot.cables, exact.robot.cables, strict=True)])
    assert 0.2 * recipe.survey < off.std() < 3 * recipe.survey
    assert truth["survey_mm"] == pytest.approx(1e3 * recipe.survey)
    quiet = quiet_campaign(recipe, 0.1).robot
    assert np.array_equal(quiet.cables[0].d, exact.robot.cables[0].d)
    assert np.allclose(quiet.survey.anchor, recipe.survey)


def test_what_goes_to_a_cluster_can_travel(tiny):
    action = pickle.loads(pickle.dumps(partial(in_child, ChildTask.EXPLAIN, cap=60.0)))
    assert action.keywords == {"cap": 60.0}
    again = pickle.loads(pickle.dumps(tiny))
    assert np.array_equal(again.windows[0].markers, tiny.windows[0].markers)
    outcome = ChildOutcome({"a": 1}, "", 1.0, 2.0)
    assert pickle.loads(pickle.dumps(outcome)) == outcome


@pytest.mark.slow
def test_a_louder_secret_is_louder_and_nothing_is_silent(irma4_file):
    """χ² excess grows with the square of a faint effect; without one it is nought."""
    from benchmarks.sealed.loudness import QUIET, loudness

    base = next(recipe for recipe, case in recipes(TASKS[0]) if recipe.backend == NATIVE)
    base = replace(base, robot=read_robot(irma4_file), windows=(3, 1))
    excess = []
    for hide in ((), ("air-drag-linear:c=0.02",), ("air-drag-linear:c=0.04",)):
        campaign, _ = sealed_campaign(replace(base, hide=hide), noise=QUIET)
        excess.append(loudness(campaign).chi2_excess)
    assert excess[0] < 20
    assert excess[1] > 5 * excess[0]
    assert 2.5 < excess[2] / excess[1] < 5
