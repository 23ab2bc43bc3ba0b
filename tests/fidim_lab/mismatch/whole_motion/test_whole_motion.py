"""Whole windows decide where no model reaches the noise: independent values, evidence, what is named, what is not."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Survey
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction
from fidim_lab.effects.equivalences import shared_by
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.identification.survey import usual
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.conclusion.whole_motion import with_whole_motion
from fidim_lab.mismatch.linearised.hypotheses import hypotheses
from fidim_lab.mismatch.whole_motion.common_part import rigid
from fidim_lab.mismatch.whole_motion.factors import likeliest_survey
from fidim_lab.mismatch.whole_motion.independent_values import independent_values
from fidim_lab.mismatch.whole_motion.models import ModelFits
from fidim_lab.mismatch.whole_motion.search import SearchOutcome, search
from fidim_lab.mismatch.whole_motion.weighing import chance, excludes, log_odds, taken
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

FRICTION = "attachment-friction:viscous=0.004,dry=0.006"
BESIDE = ("anchor-offset:dx=0.02,dy=-0.01,dz=0.008,cable=2", "anchor-offset:dx=-0.008,dy=0.01,dz=0.006,cable=4")
NAMELESS = "unknown:k=-0.3,w=0.15"
"""what keeps every model above the noise"""


def test_white_noise_has_half_its_values_and_a_tone_two():
    rng, t = np.random.default_rng(1), np.arange(1000) / 100
    white = rng.normal(size=(1000, 4, 3))
    tone = np.sin(2 * np.pi * 1.4 * t + 0.3)[:, np.newaxis, np.newaxis] * rng.normal(size=(4, 3))
    assert independent_values(white) == pytest.approx(6000, rel=0.03)
    assert 2.0 <= independent_values(tone) < 4.0
    assert independent_values(tone + 1e-3 * white) < 4.0
    assert independent_values(np.zeros((10, 1, 3))) == 30


def test_independent_values_give_the_variance_of_a_sum_of_squares():
    """Independently: the sum of squares of a moving average scatters from draw to draw as 2/ν of its square."""
    rng, kernel = np.random.default_rng(2), np.ones(40) / 40
    draws = [np.convolve(rng.normal(size=2040), kernel, "valid")[:, np.newaxis, np.newaxis] for _ in range(300)]
    sums = np.array([float((one**2).sum()) for one in draws])
    true = 2 * sums.mean() ** 2 / sums.var()
    told = np.median([independent_values(np.repeat(one, 1, axis=2)) for one in draws])
    assert 0.35 * true < told < 1.3 * true  # a single periodogram halves it, as is said


def _recorded(robot: Robot, windows: int, seconds: float, beside: tuple[str, ...] = BESIDE) -> Campaign:
    """Friction at the attachments beside anchors that are 1 and 2 cm off, and a weak field without a name."""
    plan = random_plan(robot, "hidden", windows, 4, 7)
    hidden = tuple(parse_effect(text, robot.n) for text in (FRICTION, *beside, NAMELESS))
    world = make_world(robot, np.random.default_rng(7), hidden)
    made, _ = simulate_campaign(robot, plan, world, np.random.default_rng(8), recording=Sampling(seconds))
    return made


@pytest.mark.slow
def test_of_two_dissipations_the_true_one_is_named_beside_an_open_geometry(irma4: Robot):
    others = {effect.id for effect in catalogue(irma4)} - {"attachment-friction", "air-drag-linear"}
    campaign = _recorded(irma4, 3, 2.5)
    outcome = search(campaign, rigid(campaign, Mechanism(irma4, native=True)), Budget(), lambda _: None, without=others)
    assert "attachment-friction" in {h.effect.id for h in outcome.best.terms}
    assert outcome.best.geometry
    assert outcome.best.held_out < 0.5 * outcome.base.held_out
    assert outcome.temper > outcome.best.found.chi2_per_dof


def test_an_anchor_that_alone_is_wrong_is_not_spread_over_the_others(irma4: Robot):
    campaign = _recorded(irma4, 3, 2.5, ("anchor-offset:dx=0.02,dy=-0.015,cable=2",))
    trial = ModelFits(rigid(campaign, Mechanism(irma4, native=True)), ())
    friction = next(h for h in hypotheses(irma4).direct if h.effect == AttachmentFriction())
    rubbing = trial.with_term(trial.as_it_is, friction, friction.absent)
    assert rubbing is not None
    begun = trial.opened(rubbing, usual(irma4, 10.0))
    assert begun is not None
    anchors = {one.cable: one.sd[0] for one in likeliest_survey(begun, alike=False) if one.what == "anchor"}
    assert anchors.pop(2) > 5e-3 > 1e-3 > max(anchors.values())


@pytest.fixture(scope="module")
def campaign(irma4: Robot) -> Campaign:
    return _recorded(irma4, 4, 5.0)


@pytest.fixture(scope="module")
def outcome(campaign: Campaign) -> SearchOutcome:
    return search(campaign, rigid(campaign, Mechanism(campaign.robot, native=True)), Budget(), lambda _: None)


@pytest.mark.slow
def test_friction_is_named_beside_a_geometry_that_is_open(outcome: SearchOutcome):
    best = outcome.best
    kinds = {shared_by([h.effect.id]) for h in best.terms}
    assert "dissipation of rotation" in kinds, best.label
    assert best.geometry or "geometry of the robot file" in kinds, best.label
    assert not {"loose-mass", "umbilical", "air-drag-quadratic"} & {h.effect.id for h in best.terms}


@pytest.mark.slow
def test_what_is_named_predicts_windows_that_no_fit_has_seen(outcome: SearchOutcome):
    assert taken(outcome.base, outcome.best) > 0.8
    assert chance(outcome.best, outcome.base) < 0.05
    assert excludes(outcome.best, outcome.base)
    assert not excludes(outcome.best, outcome.best)
    assert log_odds(outcome.best, outcome.base) == -log_odds(outcome.base, outcome.best)


@pytest.mark.slow
def test_bodies_lie_within_the_stated_spread(outcome: SearchOutcome, irma4: Robot):
    """The true body is the world's; what is left counts as noise of few values, so that ± cover it."""
    true = make_world(irma4, np.random.default_rng(7), ()).body.vector
    off = (outcome.best.found.values[:9] - true) / outcome.best.sd(outcome.temper)[:9]
    assert np.sqrt(np.mean(off**2)) < 2.0, off


