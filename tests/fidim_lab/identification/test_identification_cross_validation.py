"""Parameters held against windows that they were not found from."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Role
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.cross_validation import CrossValidation, JudgedWindow, Rule, cross_validate
from fidim_lab.identification.survey import as_found
from fidim_lab.model.mechanism import Mechanism

NOISE = 1e-4


@pytest.fixture(scope="module")
def campaign(recorded):
    return recorded(noise=NOISE)


def test_the_true_body_predicts_to_the_noise(campaign, true_body):
    found = cross_validate(campaign, true_body, None)
    [window] = found.windows
    assert found.predicts
    assert window.role is Role.VALIDATE
    assert window.chi2_per_dof == pytest.approx(1.0, abs=0.1)
    assert window.rms == pytest.approx(NOISE, rel=0.06)
    assert window.sigma_perp == pytest.approx(window.expected, rel=0.3)
    assert window.why == ""
    assert "predict the one window" in found.message


def test_one_percent_of_s_z_is_noticed(campaign, true_body):
    off = Body(true_body.com * 1.01, true_body.inertia)
    found = cross_validate(campaign, off, None)
    assert not found.predicts
    [window] = found.failed
    assert window.chi2_per_dof is None or window.chi2_per_dof > 2
    assert window.why
    assert "do not predict 1 of 1" in found.message


def test_the_limit_is_the_callers(campaign, true_body):
    found = cross_validate(campaign, true_body, None, rule=Rule(chi2_per_dof=0.5))
    assert not found.predicts
    assert "χ²/dof is" in found.windows[0].why
    assert "at most 0.5" in found.rule.sentence


def test_geometry_that_was_found_with_the_body_predicts_too(campaign, true_body):
    """A robot file that is 4 mm off at one anchor: the body alone does not predict, with what a fit found it does."""
    off = np.array([0.004, -0.002, 0.001])
    cables = campaign.robot.cables
    wrong = replace(campaign.robot, cables=(cables[0], replace(cables[1], d=cables[1].d - off), *cables[2:]))
    filed = replace(campaign, robot=wrong)
    assert not cross_validate(filed, true_body, None).predicts
    found = as_found(Mechanism(wrong, native=True), {("anchor", 2): tuple(off)})
    assert cross_validate(filed, true_body, None, mechanism=found).predicts


def test_a_large_sigma_perp_is_remarked_and_decides_only_without_lengths(campaign, true_body):
    """A σ_W far below what the equations show: the parameters come from better windows than these."""
    found = cross_validate(campaign, true_body, 1e-3)
    assert found.predicts
    assert "times its expected value" in found.windows[0].why


def test_windows_without_lengths_are_judged(recorded, true_body):
    campaign = recorded(noise=NOISE, cluster=True)
    blind = replace(campaign, windows=tuple(replace(w, lengths=None) for w in campaign.of_role(Role.VALIDATE)))
    assert cross_validate(blind, true_body, None).predicts
    wrong = cross_validate(blind, Body(true_body.com * 1.1, true_body.inertia), None)
    assert not wrong.predicts


def test_only_the_asked_roles_are_judged(campaign, true_body):
    both = cross_validate(campaign, true_body, None, roles=(Role.IDENTIFY, Role.VALIDATE))
    assert [w.id for w in both.windows] == [w.id for w in campaign.windows]
    without = replace(campaign, windows=campaign.of_role(Role.IDENTIFY))
    with pytest.raises(SetupError, match="no window with the role validate"):
        cross_validate(without, true_body, None)


def test_what_cannot_be_judged_is_neither_right_nor_wrong(campaign, true_body):
    [last] = campaign.of_role(Role.VALIDATE)
    blank = replace(last, id="blank", markers=np.full_like(last.markers, np.nan))
    found = cross_validate(replace(campaign, windows=(last, blank)), true_body, None, roles=(Role.VALIDATE,))
    assert [w.predicted for w in found.windows] == [True, None]
    assert found.predicts
    assert found.windows[1].why
    with pytest.raises(RefusedError, match="No window can be judged: blank"):
        cross_validate(replace(campaign, windows=(blank,)), true_body, None)


def test_a_body_that_cannot_move_is_refused(campaign, true_body):
    with pytest.raises(RefusedError, match="kinetic energy is negative"):
        cross_validate(campaign, replace(true_body, inertia=-true_body.inertia), None)


def test_the_message_counts_and_names():
    def window(name, predicted, chi2):
        return JudgedWindow(name, Role.VALIDATE, predicted, 0.1, 0.1, 2e-4, chi2, "" if predicted else "χ²/dof is 9")

    found = CrossValidation((window("v1", True, 1.0), window("v2", False, 9.0), window("v3", None, None)), Rule())
    assert found.message == ("The parameters do not predict 1 of 2 windows (v2); χ²/dof up to 9, rms up to 0.2 mm.")
