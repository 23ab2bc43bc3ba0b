"""Physics that one campaign showed predicts windows of the same platform: `fidim explain`, then `fidim validate`."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import fidim_lab as fl
from fidim_lab.app.analysis import simulate as command
from fidim_lab.app.cli import run
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Role
from sim_backends.simulate import Sampling

HIDDEN = "air-drag-linear:c=0.5"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A platform in air, two campaigns of it; what identify and explain say of the first."""
    folder = tmp_path_factory.mktemp("world")
    whole = folder / "whole"
    sizes = ["--equilibria", "4", "--validate", "4"]
    assert run(["simulate", "--robot", "irma4", "--out", str(whole), "--hide", HIDDEN, *sizes]) == 0
    recorded = read_campaign(whole)
    held = recorded.of_role(Role.VALIDATE)
    for name, windows in (("one", (*recorded.of_role(Role.IDENTIFY), *held[:2])), ("other", held[2:])):
        write_campaign(folder / name, replace(recorded, name=name, windows=windows))
    assert run(["explain", str(folder / "one"), "--json", str(folder / "explanation.json")]) == 0
    run(["identify", str(folder / "one"), "--json", str(folder / "result.json")])
    return folder


def _validate(world: Path, parameters: Path, *more: str) -> int:
    return run(["validate", str(world / "other"), "--parameters", str(parameters), *more])


@pytest.mark.slow
def test_the_effects_that_were_named_predict_another_campaign(world: Path, tmp_path: Path) -> None:
    assert _validate(world, world / "explanation.json", "--json", str(tmp_path / "v.json")) == 0
    told = json.loads((tmp_path / "v.json").read_text())
    assert told["predicts"]
    assert all(0.7 < window["chi2_per_dof"] < 1.4 for window in told["windows"])
    assert all(window["sigma_perp"] is None for window in told["windows"])
    assert _validate(world, world / "result.json") == 1  # the body alone does not


@pytest.mark.slow
def test_python_takes_the_answer_itself(world: Path) -> None:
    other = fl.load(world / "other")
    assert fl.validate(other, world / "explanation.json").predicts
    assert fl.validate(other, fl.explain(world / "one")).predicts


def test_unknown_physics_predicts_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign, file = tmp_path / "other", tmp_path / "explanation.json"
    sizes = ["--equilibria", "2", "--validate", "1"]
    assert run(["simulate", "--robot", "irma4", "--out", str(campaign), *sizes]) == 0
    assert run(["explain", str(campaign), "--json", str(file)]) == 0
    told = json.loads(file.read_text())
    (tmp_path / "unknown.json").write_text(json.dumps({**told, "verdict": "unknown-physics", "effects": []}))
    assert _validate(tmp_path, tmp_path / "unknown.json") == 2
    assert "names no physics" in " ".join(capsys.readouterr().err.split())


def test_a_load_put_on_in_the_session_is_named_and_its_windows_are_predicted_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The body told is that without the load: another campaign has it, this one its own in each window."""
    monkeypatch.setattr(command, "Sampling", partial(Sampling, duration=6.0))
    campaign, file = tmp_path / "loaded", tmp_path / "explanation.json"
    hidden = ["--hide", "body-step:m=0.15,at=230", "--equilibria", "6", "--validate", "3"]
    assert run(["simulate", "--robot", "irma4", "--out", str(campaign), *hidden]) == 0
    assert run(["explain", str(campaign), "--json", str(file), "--report", str(tmp_path / "report.html")]) == 0
    told = json.loads(file.read_text())
    (step,) = told["effects"]
    assert (told["verdict"], step["id"], step["single"]) == ("explained", "body-step", True)
    order = [window.id for window in read_campaign(campaign).windows]
    assert step["windows"] == {id: float(k >= 4) for k, id in enumerate(order)}
    assert told["held_out"]["rms_mm"]["after"] < 0.11 < told["held_out"]["rms_mm"]["before"]
    assert "a load of" in " ".join(capsys.readouterr().out.split())
    assert run(["validate", str(campaign), "--all", "--parameters", str(file)]) == 0
    truth = json.loads((campaign / "truth.json").read_text())
    s_z = told["parameters"]["s_z"]
    assert abs(s_z["value"] - truth["s"][2]) < 4 * s_z["sd"]
