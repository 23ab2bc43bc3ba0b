"""`fidim export`: other programs read back what was recorded and identified; nothing unfinished passes for a window."""

import json
import subprocess
import sys
import tomllib

import mujoco
import numpy as np
import pandas as pd
import pytest
import scipy.io

import fidim_lab.data
from fidim_lab.app.cli import run
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Role, Window

MASS = 11.98
BODY = Body(np.array([0.012, -0.031, 0.19]), np.array([0.071, 0.078, 0.033, 0.0021, -0.0042, 0.0057]))


@pytest.fixture
def folder(irma4, tmp_path):
    rng = np.random.default_rng(1)
    series = [np.round(rng.uniform(0.5, 3.0, size=(50, 4)), 4) for _ in range(2)]
    markers = np.round(rng.normal(size=(50, 1, 3)), 6)
    markers[3] = np.nan
    window = Window("i01", Role.IDENTIFY, np.arange(50) / 100.0, markers, *series, np.array([1.0, 2.0, 3.0]))
    write_campaign(tmp_path / "c", Campaign("c", irma4, 100.0, (window,)))
    return tmp_path / "c"


@pytest.fixture
def result(tmp_path):
    parameters = {
        name: {"value": float(value), "sd": 1e-5, "nominal": 0.0}
        for name, value in zip(PARAMETER_NAMES, BODY.vector, strict=True)
    }
    table = {
        **{"format": "fidim-result/1", "campaign": "a--b", "method": "mle", "outcome": "converged", "message": ""},
        **{"parameters": parameters, "non_essential": [], "sigma_W": None, "C": 8.4, "windows": [], "seconds": 1.0},
    }
    path = tmp_path / "result.json"
    path.write_text(json.dumps(table))
    return path


def test_parquet_is_the_table_of_load(folder):
    assert run(["export", str(folder), "--to", "parquet"]) == 0
    table = pd.read_parquet(folder / "export" / "c.parquet")
    pd.testing.assert_frame_equal(table, fidim_lab.data.load(folder).to_frame(), check_dtype=False)


def test_matlab(folder, tmp_path):
    assert run(["export", str(folder), "--to", "mat", "--out", str(tmp_path / "c.mat")]) == 0
    found = scipy.io.loadmat(tmp_path / "c.mat", simplify_cells=True)
    window = found["windows"]
    made = read_campaign(folder).windows[0]
    assert (window["id"], window["role"], found["sample_rate"]) == ("i01", "identify", 100.0)
    assert np.array_equal(window["markers"].reshape(50, 3), made.markers[:, 0], equal_nan=True)
    assert np.array_equal(window["currents"], made.currents)


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_a_campaign_in_the_other_form(folder, tmp_path, kind):
    assert run(["export", str(folder), "--to", kind, "--out", str(tmp_path / "d")]) == 0
    assert (tmp_path / "d" / "windows" / f"i01.{kind}").exists()
    one, other = (read_campaign(place).windows[0] for place in (folder, tmp_path / "d"))
    assert np.array_equal(one.markers, other.markers, equal_nan=True)
    assert np.array_equal(one.lengths, other.lengths)


def test_unfinished_windows_are_apart_and_called_so(folder, tmp_path, capsys):
    assert run(["export", str(folder), "--to", "mcap", "--out", str(tmp_path / "m")]) == 0
    whole = (tmp_path / "m" / "windows" / "i01.mcap").read_bytes()
    (folder / "rejected").mkdir()
    (folder / "rejected" / "i02-unfinished1.mcap.part").write_bytes(whole[:-50])
    (folder / "rejected" / "i02-unfinished1.csv.part").write_text("the same")
    (folder / "windows" / "i03.csv.part").write_text("t,x,y,z\n0.00,1,2,3\n0.01,1,2")
    (folder / "windows" / "i04.mcap.part").write_bytes(whole[:20])
    assert run(["export", str(folder), "--to", "csv", "--out", str(tmp_path / "d"), "--unfinished"]) == 0
    said = capsys.readouterr().err
    assert said.count("incomplete") == 3
    left = tmp_path / "d-unfinished"
    assert (left / "windows-i03.csv").read_text() == "t,x,y,z\n0.00,1,2,3\n"
    assert sorted(p.name for p in left.iterdir()) == ["rejected-i02-unfinished1.csv", "windows-i03.csv"]
    assert [w.id for w in read_campaign(tmp_path / "d").windows] == ["i01"]


