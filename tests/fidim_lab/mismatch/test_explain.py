"""`explain` on campaigns whose answer is known: simulated ones, and the eight beside the checkout."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.golden import CASES
from fidim_lab.app import cli
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Campaign, Robot, Survey
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import Verdict, write_explanation
from fidim_lab.mismatch.explain import explain
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

SHARED = Path(__file__).parents[4] / "shared"
OPEN = (
    "open-nothing-left-out",
    "open-air-drag",
    "open-swivel-friction",
    "open-anchor-moved",
    "open-periodic-force",
    "open-two-at-once",
    "open-elastic-cables",
    "open-outside-catalogue",
)


@pytest.mark.slow
def test_the_command_names_a_hidden_effect(irma4: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = random_plan(irma4, "short", 5, 2, 5)
    hidden = parse_effect("swivel-friction:c=0.01", irma4.n)
    world = make_world(irma4, np.random.default_rng(5), (hidden,))
    campaign, _ = simulate_campaign(irma4, plan, world, np.random.default_rng(6), recording=Sampling(4.0))
    write_campaign(tmp_path / "short", replace(campaign, name="short"))
    file = tmp_path / "explanation.json"
    assert cli.run(["explain", str(tmp_path / "short"), "--json", str(file)]) == 0
    assert "swivel-friction" in capsys.readouterr().out
    table = json.loads(file.read_text())
    assert table["format"] == "fidim-explanation/1"
    assert table["verdict"] == "explained"
    assert [effect["id"] for effect in table["effects"]] == ["swivel-friction"]
    found = table["effects"][0]["parameters"]["c"]
    assert abs(found["value"] - 0.01) < 5 * found["sd"]
    assert table["held_out"]["chi2_per_dof"]["after"] < 1.1 < table["held_out"]["chi2_per_dof"]["before"]
    assert set(table["parameters"]) == set(table["parameters_before"])


def short_campaign(robot: Robot, seed: int, *hidden: str) -> Campaign:
    plan = random_plan(robot, "short", 5, 2, seed)
    effects = tuple(parse_effect(text, robot.n) for text in hidden)
    world = make_world(robot, np.random.default_rng(seed), effects)
    return simulate_campaign(robot, plan, world, np.random.default_rng(seed + 1), recording=Sampling(5.0))[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40, 48))
def test_nothing_is_found_where_nothing_is_hidden(irma4: Robot, seed: int) -> None:
    explanation = explain(short_campaign(irma4, seed))
    assert explanation.verdict is Verdict.NOTHING_MISSING
    assert not explanation.effects
    assert "false alarm" in explanation.message


@pytest.mark.slow
def test_two_effects_are_named_together(irma4: Robot) -> None:
    campaign = short_campaign(irma4, 61, "rotational-drag:c=0.05", "cable-length-bias:cable=2,bias=0.004")
    explanation = explain(campaign)
    assert explanation.verdict is Verdict.EXPLAINED
    named = {(cause.id, cause.cable) for cause in explanation.effects}
    assert named == {("rotational-drag", None), ("cable-length-bias", 2)}


@pytest.mark.slow
def test_what_no_effect_describes_is_unknown(irma4: Robot) -> None:
    explanation = explain(short_campaign(irma4, 62, "unknown:k=-60"))
    assert explanation.verdict is Verdict.UNKNOWN_PHYSICS
    assert not explanation.effects
    assert explanation.where


@pytest.mark.slow
def test_what_no_effect_describes_is_unknown_beside_a_survey_that_is_stated() -> None:
    """An open geometry blurs all predictions: held-out windows judge a wrench only by what goes beyond that."""
    campaign = CASES["unknown"].simulated()
    survey = Survey.alike(campaign.robot.n, 1e-3, 0.5e-3)
    explanation = explain(replace(campaign, robot=replace(campaign.robot, survey=survey)))
    assert explanation.verdict is Verdict.UNKNOWN_PHYSICS
    assert not explanation.effects


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize("name", OPEN)
def test_open_campaigns_are_right(name: str, tmp_path: Path) -> None:
    folder = SHARED / "campaigns" / name
    if not folder.is_dir():
        pytest.skip("../shared/campaigns is not beside this checkout")
    explanation = explain(read_campaign(folder))
    file = tmp_path / "explanation.json"
    write_explanation(file, explanation)
    truth = SHARED / "campaigns" / "truth" / f"{name}.json"
    tool = [sys.executable, str(SHARED / "tools" / "score.py"), str(file), str(truth)]
    scored = subprocess.run(tool, capture_output=True, text=True, check=False)
    assert scored.returncode == 0, scored.stdout
    if explanation.verdict is Verdict.EXPLAINED:
        assert explanation.chi2_per_dof.after is not None
        assert explanation.chi2_per_dof.after < 1.1
    true = json.loads(truth.read_text())
    if explanation.verdict in (Verdict.EXPLAINED, Verdict.NOTHING_MISSING):
        for name_, value in zip(explanation.parameters, [*true["s"], *true["I"]], strict=True):
            parameter = explanation.parameters[name_]
            assert abs(parameter.value - value) < 4 * parameter.sd, name_
