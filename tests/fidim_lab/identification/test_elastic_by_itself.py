"""Elastic cables where the robot needs them, chosen by itself, on recordings of the independent simulator."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Role
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.identification.choice import soft_singular_values
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.identify import identify
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import compiler

pytestmark = pytest.mark.slow

SOFT = ("cable-elasticity:k=4e4", "rotational-drag:c=0.03")
SENTENCE = "Cables were fitted as springs (2"


def found(campaign: Campaign) -> IdentificationResult:
    return identify(campaign, native=compiler() is not None)


def off(result: IdentificationResult, body, *, spread: bool = False) -> np.ndarray:
    """Errors in nominal sd, or in the larger of that and the spread."""
    parameters = result.parameters.values()
    sd = [max(p.sd, (p.spread or 0.0) if spread else 0.0) for p in parameters]
    return (np.array([p.value for p in parameters]) - body.vector) / sd


def test_where_cables_meet_elastic_ones_are_chosen_and_find_the_body(recorded_on_springs, irma4):
    campaign, body = recorded_on_springs(irma4, SOFT, meeting=0.1)
    assert soft_singular_values(campaign) is not None
    result = found(campaign)
    assert result.outcome in (ResultOutcome.CONVERGED, ResultOutcome.DOUBTFUL)
    assert any(SENTENCE in warning for warning in result.warnings)
    assert np.abs(off(result, body)).max() < 4.5
    assert result.parameters["s_z"].value == pytest.approx(body.com[2], abs=2e-4)
    assert all((window.chi2_per_dof or np.inf) < 1.2 for window in result.windows)


def test_one_yielding_winch_beside_them_is_not_hidden_by_small_sd(recorded_on_springs, irma4):
    campaign, body = recorded_on_springs(irma4, (*SOFT, "winch-hold-compliance:cable=2"), meeting=0.1)
    result = found(campaign)
    assert any(SENTENCE in warning for warning in result.warnings)
    assert any("Something is missing" in warning for warning in result.warnings)
    assert np.abs(off(result, body, spread=True)).max() < 4
    np.testing.assert_allclose([p.value for p in result.parameters.values()][2:6], body.vector[2:6], rtol=0.02)


@pytest.mark.parametrize("hidden", ["cable-elasticity", "winch-hold-compliance:cable=2"])
def test_where_directions_are_held_rigid_cables_stay_and_say_that_something_is_missing(
    recorded_on_springs, irma4, hidden
):
    campaign, _ = recorded_on_springs(irma4, [hidden])
    assert soft_singular_values(campaign) is None
    result = found(campaign)
    assert result.outcome is ResultOutcome.MISFIT
    assert not any(SENTENCE in warning for warning in result.warnings)
    assert any("Something is missing" in warning for warning in result.warnings)


def test_rigid_and_elastic_cables_agree_where_both_hold(recorded_on_springs, irma4):
    campaign, body = recorded_on_springs(irma4, ["cable-elasticity:k=2e6"], seconds=1.5)
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
