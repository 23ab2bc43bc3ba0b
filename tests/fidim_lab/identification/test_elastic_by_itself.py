"""Elastic cables where the robot needs them, chosen by itself, on recordings of the independent simulator."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Plan, PlannedWindow, Robot, Role
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.identification.choice import soft_singular_values
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.identify import identify
from fidim_lab.identification.results.result import IdentificationResult, Outcome
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import compiler
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

pytestmark = pytest.mark.slow

SHAPE = tuple(np.array(m) for m in ([0.1, 0.0, 0.3], [-0.1, 0.1, 0.25], [0.0, -0.2, 0.2]))
PLACES = (
    ((1.25, -0.15, -0.2), (18, 12)),
    ((1.1, 0.1, -0.35), (-18, 12)),
    ((1.35, -0.35, -0.3), (12, -18)),
    ((1.2, 0.0, -0.3), (-12, -18)),
    ((1.3, -0.1, -0.4), (18, 18)),
)
"""of P (m), and displacements (mm); the last is held out"""
SOFT = ("cable-elasticity:k=4e4", "rotational-drag:c=0.03")
SENTENCE = "Cables were fitted as springs (2"


def recorded(robot: Robot, hidden: Sequence[str], *, meeting: float = 1.0, seconds: float = 4.0):
    """(campaign, true body) of a robot whose cables meet within so much of the usual distance; four markers."""
    cables = tuple(replace(cable, a=cable.a * np.array([meeting, meeting, 1.0])) for cable in robot.cables)
    robot = replace(robot, cables=cables, extra_markers=SHAPE)
    world = make_world(robot, np.random.default_rng(2), tuple(parse_effect(text, robot.n) for text in hidden))
    windows: list[PlannedWindow] = []
    for k, (place, displacement) in enumerate(PLACES):
        # lengths tuned at the robot until all cables are taut there
        rest = equilibrium_at(Mechanism(robot), world.body, np.array(place))
        role = Role.VALIDATE if k == len(PLACES) - 1 else Role.IDENTIFY
        at = rest.pose.position + rest.pose.rotation @ robot.marker
        windows.append(PlannedWindow(f"w{k + 1}", role, rest.lengths, 1e-3 * np.array(displacement), at))
    plan, rng = Plan("elastic", tuple(windows)), np.random.default_rng(3)
    campaign, truth = simulate_campaign(robot, plan, world, rng, recording=Sampling(duration=seconds))
    assert not truth["slack"]
    return campaign, world.body


def found(campaign: Campaign) -> IdentificationResult:
    return identify(campaign, native=compiler() is not None)


def off(result: IdentificationResult, body, *, spread: bool = False) -> np.ndarray:
    """Errors in nominal sd, or in the larger of that and the spread."""
    parameters = result.parameters.values()
    sd = [max(p.sd, (p.spread or 0.0) if spread else 0.0) for p in parameters]
    return (np.array([p.value for p in parameters]) - body.vector) / sd


def test_where_cables_meet_elastic_ones_are_chosen_and_find_the_body(irma4):
    campaign, body = recorded(irma4, SOFT, meeting=0.1)
    assert soft_singular_values(campaign) is not None
    result = found(campaign)
    assert result.outcome in (Outcome.CONVERGED, Outcome.DOUBTFUL)
    assert any(SENTENCE in warning for warning in result.warnings)
    assert np.abs(off(result, body)).max() < 4.5
    assert result.parameters["s_z"].value == pytest.approx(body.com[2], abs=2e-4)
    assert all((window.chi2_per_dof or np.inf) < 1.2 for window in result.windows)


def test_one_yielding_winch_beside_them_is_not_hidden_by_small_sd(irma4):
    campaign, body = recorded(irma4, (*SOFT, "winch-hold-compliance:cable=2"), meeting=0.1)
    result = found(campaign)
    assert any(SENTENCE in warning for warning in result.warnings)
    assert any("Something is missing" in warning for warning in result.warnings)
    assert np.abs(off(result, body, spread=True)).max() < 4
    np.testing.assert_allclose([p.value for p in result.parameters.values()][2:6], body.vector[2:6], rtol=0.02)


@pytest.mark.parametrize("hidden", ["cable-elasticity", "winch-hold-compliance:cable=2"])
def test_where_directions_are_held_rigid_cables_stay_and_say_that_something_is_missing(irma4, hidden):
    campaign, _ = recorded(irma4, [hidden])
    assert soft_singular_values(campaign) is None
    result = found(campaign)
    assert result.outcome is Outcome.MISFIT
    assert not any(SENTENCE in warning for warning in result.warnings)
    assert any("Something is missing" in warning for warning in result.warnings)


def test_rigid_and_elastic_cables_agree_where_both_hold(irma4):
    campaign, body = recorded(irma4, ["cable-elasticity:k=2e6"], seconds=1.5)
    windows = campaign.of_role(Role.IDENTIFY)
    rigid = fit(Mechanism(campaign.robot, native=compiler() is not None), windows)
    effect = Mechanism(campaign.robot, (CableStiffness(),), [5e-7], native=compiler() is not None)
    elastic = fit(effect, windows, theta_sd=np.array([1e-7]))
    assert elastic.likelihood.mechanism.springs
    assert elastic.chi2_per_dof <= rigid.chi2_per_dof < 1.2
    assert np.abs((elastic.values[:9] - body.vector) / elastic.sd[:9]).max() < 4.5
    # 15 µm of stretch at rest, and some that swings, are all that rigid cables are off by
    np.testing.assert_allclose(rigid.values[2:6], elastic.values[2:6], rtol=2e-3)
    np.testing.assert_allclose(rigid.values, elastic.values[:9], atol=1e-4)
