"""A laboratory without cameras: swivel encoders and inclinometer simulated, the body identified, the truth known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.data.campaign import read_campaign, write_campaign
from fidim_lab.data.records import PARAMETER_NAMES

pytestmark = pytest.mark.slow

OWN = ("s1", "s2", "s3", "s4", "incl_x", "incl_y", "incl_z")


@pytest.fixture(scope="module")
def dark(irma4_file: Path, tmp_path_factory) -> Path:
    """A campaign with own sensors whose cameras saw nothing."""
    folder = tmp_path_factory.mktemp("own")
    size = ("--equilibria", "4", "--validate", "1", "--seed", "4")
    assert cli.run(["simulate", "--robot", str(irma4_file), "--out", str(folder / "seen"), "--own-sensors", *size]) == 0
    campaign = read_campaign(folder / "seen")
    assert set(OWN) <= set(campaign.windows[0].further)
    windows = tuple(replace(w, markers=np.full_like(w.markers, np.nan), equilibrium=None) for w in campaign.windows)
    write_campaign(folder / "dark", replace(campaign, windows=windows))
    (folder / "dark" / "truth.json").write_text((folder / "seen" / "truth.json").read_text())
    return folder / "dark"


def test_the_truth_is_found_without_cameras(dark, tmp_path, capsys):
    asked = ["identify", str(dark), "--pose-from", "swivel", "--json", str(tmp_path / "result.json")]
    assert cli.run(asked) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Poses come from swivel angles, lengths and inclination" in said
    assert "Something is missing" not in said
    assert "robot file says" not in said
    truth = json.loads((dark / "truth.json").read_text())
    found = json.loads((tmp_path / "result.json").read_text())["parameters"]
    error = np.array([found[name]["value"] for name in PARAMETER_NAMES]) - [*truth["s"], *truth["I"]]
    sd = np.array([found[name]["sd"] for name in PARAMETER_NAMES])
    assert np.abs(error / sd).max() < 5  # noise lies in the free directions alone, by up to √3 more than stated
    assert np.abs(error[:3]).max() < 2e-4
    assert np.abs(error[3:]).max() < 2e-4


def test_markers_that_are_missing_are_asked_for_in_words(dark, capsys):
    assert cli.run(["identify", str(dark)]) == 1
    assert "0 samples hold a marker" in " ".join(capsys.readouterr().err.split())
