"""`fidim identify A B` as a user meets it, in a simulated world of one platform on three and on two cables."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.records import Body, Campaign, Robot, Role, Survey, Window
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.results.result_file import read_result
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

Capsys = pytest.CaptureFixture[str]
EXTRA = (np.array([0.15, 0.1, 0.1]), np.array([-0.1, 0.14, 0.12]))


def recorded(robot: Robot, body: Body, k: int, t: np.ndarray) -> Window:
    """One window from a rest with lengths drawn at random; the last one is held out."""
    mechanism, random = Mechanism(robot), np.random.default_rng(10 * robot.n + k)
    while True:
        lengths = random.uniform(1.25, 1.55, robot.n)
        try:
            rest = pose_from_lengths(mechanism, body, lengths)
        except InfeasibleError:
            continue
        xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        free = np.linalg.svd(xi)[2][robot.n :].T
        found = simulate_free_motion(mechanism, body, rest.pose, free @ np.full(free.shape[1], 0.2), t)
        if found.slack_time is None:
            break
    places = found.motion.positions[:, None] + np.einsum("nij,mj->nmi", found.motion.rotations, robot.markers)
    places = places + robot.sensors.marker_noise * random.standard_normal(places.shape)
    role = Role.VALIDATE if k == 3 else Role.IDENTIFY
    return Window(f"w{k + 1}", role, t, places, np.tile(lengths, (len(t), 1)), None)


@pytest.fixture(scope="module")
def folders(irma4: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    body = Body(irma4.nominal.com + np.array([0.003, -0.004, 0.006]), irma4.nominal.inertia)
    folder, found = tmp_path_factory.mktemp("joint"), list[str]()
    for n, which in ((3, (0, 1, 2)), (2, (0, 2))):
        cables = tuple(irma4.cables[k] for k in which)
        robot = replace(irma4, cables=cables, extra_markers=EXTRA, survey=Survey.alike(n, 1e-3, 0.5e-3))
        windows = tuple(recorded(robot, body, k, np.arange(201) / 100) for k in range(4))
        write_campaign(folder / f"on-{n}", Campaign(f"on-{n}", robot, 100.0, windows))
        found.append(str(folder / f"on-{n}"))
    return found[0], found[1]


@pytest.mark.slow
def test_two_campaigns_give_one_body(
    folders: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer, page = tmp_path / "joint.json", tmp_path / "joint.html"
    assert cli.run(["identify", *folders, "--json", str(answer), "--report", str(page)]) == 0
    shown = capsys.readouterr().out
    assert "6 windows of 2 campaigns" in shown
    assert "on-3" in shown
    table = read_result(answer)
    assert table.joint is not None
    assert table.joint.campaigns == ("on-3", "on-2")
    assert {(one.fitted, one.predicted) for one in table.joint.cross} == {
        (("on-2",), "on-3"),
        (("on-3",), "on-2"),
        (("on-3", "on-2"), "on-3"),
        (("on-3", "on-2"), "on-2"),
    }
    assert [w.id for w in table.windows if w.role is Role.VALIDATE] == ["on-3/w4", "on-2/w4"]
    assert all(w.chi2_per_dof is not None and w.chi2_per_dof < 1.5 for w in table.windows)
    assert table.geometry is not None
    assert sum(one.what == "anchor" for one in table.geometry.moved) == 3
    html = page.read_text(encoding="utf-8")
    assert "predicted on others" in html
    assert "on-3 + on-2" in html


def test_the_joint_body_can_be_validated(folders: tuple[str, str], tmp_path: Path) -> None:
    answer = tmp_path / "joint.json"
    assert cli.run(["identify", *folders, "--json", str(answer)]) == 0
    assert json.loads(answer.read_text(encoding="utf-8"))["format"] == "fidim-result/1"
    assert cli.run(["validate", folders[0], "--parameters", str(answer), "--limit", "1000"]) == 0


def test_options_for_one_campaign_are_refused_with_several(
    folders: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["identify", *folders, "--method", "tls"]) == 2
    assert "--method cannot be used with a second campaign" in capsys.readouterr().err


def test_one_campaign_twice_is_refused(folders: tuple[str, str], capsys: Capsys) -> None:
    assert cli.run(["identify", folders[0], folders[0]]) == 2
    assert "on-3, on-3" in capsys.readouterr().err
