"""General geometry as a rival: a file off by ordinary survey errors makes no cause, and a real cause stays one."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Survey
from fidim_lab.effects.geometry.cable_geometry import AnchorOffset
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.survey import usual
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.refit import refit
from fidim_lab.mismatch.scores.views import view
from fidim_lab.mismatch.selection.general_geometry import FirstLook, opening, rival


def quiet(sentence: str) -> None:
    del sentence


def moved(robot: Robot, metres: float, seed: int) -> Robot:
    random = np.random.default_rng(seed)
    cables = tuple(replace(c, d=c.d + metres * random.standard_normal(3)) for c in robot.cables)
    return replace(robot, cables=cables)


@pytest.fixture(scope="module")
def exact(baseline_of: Callable[..., Baseline]) -> Baseline:
    """Four windows of 3 s of a robot as its file has it."""
    return baseline_of(seed=40, windows=4, seconds=3.0)


@pytest.fixture(scope="module")
def wrong(exact: Baseline) -> Baseline:
    """The same recordings with a file that is off by a millimetre."""
    robot = moved(exact.campaign.robot, 1e-3, 3)
    return fit_baseline(replace(exact.campaign, robot=robot), native=True, say=quiet)


@pytest.mark.slow
def test_an_exact_file_has_no_rival(exact: Baseline) -> None:
    assert FirstLook(exact, quiet).seen is None
    general = rival(view(exact.as_it_is, exact.tried, exact.context))
    assert general is not None
    assert general.best < -ODDS


@pytest.mark.slow
def test_a_file_off_as_surveys_are_is_opened_at_once(wrong: Baseline) -> None:
    found = FirstLook(wrong, quiet).instead_of_a_search
    assert found is not None
    assert found.geometry
    assert found.as_it_is.is_white
    assert 0.0 < found.as_it_is.strain < 4 * len(found.fit.values)


@pytest.mark.slow
def test_a_stated_survey_is_open_from_the_beginning(wrong: Baseline) -> None:
    robot = replace(wrong.campaign.robot, survey=Survey.alike(4, 1e-3, 0.0))
    found = fit_baseline(replace(wrong.campaign, robot=robot), native=True, say=quiet)
    assert {one.what for one in found.geometry} == {"anchor"}
    assert found.as_it_is.is_white
    assert FirstLook(found, quiet).instead_of_a_search is None


@pytest.mark.slow
def test_a_term_beside_an_open_geometry_keeps_its_place(wrong: Baseline) -> None:
    found = fit_baseline(wrong.campaign, native=True, say=quiet, geometry=usual(wrong.campaign.robot))
    term = next(h for h in found.tried.direct if h.effect == AnchorOffset(2))
    model = refit(found.ground(found.as_it_is), found.fit, [term], [term.absent], found.context)
    assert model is not None
    assert model.mechanism.effects[0] == AnchorOffset(2)
    assert len(model.fit.values) == len(found.fit.values) + 3
    assert len(model.at_bound) == 3
    assert model.freedom(1.0) > 0
    assert model.chi2 + model.strain <= found.as_it_is.chi2 + found.as_it_is.strain + 1.0


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_beside_a_term_the_geometry_is_opened_where_it_says_more_than_further_effects(
    baseline_of: Callable[..., Baseline], off: float
) -> None:
    exact = baseline_of("rotational-drag:c=0.02", seed=7, windows=4, seconds=3.0)
    robot = moved(exact.campaign.robot, off, 3)
    start = fit_baseline(replace(exact.campaign, robot=robot), native=True, say=quiet)
    drag = next(h for h in start.tried.direct if h.effect.id == "rotational-drag")
    model = refit(start.short_ground, start.short, [drag], [drag.absent], start.context)
    assert model is not None
    found = opening(view(model, start.tried, start.context))
    if not off:
        assert found is None
        return
    assert found is not None
    assert found.beside is model
    assert 0.5 < found.factor < 3.0
    assert opening(view(start.as_it_is, start.tried, start.context)) is None
