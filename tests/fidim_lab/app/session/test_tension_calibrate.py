"""`fidim tension-calibrate` on an open campaign: numbers near the robot file's, lines for the rig file, JSON."""

import json
from pathlib import Path

import pytest

from fidim_lab.app import cli
from fidim_lab.data.campaign import read_campaign

CAMPAIGN = Path(__file__).parents[5] / "shared" / "campaigns" / "open-nothing-left-out"


@pytest.mark.shared
@pytest.mark.skipif(not CAMPAIGN.is_dir(), reason="the shared campaigns are not beside this checkout")
def test_an_open_campaign(tmp_path, capsys):
    file = tmp_path / "tension.json"
    code = cli.run(["tension-calibrate", str(CAMPAIGN), "--json", str(file)])
    said = capsys.readouterr().out
    winches = json.loads(file.read_text())["winches"]
    assert code == (1 if any(winch["problem"] for winch in winches) else 0)
    wanted = [winch.newton_per_ampere for winch in read_campaign(CAMPAIGN).robot.winches]
    for winch, gain in zip(winches, wanted, strict=True):
        if not winch["problem"]:
            assert winch["gain"] == pytest.approx(gain, abs=4.0 * winch["sd_gain"])
            assert f"gain = {winch['gain']:.2f}" in said
        else:
            assert winch["problem"] in said.replace("\n", " ")


def test_no_campaign_is_a_sentence(tmp_path, capsys):
    assert cli.run(["tension-calibrate", str(tmp_path / "none")]) == 2
    assert "no such folder" in capsys.readouterr().err
