"""`fidim init`: what it writes has every key of the reader, is read back by it, and overwrites nothing."""

import json
import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.app.doctor.checks import CheckVerdict
from fidim_lab.app.doctor.rig_doctor import check_reach
from fidim_lab.app.doctor.robot_plausibility import plausibility
from fidim_lab.app.formats.key_words import known_keys
from fidim_lab.data.campaign import CampaignTable, read_campaign
from fidim_lab.data.plan_file import PlanTable, read_plan
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.rigs.rig_tables import RigTable
from fidim_lab.data.robot_file import RobotTable, read_robot, write_robot
from fidim_lab.errors import SetupError
from fidim_lab.identification.design.task import DesignTask

MODELS = {"robot": RobotTable, "rig": RigTable, "plan": PlanTable, "campaign": CampaignTable}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one of each kind, for a robot of three cables."""
    folder = tmp_path_factory.mktemp("written")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert cli.run(["init", "robot", "--cables", "3"]) == 0
        assert cli.run(["init", "rig", "--out", "rigs/rig.toml"]) == 0
        assert cli.run(["init", "plan", "--robot", "robot.toml"]) == 0
        assert cli.run(["init", "campaign", "--out", "takes"]) == 0
    return folder


@pytest.fixture
def files(written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """A copy of those, in the test's own folder."""
    shutil.copytree(written, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    names = {"robot": "robot.toml", "rig": "rigs/rig.toml", "plan": "plan.toml", "campaign": "takes/campaign.toml"}
    return {kind: tmp_path / name for kind, name in names.items()}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", MODELS)
def test_every_key_of_the_reader_is_in_the_file_and_no_other(kind: str, files: dict[str, Path]) -> None:
    wanted = _reader_keys(MODELS[kind])
    found = _file_keys(files[kind].read_text(encoding="utf-8"), MODELS[kind])
    assert {table: sorted(keys) for table, keys in found.items()} == {t: sorted(k) for t, k in wanted.items() if k}


@pytest.mark.parametrize("kind", MODELS)
def test_no_words_are_kept_for_keys_that_are_gone(kind: str) -> None:
    wanted = {(table, key) for table, keys in _reader_keys(MODELS[kind]).items() for key in keys}
    guards = {("guards", key) for table, key in wanted if table.endswith("GuardTable")}
    assert known_keys(kind) <= wanted | guards


def test_the_readers_read_what_was_written(files: dict[str, Path]) -> None:
    robot = read_robot(files["robot"])
    assert robot.n == 3
    rig = read_rig(files["rig"])
    assert rig.robot_path.resolve() == files["robot"].resolve()
    assert [winch.name for winch in rig.winches] == ["winch 1", "winch 2", "winch 3"]
    plan = read_plan(files["plan"], 3)
    assert [window.id for window in plan.windows] == ["i01", "i02", "v01"]
    campaign = read_campaign(files["campaign"].parent)
    window = campaign.windows[0]
    assert window.lengths is not None
    assert window.equilibrium is not None
    np.testing.assert_allclose(window.markers[:, 0], np.tile(window.equilibrium, (len(window.t), 1)), atol=1e-4)


@pytest.mark.parametrize("cables", [2, 3, 4, 5])
def test_the_new_robot_is_plausible(cables: int, tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    assert cli.run(["init", "robot", "--out", str(path), "--cables", str(cables)]) == 0
    assert all(finding.ok for finding in plausibility(read_robot(path)))


@pytest.mark.parametrize("cables", [2, 3, 4, 5])
def test_a_new_plan_names_the_step_that_works_for_its_robot(
    cables: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["init", "robot", "--cables", str(cables)]) == 0
    assert cli.run(["init", "plan"]) == 0
    said, robot = (tmp_path / "plan.toml").read_text(encoding="utf-8"), read_robot(tmp_path / "robot.toml")
    if "fidim design --robot robot.toml" in said:
        assert DesignTask(robot).robot.n == cables
        return
    assert "fidim dry-run --robot robot.toml --out rehearsal" in said
    with pytest.raises(SetupError, match="fidim dry-run --robot"):
        DesignTask(robot)


def test_a_simulated_rig_names_local_devices(files: dict[str, Path], tmp_path: Path) -> None:
    assert cli.run(["init", "rig", "--out", "sim.toml", "--simulated", "--json", "said.json"]) == 0
    rig = read_rig(tmp_path / "sim.toml")
    assert rig.hand is not None
    assert rig.bus.channel.startswith("socket://127.0.0.1")
    assert json.loads((tmp_path / "said.json").read_text())["next"] == "fidim simulators sim.toml"


@pytest.mark.parametrize("size", [0.4, 3.0])
def test_a_rig_has_room_for_a_robot_of_any_size(files: dict[str, Path], tmp_path: Path, size: float) -> None:
    robot = read_robot(files["robot"])
    anchors = tuple(replace(cable, d=size * cable.d, a=size * cable.a) for cable in robot.cables)
    write_robot(tmp_path / "other.toml", replace(robot, cables=anchors))
    assert cli.run(["init", "rig", "--robot", "other.toml", "--out", "other-rig.toml"]) == 0
    assert {check.verdict for check in check_reach(read_rig(tmp_path / "other-rig.toml"))} == {CheckVerdict.OK}


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["robot"], "robot.toml exists already"),
        (["campaign", "--out", "takes"], "exists already"),
        (["plan", "--out", "p.toml", "--simulated"], "--simulated needs rig"),
        (["rig", "--out", "p.toml", "--cables", "3"], "--cables cannot be used with rig"),
        (["robot", "--out", "p.toml", "--robot", "robot.toml"], "--robot cannot be used with robot"),
        (["robots"], "is not one of"),
        (["robot", "--out", "p.toml", "--cables", "6"], "six cables or more and held motors a platform cannot swing"),
        (["robot", "--out", "p.toml", "--cables", "1"], "docs/pendulums.md"),
    ],
)
def test_nothing_is_overwritten_and_wrong_use_is_said(
    arguments: list[str], said: str, files: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    before = {kind: path.read_bytes() for kind, path in files.items()}
    assert cli.run(["init", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert {kind: path.read_bytes() for kind, path in files.items()} == before


def test_without_a_robot_file_it_is_said_how_to_get_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["init", "rig"]) == 2
    assert "fidim init robot" in capsys.readouterr().err


def _reader_keys(model: Any) -> dict[str, set[str]]:
    """Table → its keys that are no tables, from the JSON schema of the whole file."""
    schema = model.model_json_schema()
    tables = {model.__name__: schema} | schema.get("$defs", {})
    own = {
        name: {key for key, field in table["properties"].items() if not _leads_to_table(field, schema)}
        for name, table in tables.items()
        if "properties" in table
    }
    own[model.__name__].discard("every_winch")
    return own


def _leads_to_table(field: dict[str, Any], schema: dict[str, Any]) -> bool:
    return any("properties" in schema["$defs"][name] for name in re.findall(r"#/\$defs/(\w+)", json.dumps(field)))


def _file_keys(text: str, model: Any) -> dict[str, set[str]]:
    """Table → keys in the file, those that are commented out included."""
    active = re.sub(r"(?m)^#(?=\[|\w+ = )", "", text)
    schema = model.model_json_schema()
    found: dict[str, set[str]] = {}
    _walk(tomllib.loads(active), schema, model.__name__, schema, found)
    return found


def _walk(table: dict[str, Any], own: Any, name: str, schema: Any, found: dict[str, set[str]]) -> None:
    for key, value in table.items():
        field = own["properties"][key]
        if key == "every_winch":
            _walk(value, schema["$defs"]["RigWinchTable"], "RigWinchTable", schema, found)
        elif _leads_to_table(field, schema):
            inner = next(n for n in re.findall(r"#/\$defs/(\w+)", json.dumps(field)))
            for one in value if isinstance(value, list) else [value]:
                _walk(one, schema["$defs"][inner], inner, schema, found)
        else:
            found.setdefault(name, set()).add(key)
