"""Robots whose cables hold one direction hardly at all: the same search, on elastic cables."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app.records.import_recording import run_import
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Robot, Role
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.identification.choice import soft_mode
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.whole_motion.common_part import elastic
from fidim_lab.mismatch.whole_motion.search import search
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

SHAPE = tuple(np.array(m) for m in ([0.1, 0.0, 0.3], [-0.1, 0.1, 0.25], [0.0, -0.2, 0.2]))
PLACES = (
    ((1.25, -0.15, -0.2), (18, 12)),
    ((1.1, 0.1, -0.35), (-18, 12)),
    ((1.3, -0.1, -0.4), (18, 18)),
)
"""of P (m), and displacements (mm); the last is held out"""
DISSIPATION = ("rotational-drag", "attachment-friction", "swivel-friction", "air-drag-linear")


def recorded(robot: Robot, hidden: Sequence[str], seconds: float) -> Campaign:
    """Of a robot whose cables meet within a tenth of the usual distance, and are springs; four markers."""
    cables = tuple(replace(cable, a=cable.a * np.array([0.1, 0.1, 1.0])) for cable in robot.cables)
    robot = replace(robot, cables=cables, extra_markers=SHAPE)
    effects = tuple(parse_effect(text, robot.n) for text in ("cable-elasticity:k=4e4", *hidden))
    world = make_world(robot, np.random.default_rng(2), effects)
    windows: list[PlannedWindow] = []
    for k, (place, displacement) in enumerate(PLACES):
        rest = equilibrium_at(Mechanism(robot), world.body, np.array(place))
        role = Role.VALIDATE if k == len(PLACES) - 1 else Role.IDENTIFY
        at = rest.pose.position + rest.pose.rotation @ robot.marker
        windows.append(PlannedWindow(f"w{k + 1}", role, rest.lengths, 1e-3 * np.array(displacement), at))
    plan, rng = Plan("soft", tuple(windows)), np.random.default_rng(3)
    campaign, _ = simulate_campaign(robot, plan, world, rng, recording=Sampling(duration=seconds))
    return campaign


def test_what_dissipates_is_found_beside_cables_that_are_springs(irma4: Robot):
    others = {effect.id for effect in catalogue(irma4)} - {*DISSIPATION}
    campaign = recorded(irma4, ["rotational-drag:c=0.012"], 2.0)
    softness = soft_mode(campaign)
    assert softness is not None
    common = elastic(campaign, softness)
    assert CableStiffness() in common.nuisances
    assert not {effect.id for effect in common.found.likelihood.mechanism.effects} & {*DISSIPATION}  # pyright: ignore
    assert softness in common.sentences[0]
    outcome = search(campaign, common, lambda _: None, without=others)
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
    assert told.rms_mm.after < 2.2
    s_z = told.parameters["s_z"]
    assert s_z.value == pytest.approx(0.173, rel=0.05)
    assert "anchors are off" not in told.message
