"""The offset of two clocks by motor currents, in campaigns of the other simulator."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.sealed.campaigns import NATIVE, SealedRecipe, sealed_campaign
from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.identification.mle.fit import fit
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.conclusion.timing import OFFSET, RATE, retimed, timing, with_timing
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.model.mechanism import Mechanism


@pytest.fixture(scope="module")
def fitted(irma4: Robot, campaign_of: Callable[..., Campaign]) -> Callable[..., Completed]:
    """Three windows of 2.5 s, fitted by the model as it is."""

    @cache
    def made(*texts: str, currents: bool = True) -> Completed:
        windows = campaign_of(*texts, seed=8, windows=3, held_out=0, seconds=2.5).of_role(Role.IDENTIFY)
        if not currents:
            windows = tuple(replace(window, currents=None) for window in windows)
        return Completed((), fit(Mechanism(irma4, native=True), windows), whole=True)

    return made


@pytest.fixture(scope="module")
def late(fitted: Callable[..., Completed]) -> Completed:
    return fitted("time-offset:offset=0.012")


def told(verdict: Verdict = Verdict.NOTHING_MISSING) -> Explanation:
    none = Before(1.0, 1.0)
    return Explanation("c", verdict, (), (), none, none, (), {}, {}, None, "Nothing is missing.", 1.0)


def test_an_offset_is_found_with_its_sign_and_size(late: Completed) -> None:
    found = timing(late)
    assert found is not None
    assert found.is_off
    assert found.sd < 3e-4
    assert abs(found.offset - 0.012) < 4 * found.sd


def test_it_is_named_where_all_else_is_explained(late: Completed) -> None:
    named = with_timing(told(), late)
    assert named.verdict is Verdict.EXPLAINED
    assert [cause.id for cause in named.effects] == [OFFSET]
    assert "12." in named.message or "11.9" in named.message
    assert with_timing(told(Verdict.UNKNOWN_PHYSICS), late) == told(Verdict.UNKNOWN_PHYSICS)


def test_none_is_named_where_there_is_none(fitted: Callable[..., Completed]) -> None:
    found = timing(fitted())
    assert found is not None
    assert not found.is_off
    assert abs(found.offset) < 4 * found.sd
    assert not found.runs_away
    assert abs(found.rate) < 4 * found.rate_sd


def test_a_rate_is_no_offset(irma4: Robot, fitted: Callable[..., Completed]) -> None:
    drifting = fitted("clock-rate:rate=2e-3")
    found = timing(drifting)
    assert found is not None
    assert found.runs_away
    assert abs(found.rate - 2e-3) < 4 * found.rate_sd
    assert not found.is_off
    assert [cause.id for cause in with_timing(told(), drifting).effects] == [RATE]
    assert "corrected time stamps" in with_timing(told(), drifting, put_right=True).message
    windows = tuple(recording.window for recording in drifting.fit.likelihood.recordings)
    right = retimed(Campaign("c", irma4, 100.0, windows), drifting)
    assert right is not None
    for window, there in zip(windows, right.windows, strict=True):
        assert there.t[0] == window.t[0]
        assert np.ptp(there.t) == pytest.approx(np.ptp(window.t) / (1 + found.rate), rel=1e-12)
        assert there.markers is window.markers


def test_clocks_that_run_alike_are_left_alone(irma4: Robot, fitted: Callable[..., Completed]) -> None:
    good = fitted()
    windows = tuple(recording.window for recording in good.fit.likelihood.recordings)
    assert retimed(Campaign("c", irma4, 100.0, windows), good) is None


def test_without_currents_it_is_said_that_it_was_not_tested(fitted: Callable[..., Completed]) -> None:
    blind = fitted("time-offset:offset=0.012", currents=False)
    assert timing(blind) is None
    answer = with_timing(told(), blind)
    assert answer.verdict is Verdict.NOTHING_MISSING
    assert answer.untested == (OFFSET,)
    assert "no suitable motor currents" in answer.message


@pytest.mark.slow
def test_gravity_of_another_strength_is_no_clock_where_currents_have_the_cameras_time(irma4: Robot) -> None:
    there = replace(irma4, gravity=np.array([0.0, 0.0, -9.781]))
    campaign, _ = sealed_campaign(SealedRecipe("south", there, (), NATIVE, (6, 2), 100.0, True, 3))
    found = explain(replace(campaign, robot=replace(campaign.robot, gravity=irma4.gravity)))
    assert [one.id for one in found.effects] == ["constant-force"], found.message
    upwards = found.effects[0].parameters["fz"].value
    assert upwards == pytest.approx(irma4.mass * 0.029, rel=0.2)
