"""`fidim simulate` as it is typed: what it writes, what it refuses, and that nothing half-made is left behind."""

import importlib.util
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.app.analysis import simulate as command
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import Role
from fidim_lab.data.robot_file import write_robot
from fidim_lab.identification.random_plan import Taste, random_plan
from sim_backends.plant.motion import SlackInterval
from sim_backends.plant.sensors import Noise
from sim_backends.simulate import MILD, Sampling, simulate_campaign

SMALL = ("--equilibria", "1", "--validate", "1")


@pytest.fixture(scope="module")
def robot_file(irma4_file: Path) -> str:
    return str(irma4_file)


@pytest.fixture(scope="module")
def simulated(robot_file, tmp_path_factory) -> Path:
    """A campaign of two whole windows with two effects hidden."""
    out = tmp_path_factory.mktemp("simulated") / "camp"
    hide = ("--hide", "air-drag-linear:c=0.4", "--hide", "anchor-offset:cable=2,dx=0.006")
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL, *hide, "--seed", "9"]) == 0
    return out


@pytest.fixture
def short(monkeypatch):
    """Windows of half a second, where what is in them does not matter."""
    monkeypatch.setattr(command, "Sampling", partial(Sampling, duration=0.5))
    monkeypatch.setattr(
        command, "random_plan", lambda *args, **named: random_plan(*args, **(named | {"taste": Taste(seconds=1.0)}))
    )


def test_the_folder_is_a_campaign_with_truth_and_plan(simulated: Path):
    campaign = read_campaign(simulated)
    assert campaign.name == "camp"
    assert [w.role for w in campaign.windows].count(Role.VALIDATE) == 1
    for window in campaign.windows:
        assert window.duration == pytest.approx(10.0)
        assert window.lengths is not None
        assert window.currents is not None
        moved = window.markers[:, 0] - window.equilibrium
        assert 0.015 < np.linalg.norm(moved, axis=1).max() < 0.2
    planned = read_plan(simulated / "plan.toml", campaign.robot.n)
    assert [w.id for w in planned.windows] == [w.id for w in campaign.windows]
    truth = json.loads((simulated / "truth.json").read_text())
    assert truth["case"]["label"] == ["air-drag-linear", "anchor-offset"]
    assert truth["case"]["cable"] == 2
    assert truth["case"]["par"]["anchor-offset"]["dx"] == 0.006
    assert (truth["seed"], truth["backend"], truth["marker_noise"]) == (9, "native", 1e-4)
    assert truth["s"][2] != pytest.approx(campaign.robot.nominal.com[2], rel=0.01)
    # the robot file says what is known, not what is true
    assert campaign.robot.cables[1].d[0] == 2.295
    assert sorted(p.name for p in simulated.parent.iterdir()) == ["camp"]


@pytest.mark.shared
def test_the_truth_has_the_layout_of_the_known_campaigns(simulated: Path, shared: Path):
    truth = json.loads((simulated / "truth.json").read_text())
    known = json.loads((shared / "campaigns" / "truth" / "open-anchor-moved.json").read_text())
    assert set(known) <= set(truth)
    assert {"title", "label", "cable"} <= set(truth["case"])
    assert [np.shape(truth[key]) for key in "sI"] == [np.shape(known[key]) for key in "sI"]


@pytest.mark.usefixtures("short")
def test_the_same_seed_writes_the_same_bytes(robot_file, tmp_path):
    def files(name: str, seed: str) -> dict[str, bytes]:
        out = tmp_path / name / "camp"
        assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL, "--seed", seed]) == 0
        return {str(p.relative_to(out)): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()}

    first, second, other = files("a", "3"), files("b", "3"), files("c", "4")
    assert sorted(first) == [
        "campaign.toml",
        "plan.toml",
        "robot.toml",
        "truth.json",
        "windows/i01.csv",
        "windows/v01.csv",
    ]
    assert first == second
    assert first["windows/i01.csv"] != other["windows/i01.csv"]


