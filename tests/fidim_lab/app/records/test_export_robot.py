"""The whole robot for other programs: MuJoCo swings as we predict, the module of functions says what the model says."""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pytest

from fidim_lab.app.cli import run
from fidim_lab.app.compose.multibody import replay_rms
from fidim_lab.app.records.export_robot import robot_mjcf, robot_model, start_of
from fidim_lab.app.records.mjcf_effects import TERMS
from fidim_lab.app.report.contents.found_model import Model
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Motion
from fidim_lab.effects.cables.cable_mass import SwivelInertia
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.dissipation.drag import (
    AirDragLinear,
    AirDragQuadratic,
    RotationalDrag,
    RotationalDragPerAxis,
    RotationalDragQuadratic,
)
from fidim_lab.effects.dissipation.pulley_friction import SwivelDamping, SwivelFriction
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.loads.constant_force import BodyForce, ConstantForce
from fidim_lab.effects.loads.umbilical import Umbilical
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.dynamics import accelerations

OFF = {"dx": 0.006, "dy": -0.003, "dz": 0.002}
HIDDEN = "anchor-offset:cable=2," + ",".join(f"{name}={value}" for name, value in OFF.items())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign with an anchor off, and an explanation that says so."""
    path = tmp_path_factory.mktemp("export") / "off"
    few = ["--equilibria", "1", "--validate", "2"]
    assert run(["simulate", "--robot", "irma4", "--out", str(path), "--hide", HIDDEN, *few]) == 0
    campaign = read_campaign(path)
    told = [e for e in by_id(campaign.robot, "anchor-offset", 2) if {p.name for p in e.parameters} == set(OFF)]
    values = {p.name: {"value": OFF[p.name], "sd": 1e-4, "unit": p.unit} for p in told[0].parameters}
    _explain(path, campaign, [{"id": "anchor-offset", "cable": 2, "parameters": values, "says": told[0].says}])
    return path


def _explain(folder: Path, campaign: Campaign, effects: list[dict[str, Any]], name: str = "explanation.json") -> None:
    truth = json.loads((folder / "truth.json").read_text())
    body = dict(zip(PARAMETER_NAMES, [*truth["s"], *truth["I"]], strict=True))
    parameters = {key: {"value": value, "sd": 1e-5, "nominal": 0.0} for key, value in body.items()}
    nothing = {"before": None, "after": None}
    table = {
        "format": "fidim-explanation/1",
        "campaign": "off",
        "verdict": "explained",
        "effects": effects,
        "where": [],
        "held_out": {"chi2_per_dof": nothing, "rms_mm": nothing},
        "ranking": [],
        "parameters": parameters,
        "parameters_before": parameters,
        "next_experiment": None,
        "message": "",
    }
    (folder / name).write_text(json.dumps(table))


def _export(folder: Path, kind: str, out: Path, *more: str, name: str = "explanation.json") -> int:
    arguments = [str(folder / name), "--to", kind, "--campaign", str(folder), "--out", str(out), *more]
    return run(["export", *arguments])


def _model(campaign: Campaign, folder: Path) -> tuple[Mechanism, np.ndarray]:
    told = json.loads((folder / "explanation.json").read_text())
    effect = next(e for e in by_id(campaign.robot, "anchor-offset", 2) if {p.name for p in e.parameters} == set(OFF))
    theta = [OFF[p.name] for p in effect.parameters]
    body = [told["parameters"][name]["value"] for name in PARAMETER_NAMES]
    return Mechanism(campaign.robot, (effect,), theta, native=True), np.array([*body, *theta])


def test_mujoco_swings_through_a_held_out_window_as_we_predict(folder: Path, tmp_path: Path) -> None:
    assert _export(folder, "mjcf", tmp_path / "robot.xml", "--window", "v02") == 0
    campaign = read_campaign(folder)
    mechanism, shared = _model(campaign, folder)
    window = next(one for one in campaign.windows if one.id == "v02")
    ours = held_out.predict(mechanism, shared, prepare(window, campaign.robot), campaign.robot.sensors).remainder
    assert ours.rms < 1.2e-4  # the model is right: noise is left

    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    places = []
    for t in ours.t - ours.t[0]:
        while data.time < t - 1e-9:
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        places.append(data.site_xpos[model.site("marker0").id].copy())
    apart = np.array(places) - ours.predicted[:, 0]
    assert np.ptp(places, axis=0).max() > 0.02  # it does swing
    assert np.sqrt(np.nanmean(apart**2)) < 1e-4  # 0.01 mm here; 1 mm is what is promised


def test_the_functions_say_what_the_model_says(folder: Path, tmp_path: Path) -> None:
    assert _export(folder, "python", tmp_path / "robot.py", "--mass", "12.5") == 0
    module = _imported(tmp_path / "robot.py")
    campaign = read_campaign(folder)
    mechanism, shared = _model(campaign, folder)
    body = Body.from_vector(shared[:9])
    lengths = np.array([1.42, 1.40, 1.45, 1.47])
    rest = pose_from_lengths(mechanism, body, lengths)
    position, rotation, tensions = module.rest(lengths)
    np.testing.assert_allclose(position, rest.pose.position, atol=1e-9)
    np.testing.assert_allclose(rotation, rest.pose.rotation, atol=1e-9)
    np.testing.assert_allclose(tensions, rest.tensions_in_newton(12.5), rtol=1e-8)
    np.testing.assert_allclose(module.cables(position, rotation)[0], lengths, atol=1e-9)

    free = np.linalg.svd(module.structure(position, rotation))[2][-2:]
    twist = free.T @ [0.3, -0.5]
    motion = Motion(np.zeros(1), position[None], rotation[None], twist[None], np.zeros((1, 6)))
    ours, held = accelerations(mechanism, body, motion)
    acceleration, tensions = module.zero_dynamics(position, rotation, twist)
    np.testing.assert_allclose(acceleration, ours[0], atol=1e-6)
    np.testing.assert_allclose(tensions, 12.5 * held[0], atol=1e-5)
    with pytest.raises(ValueError, match=r"lengths, one a cable, has the shape \(4,\); found \(3,\)"):
        module.rest(lengths[:3])
    with pytest.raises(ValueError, match=r"a twist has the shape \(6,\); found \(3,\)"):
        module.zero_dynamics(position, rotation, twist[:3])
    with pytest.raises(ValueError, match=r"a rotation matrix has the shape \(3, 3\); found \(4,\)"):
        module.rest(lengths, near=(position, np.zeros(4)))
    with pytest.raises(ValueError, match="no rest"):
        module.rest(np.array([9.0, 0.4, 0.4, 0.4]))


def test_the_geometry_that_a_fit_left_open_is_exported(folder: Path, tmp_path: Path) -> None:
    campaign = read_campaign(folder)
    _explain(folder, campaign, [], "open.json")
    told = json.loads((folder / "open.json").read_text())
    moved = [{"what": "anchor", "cable": 2, "by": [*OFF.values()], "sd": 3 * [1e-4]}]
    (folder / "open.json").write_text(json.dumps({**told, "geometry": {"chi2_gain": 9.0, "moved": moved}}))
    assert _export(folder, "python", tmp_path / "moved.py", name="open.json") == 0
    anchors = np.array([cable.d for cable in campaign.robot.cables])
    anchors[1] += [*OFF.values()]
    np.testing.assert_allclose(_imported(tmp_path / "moved.py").D, anchors, atol=1e-12)


def test_gravity_that_is_tilted_is_exported(folder: Path, tmp_path: Path) -> None:
    tilt = {"rx": {"value": 0.01, "sd": 1e-4, "unit": "rad"}, "ry": {"value": 0.0, "sd": 1e-4, "unit": "rad"}}
    _explain(folder, read_campaign(folder), [{"id": "gravity-tilt", "parameters": tilt}], "tilt.json")
    assert _export(folder, "python", tmp_path / "tilted.py", name="tilt.json") == 0
    expected = 9.81 * np.array([0.0, np.sin(0.01), -np.cos(0.01)])
    np.testing.assert_allclose(_imported(tmp_path / "tilted.py").GRAVITY, expected, atol=1e-6)


def test_what_cannot_be_exported_is_told(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lay = {"c": {"value": 0.001, "sd": 1e-5, "unit": "m"}}
    _explain(folder, read_campaign(folder), [{"id": "lay-torque", "parameters": lay}], "lay.json")
    for arguments, said in (
        (("mjcf", tmp_path / "a.xml"), "no term for lay-torque"),
        (("urdf", tmp_path / "a.urdf"), "mjcf and python can"),
    ):
        assert _export(folder, *arguments, name="lay.json") == 2
        assert said in capsys.readouterr().err
    assert _export(folder, "mjcf", tmp_path / "a.xml", "--window", "v99") == 2
    assert "there are i01, v01" in capsys.readouterr().err
    assert run(["export", str(folder / "lay.json"), "--to", "mjcf", "--window", "v01"]) == 2
    assert "--window needs --campaign" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


LOUD: tuple[tuple[tuple[NamedEffect, tuple[float, ...]], ...], ...] = (
    (
        (AirDragLinear(), (0.4,)),
        (RotationalDragPerAxis(), (0.05, 0.01, 0.1)),
        (ConstantForce(), (1.0, 0.5, -2.0)),
        (Umbilical(), (5.0, 0.3, 4.0, 2.0, 10.0, 0.05, -0.03, 0.1)),
    ),
    (
        (AirDragQuadratic(), (1.0,)),
        (RotationalDragQuadratic(), (0.05,)),
        (BodyForce(), (1.0, 0.5, -1.0, 0.1, 0.05, -0.1)),
        (SwivelDamping(cable=2), (0.05,)),
    ),
    ((RotationalDrag(), (0.02,)), (SwivelFriction(), (0.01,)), (SwivelInertia(cable=3), (0.005,))),
)


def test_every_effect_with_a_term_is_tried() -> None:
    assert {type(effect) for effects in LOUD for effect, _ in effects} == set(TERMS)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("effects", LOUD)
def test_mujoco_feels_the_effects_that_were_named(
    effects: tuple[tuple[NamedEffect, tuple[float, ...]], ...], folder: Path, tmp_path: Path
) -> None:
    told = [
        {
            "id": effect.id,
            **({} if effect.cable is None else {"cable": effect.cable}),
            "says": effect.says,
            "parameters": {
                p.name: {"value": value, "sd": 1e-3, "unit": p.unit}
                for p, value in zip(effect.parameters, values, strict=True)
            },
        }
        for effect, values in effects
    ]
    campaign = read_campaign(folder)
    _explain(folder, campaign, told, "named.json")
    answer = tmp_path / "answer.json"
    more = ("--json", str(answer), "--mass", str(1.5 * campaign.robot.mass))  # the motion is the same at any mass
    assert _export(folder, "mjcf", tmp_path / "named.xml", *more, name="named.json") == 0
    assert json.loads(answer.read_text())["replay_rms"] < 1e-4  # m; 0.003 mm here; 1 mm is what is promised

    model = robot_model(folder / "named.json", campaign)
    start = start_of(model, campaign, None)
    without = Model(Mechanism(campaign.robot, native=True), model.shared[:9])
    rms = replay_rms(robot_mjcf(without, start, campaign.robot.mass, ""), start.t, start.marker)
    assert rms is not None
    assert rms > 3e-4  # they are to be felt


def test_without_mujoco_it_is_said_that_nothing_was_replayed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert _export(folder, "mjcf", tmp_path / "robot.xml") == 0
    assert "not replayed: MuJoCo is not installed here" in capsys.readouterr().out


def _imported(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