def body_of(model, data):
    """Mass, centre of mass and inertia about it in the body frame, as MuJoCo has them."""
    (number,) = [k for k in range(model.nbody) if model.body_mass[k] > 0]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[number])
    turn = turn.reshape(3, 3)
    return model.body_mass[number], model.body_ipos[number], turn @ np.diag(model.body_inertia[number]) @ turn.T


@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
def test_mujoco_loads_the_identified_body(result, tmp_path, kind):
    out = tmp_path / ("body.urdf" if kind == "urdf" else "body.xml")
    assert run(["export", str(result), "--to", kind, "--mass", str(MASS), "--out", str(out)]) == 0
    text = out.read_text()
    if kind == "urdf":  # MuJoCo welds a URDF's root to the world: hang it on a joint
        joint = '<link name="w"/><joint name="j" type="floating"><parent link="w"/><child link="platform"/></joint>'
        text = text.replace("</robot>", joint + "</robot>")
    model = mujoco.MjModel.from_xml_string(text)
    mass, com, inertia = body_of(model, mujoco.MjData(model))
    assert mass == pytest.approx(MASS)
    assert com == pytest.approx(BODY.com, abs=1e-12)
    assert inertia == pytest.approx(MASS * BODY.inertia_about_com, abs=1e-9)


def test_python_and_toml(result, tmp_path):
    assert run(["export", str(result), "--to", "python", "--mass", str(MASS)]) == 0
    code = (tmp_path / "export" / "result.py").read_text() + "print(J[0, 2], s[1], sd['I_yz'])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert [float(v) for v in told] == pytest.approx([MASS * BODY.inertia_about_com[0, 2], BODY.com[1], 1e-5])
    assert run(["export", str(result), "--to", "toml"]) == 0
    table = tomllib.loads((tmp_path / "export" / "result.toml").read_text())
    assert table["parameters"]["s_z"] == {"value": 0.19, "sd": 1e-5, "nominal": 0.0, "seen": True}


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["RESULT", "--to", "urdf"], 2, "Give --mass KG"),
        (["RESULT", "--to", "csv"], 2, "takes a campaign folder"),
        (["FOLDER", "--to", "mjcf", "--mass", "1"], 2, "takes a result file"),
        (["FOLDER", "--to", "csv", "--out", "FOLDER"], 2, "exists already"),
        (["FOLDER/none", "--to", "csv"], 2, "no such folder"),
    ],
)
def test_wrong_use(folder, result, capsys, arguments, code, says):
    typed = [a.replace("RESULT", str(result)).replace("FOLDER", str(folder)) for a in arguments]
    assert run(["export", *typed]) == code
    assert says in capsys.readouterr().err


def test_an_explanation_by_itself_is_refused_with_what_it_lacks(tmp_path, capsys):
    path = tmp_path / "explanation.json"
    path.write_text('{"format": "fidim-explanation/1"}')
    assert run(["export", str(path), "--to", "mjcf"]) == 2
    assert "--campaign FOLDER" in capsys.readouterr().err


def test_what_lies_near_is_named(folder, result, tmp_path, capsys):
    inside = folder / "result.json"
    inside.write_text(result.read_text())
    assert run(["export", str(folder), "--to", "urdf"]) == 2
    assert str(inside) in capsys.readouterr().err.replace("\n", "")
    assert run(["export", str(inside), "--to", "csv"]) == 2
    assert f"It lies in one: {folder}." in capsys.readouterr().err.replace("\n", "")
    assert run(["identify", str(inside)]) == 2
    assert f"Campaign folders near it: {folder}." in capsys.readouterr().err.replace("\n", "")
    assert run(["identify", str(folder.parent)]) == 2
    assert f"Campaign folders near it: {folder}." in capsys.readouterr().err.replace("\n", "")


def test_an_inertia_that_no_body_has_is_refused(result, tmp_path, capsys):
    table = json.loads(result.read_text())
    table["parameters"]["I_xx"]["value"] = 0.9
    result.write_text(json.dumps(table))
    assert run(["export", str(result), "--to", "mjcf", "--mass", "2"]) == 1
    assert "no rigid body has them" in capsys.readouterr().err
    assert not (tmp_path / "export").exists()
