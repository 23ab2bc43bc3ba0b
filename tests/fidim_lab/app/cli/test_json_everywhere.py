"""Every command whose answer a program may want has `--json`, and writes one object with its format."""

import json
from pathlib import Path

import click
import numpy as np
import pytest

from fidim_lab.app.cli import fidim, run
from fidim_lab.app.formats.answer_file import write_answer, write_summary
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Role, Window
from fidim_lab.errors import SetupError

ROOT = Path(__file__).parents[4]
WITHOUT = {"simulators", "ui"}
"""they have no answer: they go on until they are left"""
LENGTHS = np.array([1.30283, 1.39119, 1.52772, 1.41231])


def _commands():
    for name, command in fidim.commands.items():
        inner = command.commands.items() if isinstance(command, click.Group) else [(name, command)]
        yield from (one for one in inner if name not in WITHOUT)


@pytest.mark.parametrize(("name", "command"), list(_commands()), ids=lambda one: one if isinstance(one, str) else "")
def test_every_command_with_an_answer_has_json(name, command):
    assert any("--json" in parameter.opts for parameter in command.params), name


def test_a_stop_tells_programs_that_nothing_was_running(tmp_path, monkeypatch):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    assert run(["stop", "--json", str(tmp_path / "a.json")]) == 1
    assert json.loads((tmp_path / "a.json").read_text()) == {"format": "fidim-stop/1", "exit_code": 1, "services": []}


def test_a_listing_has_every_step_with_its_time(tmp_path):
    window = PlannedWindow("i01", Role.IDENTIFY, LENGTHS, np.array([0.02, 0.03]), np.array([1.11, -0.27, -0.31]))
    write_plan(tmp_path / "plan.toml", Plan("one", (window,)))
    rig = ROOT / "examples" / "rigs" / "simulated.toml"
    answer = tmp_path / "a.json"
    assert run(["run", str(tmp_path / "plan.toml"), "--rig", str(rig), "--list", "--json", str(answer)]) == 0
    told = json.loads(answer.read_text())
    assert told["format"] == "fidim-listing/1"
    assert told["windows"] == ["i01"]
    assert "Record" in [step["step"] for step in told["steps"]]
    assert told["seconds"] == pytest.approx(sum(step["seconds"] for step in told["steps"]))


def test_an_export_tells_where_it_is(tmp_path, irma4):
    t = np.arange(0.0, 1.0, 0.01)
    window = Window("i01", Role.IDENTIFY, t, np.zeros((100, 1, 3)), np.tile(LENGTHS, (100, 1)), None)
    write_campaign(tmp_path / "c", Campaign("c", irma4, 100.0, (window,)))
    assert run(["export", str(tmp_path / "c"), "--to", "parquet", "--json", str(tmp_path / "a.json")]) == 0
    told = json.loads((tmp_path / "a.json").read_text())
    assert Path(told["path"]).stat().st_size > 1000


def test_a_summary_is_that_of_the_folder_and_none_is_no_error(tmp_path):
    write_summary(tmp_path / "a.json", tmp_path, 3)
    assert json.loads((tmp_path / "a.json").read_text())["exit_code"] == 3
    (tmp_path / "summary.json").write_text('{"format": "fidim-summary/1", "reason": "all is well", "exit_code": 0}')
    write_summary(tmp_path / "a.json", tmp_path, 0)
    assert json.loads((tmp_path / "a.json").read_text())["reason"] == "all is well"
    write_summary(None, tmp_path / "absent", 0)


def test_an_answer_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(SetupError, match="cannot be written"):
        write_answer(tmp_path / "absent" / "a.json", "x/1", {})
