"""`fidim design` as a user meets it: the files it leaves, what takes them, and refusals in words."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from fidim_lab.app.cli import fidim, run
from fidim_lab.data.plan_file import read_plan
from fidim_lab.errors import SetupError
from fidim_lab.identification.design import search

QUICK = ["--equilibria", "2", "--samples", "20", "--starts", "1", "--processes", "1"]


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("design")
    done = CliRunner().invoke(fidim, ["design", *QUICK, "--out", str(folder / "d"), "--json", str(folder / "d.json")])
    assert done.exit_code == 0, done.output
    assert "predicted sd" in done.output
    return folder


def test_files_and_formats(designed: Path):
    told = json.loads((designed / "d.json").read_text())
    assert told == json.loads((designed / "d" / "design.json").read_text())
    assert told["format"] == "fidim-design/1"
    assert told["criterion"] == "C"
    assert {"C", "starts", "seconds", "equilibria", "predicted_sd"} <= set(told)
    plan = read_plan(designed / "d" / "plan.toml", 4)
    for window, row in zip(plan.windows, told["equilibria"], strict=True):
        assert window.lengths == pytest.approx(row["lengths"], abs=1e-5)
        assert window.displacement == pytest.approx(row["displacement"], abs=1e-5)
    assert (designed / "d" / "equilibria.svg").read_text().startswith("<?xml")


def test_simulate_takes_the_plan(designed: Path, irma4_file: Path):
    plan, out = str(designed / "d" / "plan.toml"), str(designed / "campaign")
    done = CliRunner().invoke(fidim, ["simulate", "--robot", str(irma4_file), "--plan", plan, "--out", out])
    assert done.exit_code == 0, done.output
    assert len(list((designed / "campaign" / "windows").iterdir())) == 2


def test_a_folder_with_files_is_left_alone(designed: Path):
    done = CliRunner().invoke(fidim, ["design", *QUICK, "--out", str(designed / "d")])
    assert isinstance(done.exception, SetupError)
    assert "is not empty" in done.exception.message


@pytest.mark.slow
def test_a_plan_for_winches(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(search, "FOR_EACH_BY_WINCHES", 2)
    out = tmp_path / "d"
    given = ["--by-winches", "--winch-acceleration", "4", "--damping", "0.03", "--out", str(out)]
    done = CliRunner().invoke(fidim, ["design", *QUICK, *given])
    assert done.exit_code == 0, done.output
    assert "mm in their reach" in done.output
    assert "--procedure excite --unattended" in done.output
    plan = read_plan(out / "plan.toml", 4)
    assert plan.name == "design-C-by-winches"
    assert all(0.001 < max(map(abs, window.displacement)) < 0.05 for window in plan.windows)


@pytest.mark.parametrize("option", ["--damping=0.05", "--winch-speed=0.3", "--winch-acceleration=4"])
def test_what_only_winches_ask_for_is_not_ignored(option: str):
    done = CliRunner().invoke(fidim, ["design", *QUICK, option])
    assert done.exit_code == 2
    assert f"{option.split('=')[0]} needs --by-winches" in done.output


def test_a_study_for_winches_is_refused(tmp_path: Path):
    done = CliRunner().invoke(fidim, ["design", *QUICK, "--study", "--by-winches"])
    assert isinstance(done.exception, SetupError)
    assert "--by-winches designs one plan" in done.exception.message


def test_what_means_nothing_after_a_session_is_not_ignored(tmp_path: Path):
    (tmp_path / "explanation.json").write_text("{}")
    given = ["--after", str(tmp_path / "explanation.json"), "--seed", "2", "--by-winches", "--starts", "3", "--study"]
    done = CliRunner().invoke(fidim, ["design", *given])
    assert done.exit_code == 2
    assert "--starts, --by-winches, --study cannot be used with --after. Allowed with it: --campaign, " in done.output
    done = CliRunner().invoke(fidim, ["design", "--campaign", str(tmp_path)])
    assert done.exit_code == 2
    assert "--campaign needs --after" in done.output


WRONG_ROBOTS = {
    "millimetres": ("marker = [0.0, 0.0, 0.0]", "marker = [0.0, 0.0, 190.0]", 2, "units: Platform, marker holds 190"),
    "pulleys": ("radius = 0.025", "radius = 0.9", 2, "units: Cable 1, radius is 0.9 m."),
    "body": ("[0.051, 0.069, 0.037,", "[0.051, 0.069, 0.9,", 2, "body: No body has these parameters"),
    "grams": ("mass = 11.0", "mass = 1100.0", 2, "weight: 1100 kg weigh 10791.0 N"),
    "limits": ("[20.0, 200.0]", "[46.0, 48.0]", 1, "before its limits are changed. rest: At none of 8 depths"),
}


@pytest.mark.parametrize("case", WRONG_ROBOTS)
@pytest.mark.sampled(1)
def test_a_wrong_robot_file_is_blamed_before_its_limits(irma4_file: Path, tmp_path: Path, capsys, case: str):
    right, wrong, code, says = WRONG_ROBOTS[case]
    assert right in irma4_file.read_text()
    (tmp_path / "robot.toml").write_text(irma4_file.read_text().replace(right, wrong))
    assert run(["design", "--robot", str(tmp_path / "robot.toml"), *QUICK]) == code
    said = capsys.readouterr().err
    assert "robot.toml" in said
    assert says in said
    assert "Widen" not in said


@pytest.mark.slow
def test_an_unusual_robot_is_designed_for_with_a_warning(irma4_file: Path, tmp_path: Path, capsys):
    text = irma4_file.read_text().replace("[0.051, 0.069, 0.037,", "[0.561, 0.759, 0.407,")
    (tmp_path / "robot.toml").write_text(text)
    assert run(["design", "--robot", str(tmp_path / "robot.toml"), *QUICK]) == 0
    said = capsys.readouterr()
    assert "looks like kg m²: divide it by 11" in " ".join((said.out + said.err).split())
