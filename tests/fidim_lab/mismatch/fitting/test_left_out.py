"""Windows left out in turn, to first order, against fits and predictions that leave each out indeed."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fidim_lab.data.records import Campaign, Role
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut, predict
from fidim_lab.mismatch.fitting.left_out import left_out

NONE_HELD = HeldOut(chi2=0.0, dof=0, rms=float("nan"), refused={})


@pytest.fixture(scope="module")
def campaign(campaign_of: Callable[..., Campaign]) -> Campaign:
    return campaign_of(seed=44, windows=4, seconds=2.0)


def fitted(campaign: Campaign, *windows) -> Baseline:
    return fit_baseline(replace(campaign, windows=windows), native=True, say=lambda _: None)


def test_it_is_what_fits_without_each_window_foretell(campaign: Campaign) -> None:
    windows = campaign.of_role(Role.IDENTIFY)
    found = left_out(fitted(campaign, *windows).as_it_is, NONE_HELD)
    assert found is not None
    whole = fitted(campaign, *windows).fit
    for window, seen in zip(windows, whole.remainders, strict=True):
        others = fitted(campaign, *(other for other in windows if other is not window))
        indeed = predict(others.as_it_is, [window])
        assert found.of_window[window.id] > seen.chi2_per_dof, "what was not fitted is missed by more"
        assert found.of_window[window.id] == pytest.approx(indeed.chi2_per_dof, rel=0.02)
    assert found.chi2_per_dof == pytest.approx(sum(found.of_window.values()) / len(windows), rel=1e-3)


def test_held_out_windows_count_as_they_are_predicted(campaign: Campaign) -> None:
    base = fit_baseline(campaign, native=True, say=lambda _: None)
    alone, found = left_out(base.as_it_is, NONE_HELD), left_out(base.as_it_is, base.predicted)
    assert alone is not None
    assert found is not None
    assert found.dof == alone.dof + base.predicted.dof
    assert found.chi2 == pytest.approx(alone.chi2 + base.predicted.chi2)
    assert min(alone.rms, base.predicted.rms) <= found.rms <= max(alone.rms, base.predicted.rms)


def test_two_windows_foretell_nothing_of_each_other(campaign: Campaign) -> None:
    assert left_out(fitted(campaign, *campaign.of_role(Role.IDENTIFY)[:2]).as_it_is, NONE_HELD) is None