@pytest.mark.slow
def test_a_survey_that_the_file_states_is_counted_and_no_cause(irma4: Robot):
    stated = replace(irma4, survey=Survey.alike(irma4.n, 0.02, 0.002))
    others = {effect.id for effect in catalogue(irma4)} - {"attachment-friction", "air-drag-linear"}
    campaign = replace(_recorded(irma4, 3, 2.5), robot=stated)
    rough = Before(9.0, 9.0)
    open_still = Explanation("c", Verdict.UNKNOWN_PHYSICS, (), (), rough, rough, (), {}, {}, None, "", 1.0)
    common = partial(rigid, campaign, Mechanism(stated, native=True))
    told = with_whole_motion(open_still, campaign, common, (), Budget(), lambda _: None, others)
    assert [cause.id for cause in told.effects] == ["attachment-friction"]
    assert told.geometry is not None
    assert "The survey in the robot file was used" in told.message


class SpentAfter(Budget):
    """A budget that is spent when it has been asked for so many times."""

    def __init__(self, asked: int) -> None:
        super().__init__(effort=0.0)
        self.__dict__["left"] = asked

    @property
    def is_spent(self) -> bool:
        self.__dict__["left"] -= 1
        return self.__dict__["left"] < 0


@pytest.mark.slow
def test_a_search_that_was_ended_names_nothing_as_the_only_cause(irma4: Robot):
    """The term it found stands; that nothing was tried in its place is said."""
    others = {effect.id for effect in catalogue(irma4)} - {"attachment-friction", "air-drag-linear"}
    campaign = _recorded(irma4, 3, 2.5)
    rough = Before(9.0, 9.0)
    open_still = Explanation("c", Verdict.UNKNOWN_PHYSICS, (), (), rough, rough, (), {}, {}, None, "", 1.0)
    common = partial(rigid, campaign, Mechanism(irma4, native=True))
    told = with_whole_motion(open_still, campaign, common, (), SpentAfter(1), lambda _: None, others)
    friction = next(cause for cause in told.effects if cause.id == "attachment-friction")
    assert not friction.single
    assert "What could replace attachment-friction was not tried." in told.message
    assert "limit of work" in told.message
