"""A rate that no column of times contradicts: gravity does."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Robot
from fidim_lab.data.robot_file import write_robot

MARKERS = np.array([[0.01, 0.0, 0.2], [0.21, 0.03, 0.215], [-0.185, 0.1, 0.2], [0.035, -0.095, 0.275]])
"""m, on the platform"""


@pytest.fixture(scope="module")
def swinging(irma4: Robot, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Four windows at 100 Hz."""
    folder = tmp_path_factory.mktemp("rates")
    write_robot(folder / "robot.toml", replace(irma4, marker=MARKERS[0], extra_markers=tuple(MARKERS[1:])))
    asked = ["--robot", str(folder / "robot.toml"), "--out", str(folder / "true"), "--equilibria", "4"]
    assert CliRunner().invoke(fidim, ["simulate", *asked, "--validate", "0"]).exit_code == 0
    return read_campaign(folder / "true")


def as_nexus_writes_it(folder: Path, campaign: Campaign, rate: int) -> list[str]:
    """Arguments that import it."""
    write_robot(folder / "robot.toml", campaign.robot)
    names = [f"Frame:{k}" for k in "PQRS"]
    for window in campaign.windows:
        head = ["Trajectories", str(rate), ",," + ",,,".join(names), "Frame,Sub Frame" + ",X,Y,Z" * 4, "," + ",mm" * 12]
        rows = [
            f"{k + 311},0," + ",".join(f"{1e3 * value:.6g}" for value in sample.ravel())
            for k, sample in enumerate(window.markers)
        ]
        (folder / f"{window.id}.csv").write_text("\n".join([*head, *rows]), encoding="utf-8")
    out = ["--robot", str(folder / "robot.toml"), "--out", str(folder / "out")]
    return ["import", "vicon-csv", str(folder / "*.csv"), *out]


@pytest.mark.parametrize("options", [[], ["--rate", "100"]])
def test_the_right_rate_is_not_questioned(swinging: Campaign, tmp_path: Path, options: list[str]):
    done = CliRunner().invoke(fidim, [*as_nexus_writes_it(tmp_path, swinging, 100), *options])
    assert done.exit_code == 0
    assert len(read_campaign(tmp_path / "out").windows) == 4


@pytest.mark.parametrize(
    ("header", "options"), [(160, []), (50, []), (100, ["--rate", "50"]), (100, ["--rate", "150"])]
)
def test_a_wrong_rate_is_refused_with_the_right_one(
    swinging: Campaign, tmp_path: Path, header: int, options: list[str]
):
    done = CliRunner().invoke(fidim, [*as_nexus_writes_it(tmp_path, swinging, header), *options])
    said = " ".join(done.output.split())
    assert done.exit_code == 1
    assert "the right rate with --rate" in said
    assert 85 < float(re.findall(r"at about ([0-9.]+) Hz", said)[0]) < 120
    assert not (tmp_path / "out" / "campaign.toml").exists()
