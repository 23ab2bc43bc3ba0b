"""The score of every hypothesis against finite differences of fits, and what it names in simulated campaigns."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.effects.loads.umbilical import Umbilical
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.trajectories.likelihood import Point, simulate
from fidim_lab.mismatch.linearised.columns import Scorer
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, hypotheses
from fidim_lab.mismatch.scores.score import freedom, pair_scores, project, single_scores
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import FINE
from fidim_lab.model.sensitivity.starts import tied

CHECKED = (
    "air-drag-linear",
    "swivel-inertia",
    "anchor-offset (cable 2)",
    "cable-creep (cable 3)",
    "cable-length-bias (cable 1)",
    "cable-mass",
    "loose-mass",
    "swivel-friction (giving way)",
    "lay-torque",
    "body-force",
    "frame-compliance",
)
"""one for each way in which an effect enters"""
SCANNED = {"cable-creep": 4.0, "loose-mass": 2.4, "swivel-friction": 0.05}
"""of those with scan points, the one that is checked"""


@dataclass(frozen=True, eq=False)
class Case:
    """A short campaign with its baseline fit."""

    campaign: Campaign
    found: Fit

    @property
    def few(self) -> Hypotheses:
        """All direct hypotheses and three frequencies."""
        every = hypotheses(self.campaign.robot)
        return replace(every, periodic=tuple(h for h in every.periodic if h.absent[-1] in (0.5, 1.1, 3.0)))


def case_of(campaign: Campaign) -> Case:
    return Case(campaign, fit(Mechanism(campaign.robot, native=True), campaign.of_role(Role.IDENTIFY)))


@pytest.fixture(scope="module")
def dragged(campaign_of: Callable[..., Campaign]) -> Case:
    return case_of(campaign_of("air-drag-linear:c=0.5", seed=5, windows=4, seconds=3.0))


@pytest.mark.slow
def test_columns_are_derivatives(dragged: Case) -> None:
    """Each direct hypothesis that trajectories carry: its column against a simulation with θ a little off."""
    case, tried = dragged, dragged.few
    simulation = case.found.journey.optimum.simulation
    scorer = Scorer(case.found.likelihood.mechanism, tried)
    window = next(c for c in scorer.columns(case.found.likelihood, simulation) if c.window == 0)
    checked = 0
    for h, place in zip(tried.every, scorer.tried.slices, strict=True):
        if h.label not in CHECKED or SCANNED.get(h.effect.id, 0.0) not in h.absent:
            continue
        for k, column in zip(h.scored, range(place.start, place.stop), strict=True):
            step = 1e-3 * h.effect.parameters[k].scale
            ends = [_residual(case, h.effect, h.absent, k, sign * step) for sign in (1, -1)]
            numeric = (ends[0] - ends[1]) / (2 * step)
            exact = window.by_scored[:, column]
            numeric = numeric[: len(exact)]  # what follows are priors on states that the base does not have
            scale = np.abs(numeric).max()
            assert np.abs(exact - numeric).max() < 2e-3 * scale, h.label
            checked += 1
    assert checked == 18


def _residual(case: Case, effect: object, absent: np.ndarray, k: int, change: float) -> np.ndarray:
    theta = absent.copy()
    theta[k] += change
    base, point = case.found.likelihood, case.found.journey.optimum.point
    mechanism = Mechanism(base.mechanism.robot, (effect,), theta)  # pyright: ignore[reportArgumentType]
    shared = np.concatenate([point.shared, theta])
    begins = np.array([r.begin for r in base.recordings])
    there = Point(shared, tied(mechanism, shared, point.states, begins))
    found = simulate(replace(base, mechanism=mechanism), there, case.found.journey.ends, FINE)
    assert found is not None
    rows = found.residuals[0]
    return np.concatenate([rows.markers, rows.lengths, np.zeros(len(rows.loose))])


def test_drag_is_named_with_its_size(dragged: Case) -> None:
    found = dragged.found
    projected = project(
        Scorer(found.likelihood.mechanism, dragged.few), found, found.likelihood, found.journey.optimum.simulation
    )
    context = Context.of(dragged.campaign.robot)
    scores = single_scores(projected, context)
    assert scores[0].label == "air-drag-linear"
    assert scores[0].log_evidence > 100
    assert scores[0].theta[0][0] == pytest.approx(0.5, rel=0.1)
    pairs = pair_scores(projected, context)
    assert pairs[0].log_evidence < scores[0].log_evidence + 5


def test_bounds_hold(dragged: Case) -> None:
    """Effects that only take energy never get a negative coefficient, however the gradient points."""
    found = dragged.found
    scores = single_scores(
        project(
            Scorer(found.likelihood.mechanism, dragged.few), found, found.likelihood, found.journey.optimum.simulation
        ),
        Context.of(dragged.campaign.robot),
    )
    for score in scores:
        low, high = score.tried[0].effect.bounds(Context.of(dragged.campaign.robot))
        theta = score.tried[0].theta(score.theta[0])
        assert (theta >= low - 1e-12).all()
        assert (theta <= high + 1e-12).all()


def test_nothing_is_named_where_nothing_is_hidden(irma4: Robot, campaign_of: Callable[..., Campaign]) -> None:
    case = case_of(campaign_of(seed=5, windows=4, seconds=3.0))
    found = case.found
    projected = project(
        Scorer(found.likelihood.mechanism, case.few), found, found.likelihood, found.journey.optimum.simulation
    )
    assert single_scores(projected, Context.of(irma4))[0].log_evidence < 5


def test_having_chosen_a_cable_costs_what_there_was_to_choose_from(dragged: Case) -> None:
    every = hypotheses(dragged.campaign.robot)
    friction = {h.effect.cable: h for h in every.direct if h.effect.id == "attachment-friction"}
    assert friction[None].choice == 0.0
    assert friction[2].choice == pytest.approx(np.log(dragged.campaign.robot.n))
    found = dragged.found
    projected = project(
        Scorer(found.likelihood.mechanism, dragged.few), found, found.likelihood, found.journey.optimum.simulation
    )
    place = next(k for k, h in enumerate(projected.tried) if h.effect == friction[2].effect)
    free = replace(projected, tried=tuple(replace(h, alike=1) for h in projected.tried))
    assert freedom(projected, (place,))[0] == pytest.approx(freedom(free, (place,))[0] + friction[2].choice)


def test_forms_of_a_term_are_none_of_what_is_taken_as_unknown(dragged: Case) -> None:
    weak = np.array([0.0, 0.4, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0])  # a hose without a spring: a drag and a steady force
    forms = Umbilical().parts(weak, np.full(8, 1e-3))
    robot = dragged.campaign.robot
    admitted = hypotheses(robot).admitted(forms)
    assert [effect.id for effect, _ in admitted] == ["air-drag-linear", "constant-force"]
    without = hypotheses(robot, ["air-drag-linear"]).admitted(forms)
    assert [effect.id for effect, _ in without] == ["constant-force"]


def test_a_hose_whose_spring_is_not_seen_falls_into_parts() -> None:
    taut = np.array([2.0, 0.4, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    assert Umbilical().parts(taut, np.full(8, 0.1)) == ()
    assert [effect.id for effect, _ in Umbilical().parts(taut, np.full(8, 1.0))] == [
        "air-drag-linear",
        "constant-force",
    ]