@pytest.mark.usefixtures("short")
def test_the_table_says_what_is_hidden_and_what_to_type_next(robot_file, tmp_path, capsys):
    out = tmp_path / "camp[1]"
    hide = ["--hide", "swivel-friction:c=0.02"]
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL, *hide]) == 0
    shown, progress = capsys.readouterr()
    assert "Simulated campaign camp[1]" in shown
    assert "i01" in shown
    assert "swivel-friction (c = 0.02 N m)" in shown
    assert f"next        fidim identify {out}" in shown
    assert "planning" in progress
    assert "simulating: 2 windows" in progress
    assert "planning" not in shown


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(("given", "declared", "spread"), [("0.002", 2e-3, 2e-3), ("0", 1e-4, 0.0)])
def test_noise_is_what_is_asked_for_and_declared(given, declared, spread, robot_file, tmp_path):
    loud, silent = tmp_path / "loud", tmp_path / "silent"
    for out, noise in ((loud, given), (silent, "0")):
        assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL, "--noise", noise]) == 0
    assert read_campaign(loud).robot.sensors.marker_noise == declared
    pairs = zip(read_campaign(loud).windows, read_campaign(silent).windows, strict=True)
    difference = np.concatenate([(a.markers - b.markers).ravel() for a, b in pairs])
    assert np.std(difference) == pytest.approx(spread, rel=0.2, abs=1e-9)


@pytest.mark.usefixtures("short")
def test_an_empty_folder_is_filled(robot_file, tmp_path, monkeypatch):
    out = tmp_path / "there"
    out.mkdir()
    monkeypatch.chdir(out)
    assert cli.run(["simulate", "--robot", robot_file, "--out", ".", *SMALL]) == 0
    assert read_campaign(out).name == "there"


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.sampled(1)
def test_other_numbers_of_cables(n, cable_ring, tmp_path):
    write_robot(tmp_path / "robot.toml", cable_ring(n))
    out = tmp_path / "camp"
    assert cli.run(["simulate", "--robot", str(tmp_path / "robot.toml"), "--out", str(out), *SMALL]) == 0
    window = read_campaign(out).windows[0]
    assert window.lengths is not None
    assert window.lengths.shape[1] == n
    assert window.currents is None  # the robot file has no [winch]


@pytest.mark.usefixtures("short")
@pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="MuJoCo is not installed")
def test_both_backends_tell_the_same(robot_file, tmp_path):
    for backend in ("native", "mujoco"):
        options = ["--backend", backend, "--noise", "0", "--hide", "rotational-drag", *SMALL]
        assert cli.run(["simulate", "--robot", robot_file, "--out", str(tmp_path / backend), *options]) == 0
    pairs = zip(read_campaign(tmp_path / "native").windows, read_campaign(tmp_path / "mujoco").windows, strict=True)
    for native, other in pairs:
        np.testing.assert_allclose(other.markers, native.markers, atol=5e-5)
        np.testing.assert_array_equal(other.lengths, native.lengths)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--hide", "gremlins"], r"no effect is called 'gremlins'.*air-drag-linear"),
        (["--hide", "air-drag-linear:k=1"], r"'k=1' is not one of its keys.*Allowed: c"),
        (["--hide", "air-drag-linear:c"], r"the key c has no value.*Write c=NUMBER"),
        (["--hide", "anchor-offset:cable=7"], r"cables 1 to 4"),
        (["--seed", "-1"], r"--seed.*-1 is not in the range"),
        (["--noise", "-1"], r"--noise"),
        (["--backend", "mujoco", "--hide", "cable-elasticity"], r"cannot simulate it.*It can hide"),
        (["--backend", "bullet"], r"bullet"),
        (["--robot", "nowhere.toml"], r"nowhere\.toml"),
    ],
)
def test_wrong_use_ends_with_2_and_writes_nothing(options, says, robot_file, tmp_path, capsys):
    out = tmp_path / "camp"
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL, *options]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert re.search(says, error), error
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_something_in_it_is_left_alone(robot_file, tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("keep")
    for out in (tmp_path, tmp_path / "mine.txt"):
        assert cli.run(["simulate", "--robot", robot_file, "--out", str(out), *SMALL]) == 2
        assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "mine.txt").read_text() == "keep"


