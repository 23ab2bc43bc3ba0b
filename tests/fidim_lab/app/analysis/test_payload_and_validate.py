"""`fidim identify --payload`, `--paper` and `fidim validate` as a user meets them, in a simulated world."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import Body, Robot
from fidim_lab.identification.payload_mass import Payload
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.identification.results.result_file import read_result
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

PAYLOAD = Payload(1.0, np.array([0.12, -0.15, 0.05]))
WITH_PAYLOAD = ["--mass", "1.000", "--at", "0.12,-0.15,0.05"]


@dataclass(frozen=True)
class Pair:
    """Two campaign folders of one platform, without and with the payload."""

    empty: Path
    loaded: Path
    mass: float


def loaded(body: Body, mass: float, payload: Payload) -> Body:
    """The platform with a point of mass added, from both masses' moments (Eq. 23)."""
    x, y, z = payload.at
    point = np.array([x, y, z, y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
    return Body.from_vector((mass * body.vector + payload.mass * point) / (mass + payload.mass))


@pytest.fixture(scope="module")
def pair(irma4: Robot, tmp_path_factory: pytest.TempPathFactory) -> Pair:
    folder = tmp_path_factory.mktemp("pair")
    plan = random_plan(irma4, "pair", 6, 1, 3)
    world = make_world(irma4, np.random.default_rng(3))
    heavier = replace(world, mass=world.mass + 1.0, body=loaded(world.body, world.mass, PAYLOAD))
    for name, true in (("empty", world), ("loaded", heavier)):
        campaign, _ = simulate_campaign(irma4, plan, true, np.random.default_rng(4), recording=Sampling(6.0))
        write_campaign(folder / name, replace(campaign, name=name))
    return Pair(folder / "empty", folder / "loaded", world.mass)


def run(*arguments: object) -> int:
    return cli.run([str(argument) for argument in arguments])


@pytest.mark.sampled(1)
def test_what_was_added_is_found(pair: Pair, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = read_campaign(pair.loaded)
    write_campaign(tmp_path / "loaded", replace(campaign, robot=replace(campaign.robot, mass=pair.mass + 1.0)))
    bare = read_campaign(pair.empty)
    write_campaign(tmp_path / "empty", replace(bare, robot=replace(bare.robot, mass=pair.mass)))
    path = tmp_path / "result.json"
    assert run("identify", tmp_path / "loaded", "--tare", tmp_path / "empty", "--json", path, "--method", "mle") == 0
    assert "What was added: 1 kg" in capsys.readouterr().out
    tare = read_result(path).tare
    assert tare is not None
    for name, true in zip(("s_x", "s_y", "s_z"), PAYLOAD.at, strict=True):
        one = tare.parameters[name]
        assert one.value is not None
        assert one.sd is not None
        assert abs(one.value - true) < 4 * one.sd
        assert one.sd < 0.02


@pytest.mark.sampled(1)
def test_tare_of_nothing_added_is_refused(pair: Pair) -> None:
    assert run("identify", pair.loaded, "--tare", pair.empty, "--method", "iv") == 2


@pytest.mark.parametrize("method", ["tls", "iv"])
@pytest.mark.sampled(1)
def test_the_mass_is_found(pair: Pair, method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "result.json"
    arguments = ["identify", pair.empty, "--payload", pair.loaded, *WITH_PAYLOAD, "--method", method, "--json", path]
    assert run(*arguments) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "The platform's mass is" in said
    assert "z of the centre of mass" in said
    mass = json.loads(path.read_text())["mass"]
    assert abs(mass["value"] - pair.mass) < 4 * mass["sd"]
    assert mass["sd"] < 0.03 * pair.mass
    assert mass["nominal"] == 11.0
    assert mass["payload"] == {
        "campaign": "loaded",
        "mass": 1.0,
        "mass_sd": 0.0,
        "at": [0.12, -0.15, 0.05],
        "at_sd": 0.0,
    }
    read = read_result(path)
    assert read.campaign == "empty"
    assert read.mass is not None
    assert read.mass.value == mass["value"]


@pytest.mark.slow
def test_without_payload_a_result_has_no_key_more(pair: Pair, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    assert run("identify", pair.empty, "--method", "tls", "--json", path) == 0
    assert "mass" not in json.loads(path.read_text())
    assert read_result(path).mass is None


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["--mass", "1"], 2, "--mass: only with --payload"),
        (["--payload", "EMPTY"], 2, "needs --mass KG and --at"),
        (["--payload", "EMPTY", "--mass", "0", "--at", "0,0,1"], 2, "0.0 is not in the range x>0"),
        (["--payload", "EMPTY", "--mass", "1", "--at", "0,0"], 2, "three numbers X,Y,Z"),
        (["--payload", "EMPTY", "--mass", "1", "--at", "0,zero,1"], 2, "three numbers X,Y,Z"),
        (["--payload", "EMPTY", "--mass", "1", "--at", "120,-150,50"], 2, "metres are expected"),
        (["--payload", "nowhere", "--mass", "1", "--at", "0,0,0.1"], 2, "no such folder"),
        (["--payload", "EMPTY", "--mass", "1", "--at", "0,0,-0.1"], 1, "does not show the mass"),
        (["--paper", "--method", "iv"], 2, "cannot be used with --method iv"),
    ],
)
@pytest.mark.sampled(6)
def test_what_does_not_go_together_is_said(
    pair: Pair, arguments: list[str], code: int, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(pair.empty) if a == "EMPTY" else a for a in arguments]
    method = [] if "--method" in given else ["--method", "tls"]
    assert run("identify", pair.empty, *given, *method) == code
    assert says in capsys.readouterr().err


@pytest.mark.slow
def test_a_payload_at_the_centre_of_mass_is_refused(pair: Pair, capsys: pytest.CaptureFixture[str]) -> None:
    at = "0,0,0.19"  # where CAD says that it is; the second campaign is the same platform again
    arguments = ["identify", pair.empty, "--payload", pair.empty, "--mass", "1", "--at", at, "--method", "tls"]
    assert run(*arguments) == 1
    assert "from the platform's centre of mass" in capsys.readouterr().err


def test_two_robots_are_refused(pair: Pair, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    campaign = read_campaign(pair.loaded)
    cables = campaign.robot.cables
    moved = replace(cables[1], d=cables[1].d + 0.002)
    other = replace(campaign, robot=replace(campaign.robot, cables=(cables[0], moved, *cables[2:])))
    write_campaign(tmp_path / "other", other)
    assert run("identify", pair.empty, "--payload", tmp_path / "other", *WITH_PAYLOAD, "--method", "tls") == 2
    assert "d of cable 2 differs by 0.002" in capsys.readouterr().err


@pytest.mark.slow
def test_the_papers_form_is_shown_beside_two_others(pair: Pair, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("identify", pair.empty, "--paper") == 0
    said = capsys.readouterr().out
    assert "Total least squares in three forms" in said
    assert "columns of norm 1" in said
    [sigma_W] = [line for line in said.splitlines() if line.startswith("│ σ_W ")]
    assert "–" not in sigma_W  # all three forms are total least squares
    assert "free" in said  # the windows' poses come from x, y and lengths


@pytest.fixture(scope="module")
def result_file(pair: Pair, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("result") / "result.json"
    assert run("identify", pair.empty, "--method", "iv", "--json", path) == 0
    return path


@pytest.mark.slow
def test_good_parameters_are_confirmed(
    pair: Pair, result_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "validation.json"
    assert run("validate", pair.empty, "--parameters", result_file, "--json", out) == 0
    assert "predict the one window" in " ".join(capsys.readouterr().out.split())
    table = json.loads(out.read_text())
    assert table["format"] == "fidim-validation/1"
    assert table["predicts"] is True
    [window] = table["windows"]
    assert window["id"] == "v01"
    assert window["chi2_per_dof"] == pytest.approx(1.0, abs=0.2)
    assert window["rms_mm"] == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_parameters_of_another_body_are_not(
    pair: Pair, result_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "validation.json"
    assert run("validate", pair.loaded, "--parameters", result_file, "--all", "--json", out) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "do not predict" in said
    assert "Rule: a window is predicted when" in said
    table = json.loads(out.read_text())
    assert table["predicts"] is False
    assert len(table["windows"]) == 7
    assert any(w["why"] for w in table["windows"])


def test_a_result_for_another_robot_is_doubted(
    pair: Pair, result_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = json.loads(result_file.read_text())
    table["parameters"]["s_z"]["nominal"] = 0.25
    other = tmp_path / "other.json"
    other.write_text(json.dumps(table))
    assert run("validate", pair.empty, "--parameters", other) == 0
    assert "other nominal values (s_z)" in " ".join(capsys.readouterr().err.split())


def test_wrong_use_of_validate(pair: Pair, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("validate", pair.empty) == 2
    assert run("validate", pair.empty, "--parameters", tmp_path / "none.json") == 2
    assert "no such file" in capsys.readouterr().err
