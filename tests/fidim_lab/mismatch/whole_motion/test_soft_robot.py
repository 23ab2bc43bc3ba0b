"""Robots whose cables hold one direction hardly at all: the same search, on elastic cables."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fidim_lab.app.records.import_recording import run_import
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Body, Campaign, Robot
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.identification.choice import soft_mode
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.whole_motion.common_part import elastic
from fidim_lab.mismatch.whole_motion.search import search

DISSIPATION = ("rotational-drag", "attachment-friction", "swivel-friction", "air-drag-linear")


@pytest.mark.slow
def test_what_dissipates_is_found_beside_cables_that_are_springs(
    recorded_on_springs: Callable[..., tuple[Campaign, Body]], irma4: Robot
):
    others = {effect.id for effect in catalogue(irma4)} - {*DISSIPATION}
    hidden = ["cable-elasticity:k=4e4", "rotational-drag:c=0.012"]
    campaign, _ = recorded_on_springs(irma4, hidden, meeting=0.1, seconds=2.0, places=(0, 1, 4))
    softness = soft_mode(campaign)
    assert softness is not None
    common = elastic(campaign, softness)
    assert CableStiffness() in common.nuisances
    assert not {effect.id for effect in common.found.likelihood.mechanism.effects} & {*DISSIPATION}  # pyright: ignore
    assert softness in common.sentences[0]
    outcome = search(campaign, common, Budget(), lambda _: None, without=others)
    assert [term.effect.id for term in outcome.best.terms] == ["rotational-drag"]
    assert outcome.best.held_out < 0.5 * outcome.base.held_out
    assert outcome.best.chi2_per_dof < 2.0
    found = outcome.best.found
    assert found.values[-1] == pytest.approx(0.012, abs=3 * found.sd[-1])
    assert not outcome.rivals[0]


@pytest.mark.slow
@pytest.mark.shared
def test_of_the_recording_of_irma4u_dissipation_is_named_as_a_class(shared: Path, tmp_path: Path):
    made = run_import("irma4u", [shared / "recordings/irma4u"], tmp_path / "c")
    told = explain(read_campaign(made.folder))
    assert told.verdict is Verdict.PARTLY_EXPLAINED
    assert [cause.id for cause in told.effects] == ["attachment-friction"]
    assert "rotational-drag" in told.effects[0].equivalent_to
    assert not told.effects[0].single
    assert told.rms_mm.after is not None
    assert told.rms_mm.after < 2.0
    s_z = told.parameters["s_z"]
    assert s_z.value == pytest.approx(0.173, rel=0.05)
    assert "anchors in the robot file are wrong" not in told.message