def test_a_place_that_cannot_be_written_is_named_before_any_work(robot_file, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(tmp_path / "file" / "camp"), *SMALL]) == 2
    shown = capsys.readouterr().err
    assert "cannot be written: Not a directory" in shown
    assert "planning" not in shown


def test_a_full_disk_leaves_no_half_campaign(robot_file, tmp_path, capsys, short, monkeypatch):
    def full(path, plan):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(command, "write_plan", full)
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(tmp_path / "camp"), *SMALL]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_ends_with_130_and_leaves_nothing(robot_file, tmp_path, monkeypatch):
    def interrupted(*args, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "simulate_campaign", interrupted)
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(tmp_path / "camp"), *SMALL]) == 130
    assert list(tmp_path.iterdir()) == []


def test_a_robot_that_cannot_swing_is_refused(irma4, tmp_path, capsys):
    heavy = replace(irma4, mass=75.0)
    write_robot(tmp_path / "robot.toml", heavy)
    options = ["--robot", str(tmp_path / "robot.toml"), "--out", str(tmp_path / "camp")]
    assert cli.run(["simulate", *options, "--equilibria", "1", "--validate", "0"]) == 1
    assert "Only 0 of 1 equilibria were found" in capsys.readouterr().err
    assert not (tmp_path / "camp").exists()


@pytest.mark.parametrize(
    "beyond",
    [{"slack": (SlackInterval(3, 1.0, 1.1),)}, {"tension": (19.0, 150.0)}, {"tension": (30.0, 201.0)}],
    ids=["slack", "under", "over"],
)
def test_a_window_beyond_the_tension_limits_is_recorded_again_displaced_less(
    beyond, robot_file, tmp_path, capsys, monkeypatch
):
    plans = []

    def once_beyond(robot, plan, world, rng, noise: Noise, recording: Sampling, *, platform, watch):
        plans.append(plan)
        first = len(plans) == 1

        def see(recorded):
            within = {"slack": (), "tension": (30.0, 150.0)}
            watch(replace(recorded, **within | (beyond if first and recorded.window.id == "i01" else {})))

        return simulate_campaign(
            robot, plan, world, rng, noise, replace(recording, duration=0.5), platform=platform, watch=see
        )

    monkeypatch.setattr(command, "simulate_campaign", once_beyond)
    assert cli.run(["simulate", "--robot", robot_file, "--out", str(tmp_path / "camp"), *SMALL]) == 0
    assert "tensions leave their limits in i01; recorded again" in " ".join(capsys.readouterr().err.split())
    before, after = ({w.id: w.displacement for w in plan.windows} for plan in plans)
    np.testing.assert_allclose(after["i01"], MILD * before["i01"])
    np.testing.assert_array_equal(after["v01"], before["v01"])
    np.testing.assert_allclose(
        read_plan(tmp_path / "camp" / "plan.toml", 4).windows[0].displacement, after["i01"], atol=1e-5
    )


def test_a_given_plan_that_leaves_the_limits_is_recorded_as_it_is_and_said(robot_file, irma4, tmp_path, capsys):
    wide = random_plan(irma4, "wide", 1, 0, 11, Taste(amplitudes=(0.08,), tight=2.0, taut=0.05))
    write_plan(tmp_path / "plan.toml", wide)
    out = tmp_path / "camp"
    options = ["--out", str(out), "--plan", str(tmp_path / "plan.toml"), "--json", str(tmp_path / "a.json")]
    assert cli.run(["simulate", "--robot", robot_file, *options]) == 0
    assert "tensions leave 20 to 200 N in i01: Eq. 42 does not hold there" in " ".join(capsys.readouterr().out.split())
    (window,) = json.loads((tmp_path / "a.json").read_text())["windows"]
    assert window["tension"][0] < 20.0 or window["tension"][1] > 200.0
    np.testing.assert_allclose(
        read_plan(out / "plan.toml", 4).windows[0].displacement, wide.windows[0].displacement, atol=1e-5
    )


def test_help_has_an_example(capsys):
    assert cli.run(["simulate", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "fidim simulate --robot robot.toml --out swivels --hide swivel-friction" in shown
    assert "--backend [native|mujoco]" in shown
