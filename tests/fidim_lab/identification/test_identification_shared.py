"""Campaigns of an independent simulator whose answers are known (../shared/campaigns), and a real robot's recording."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.identification.identify import identify
from fidim_lab.identification.motion.recipe import BEST, PAPER
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.identification.results.validation import QUICK, THOROUGH

pytestmark = pytest.mark.shared


def truth(shared: Path, name: str) -> np.ndarray:
    table = json.loads((shared / "campaigns" / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    return np.array([*table["s"], *table["I"]])


def errors(shared: Path, name: str, found: IdentificationResult) -> tuple[np.ndarray, np.ndarray]:
    """Of s in mm, and of I_xx, I_yy, I_zz in percent."""
    true = truth(shared, name)
    off = found.body.vector - true
    return np.abs(off[:3]) * 1e3, np.abs(off[3:6] / true[3:6]) * 100


# What is hidden there hardly touches the regression: error of s in mm, of the moments in percent. One of them shows in
# what is left of the motion.
HARMLESS = {
    "open-nothing-left-out": (0.1, 0.2),
    "open-air-drag": (0.05, 0.15),
    "open-periodic-force": (0.3, 0.3),
    "open-swivel-friction": (0.3, 0.3),
    "open-outside-catalogue": (0.4, 0.4),
    "open-two-at-once": (0.1, 0.1),
}


@pytest.mark.parametrize("name", HARMLESS)
@pytest.mark.sampled(1)
def test_parameters_come_back(shared, name):
    found = identify(read_campaign(shared / "campaigns" / name), checks=QUICK)
    com, inertia = errors(shared, name, found)
    seen = name == "open-outside-catalogue"
    assert found.outcome is (ResultOutcome.MISFIT if seen else ResultOutcome.CONVERGED)
    assert com.max() < HARMLESS[name][0]
    assert inertia.max() < HARMLESS[name][1]
    assert found.noise_ratio is not None
    assert found.noise_ratio < 1.5


@pytest.mark.sampled(1)
@pytest.mark.parametrize("name", ["open-anchor-moved", "open-elastic-cables"])
def test_wrong_geometry_is_said_and_not_hidden_in_small_numbers(shared, name):
    found = identify(read_campaign(shared / "campaigns" / name), checks=QUICK)
    assert found.noise_ratio is not None
    assert found.noise_ratio > 2
    text = " ".join(found.warnings)
    assert "not as the robot file says" in text
    assert "times what marker noise explains" in text
    com, _ = errors(shared, name, found)
    assert com.max() > 5  # the warning is deserved


@pytest.mark.slow
def test_the_papers_form_is_ten_times_worse_on_the_null_campaign(shared):
    campaign = read_campaign(shared / "campaigns" / "open-nothing-left-out")
    ours, papers = (identify(campaign, recipe=recipe, checks=QUICK) for recipe in (BEST, PAPER))
    our_com, our_inertia = errors(shared, "open-nothing-left-out", ours)
    com, inertia = errors(shared, "open-nothing-left-out", papers)
    assert com.max() > 10 * our_com.max()
    assert inertia.max() > 10 * our_inertia.max()
    assert com.max() < 6  # and yet it works: the prototype's 0.03–1.2 mm is its order


def test_short_windows_still_identify(shared):
    """2.5 s of each window: what a real robot gives between two pushes."""
    campaign = read_campaign(shared / "campaigns" / "open-air-drag")
    short = []
    for window in campaign.windows:
        use = window.t < 2.5
        lengths = None if window.lengths is None else window.lengths[use]
        short.append(replace(window, t=window.t[use], markers=window.markers[use], lengths=lengths, currents=None))
    found = identify(replace(campaign, windows=tuple(short)), checks=QUICK)
    com, inertia = errors(shared, "open-air-drag", found)
    assert com.max() < 1.0
    assert inertia.max() < 1.5


@pytest.mark.slow
def test_identified_parameters_predict_held_out_trajectories(shared):
    campaign = read_campaign(shared / "campaigns" / "open-nothing-left-out")
    found = identify(campaign, checks=THOROUGH)
    held_out = [w.rms_mm for w in found.windows if w.role.value == "validate" and w.rms_mm is not None]
    assert len(held_out) == 6
    assert np.median(held_out) < 0.2
    assert max(held_out) < 1.5
