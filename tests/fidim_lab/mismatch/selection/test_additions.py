"""Terms that race over as long as a model follows the motion, before any is fitted to the whole."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, hypotheses
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection import additions as module
from fidim_lab.mismatch.selection.additions import Addition, additions
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism

FREQUENCY = 1
"""place of f in θ of a loose mass"""


@pytest.fixture(scope="module")
def every(irma4: Robot) -> Hypotheses:
    return hypotheses(irma4)


class Seen(View):
    """A view without a fit, of which no pair says anything."""

    def _can_be_fitted(self, effect: object) -> bool:
        return True

    @property
    def pairs(self) -> tuple[Score, ...]:
        return ()


Looks = Callable[..., View]


@pytest.fixture(scope="module")
def seen(searched: Selection, claim: Callable[..., Candidate]) -> Looks:
    """These scores, at a model that is far off over whole windows; `shortened`: looked at over a shorter time."""

    def made(
        scores: list[Score], *, shortened: bool, tried: tuple[Hypothesis, ...] = (), springs: bool = False
    ) -> View:
        model = claim(*tried, fitted=867.0).model
        mechanism = Mechanism(model.mechanism.robot, springs=springs)
        fit = replace(model.fit, likelihood=replace(model.fit.likelihood, mechanism=mechanism))
        near = replace(fit, unused={}) if shortened else fit
        projected = replace(searched.first.projected, left=1e6, dof=1000)
        return Seen(replace(model, fit=fit), projected, tuple(scores), searched.first.context, near)

    return made


def score(tried: Hypothesis, nats: float) -> Score:
    return Score((tried,), (np.full(len(tried.scored), 0.1),), 2 * nats, nats)


def masses(every: Hypotheses) -> list[Hypothesis]:
    return [h for h in every.direct if h.effect.id == "loose-mass"]


def short(tried: tuple[Hypothesis, ...], excess: float) -> SimpleNamespace:
    """The model that was looked at, over the short time."""
    return SimpleNamespace(tried=tried, thetas=[h.absent for h in tried], evidence=-867.0, excess=excess)


@pytest.fixture
def fits(monkeypatch):
    """What was fitted: (names, θ); a loose mass suits at 2.4 Hz alone, drag of the rotation somewhat."""
    done: list[tuple[tuple[str, ...], list[np.ndarray]]] = []

    def refit(ground, donor, tried, thetas, context, **_):
        done.append((tuple(h.effect.id for h in tried), thetas))
        suits = {"loose-mass": 1.0 if 2.4 in thetas[-1] else 300.0, "rotational-drag": 40.0}
        found = suits.get(tried[-1].effect.id, 500.0)
        return SimpleNamespace(
            excess=found, fit=donor, tried=tried, thetas=thetas, evidence=-found, is_white=found < 1.5
        )

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "Completed", lambda tried, *_, **__: short(tried, 867.0))
    monkeypatch.setattr(module, "common_scale", lambda models: 1.0)
    monkeypatch.setattr(module, "evidence", lambda model, than, scale: model.evidence - than.evidence)
    return done


GROUND = SimpleNamespace(as_far_as=lambda found: "near")


def test_where_the_motion_is_followed_nothing_races(every: Hypotheses, fits: list, seen: Looks) -> None:
    looked = seen([score(masses(every)[0], 900.0)], shortened=False)
    assert [one.near for one in additions(looked, 3, GROUND, None)] == [None]
    assert fits == []


def test_a_mass_is_tried_at_other_frequencies_and_the_first_that_suits_is_taken(
    every: Hypotheses, fits: list, seen: Looks
) -> None:
    loud = sorted(masses(every), key=lambda h: abs(h.absent[FREQUENCY] - 3.2))[:8]  # the score points elsewhere
    assert [h.absent[FREQUENCY] for h in loud].index(2.4) < SELECTION.additions_scanned
    (found,) = additions(seen([score(h, 900.0 - k) for k, h in enumerate(loud)], shortened=True), 3, GROUND, None)
    assert found.near is not None
    assert found.near.excess == 1.0
    assert found.near.tried[0].absent[FREQUENCY] == 2.4
    assert len(fits) == SELECTION.additions_scanned
    fits.clear()
    suits = [h for h in loud if h.absent[FREQUENCY] == 2.4]
    additions(seen([score(h, 900.0) for h in suits], shortened=True), 3, GROUND, None)
    assert len(fits) == 1, "what suits at once is not scanned any further"


def test_no_more_than_some_values_are_tried(every: Hypotheses, fits: list, seen: Looks) -> None:
    wrong = [h for h in masses(every) if h.absent[FREQUENCY] != 2.4]
    additions(seen([score(h, 900.0 - k) for k, h in enumerate(wrong)], shortened=True), 3, GROUND, None)
    assert len(fits) == SELECTION.additions_scanned


def test_the_race_decides_not_the_score(every: Hypotheses, fits: list, seen: Looks) -> None:
    """What convinces most over the short time goes on, though the scores have it last; cables that stretch stay."""
    of_id = {h.effect.id: h for h in every.direct}
    first = ["swivel-damping", "air-drag-linear", "anchor-offset", "attachment-friction", "rotational-drag"]
    scores = [score(of_id[id], 900.0 - k) for k, id in enumerate(first)]
    mass = next(h for h in masses(every) if h.absent[FREQUENCY] == 2.4)
    scores += [score(of_id["cable-elasticity"], 850.0), score(mass, 800.0)]
    found = [one.score.tried[0].effect.id for one in additions(seen(scores, shortened=True), 3, GROUND, None)]
    assert len(found) == SELECTION.additions_finalists
    assert found[:3] == ["cable-elasticity", "loose-mass", "rotational-drag"]


def test_cables_that_stretch_take_half_of_the_places_and_failures_none(
    every: Hypotheses, fits: list, monkeypatch, seen: Looks
) -> None:
    of_id = {h.effect.id: h for h in every.direct}
    springs = [h for h in every.direct if h.effect.id in ("cable-elasticity", "winch-hold-compliance")][:3]
    rest = [of_id[id] for id in ("cable-mass", "rotational-drag", "swivel-damping")]
    raced = module.refit
    missed = {"cable-mass"}
    monkeypatch.setattr(
        module, "refit", lambda g, d, t, *a, **k: None if t[-1].effect.id in missed else raced(g, d, t, *a)
    )
    scores = [score(h, 900.0 - k) for k, h in enumerate([*springs, *rest])]
    found = [one.score.tried[0].effect.id for one in additions(seen(scores, shortened=True), 3, GROUND, None)]
    assert found[:2] == [h.effect.id for h in springs[:2]]
    assert found[2:] == ["rotational-drag", "swivel-damping"]


def test_cables_that_stretch_race_too_where_the_short_time_is_followed(
    every: Hypotheses, fits: list, monkeypatch, seen: Looks
) -> None:
    """Stiff cables beside friction: from there they are found in a step, from nothing not at all."""
    of_id = {h.effect.id: h for h in every.direct}
    monkeypatch.setattr(module, "Completed", lambda tried, *_, **__: short(tried, 1.3))
    scores = [score(of_id["cable-elasticity"], 900.0), score(of_id["rotational-drag"], 890.0)]
    found = additions(seen(scores, shortened=True), 3, GROUND, None)
    assert [ids for ids, _ in fits] == [("cable-elasticity",), ("rotational-drag",)]
    assert [one.score.tried[0].effect.id for one in found] == ["rotational-drag", "cable-elasticity"]
    assert all(one.near is not None for one in found)


def test_cables_that_stretch_are_not_looked_for_beside_two_terms_that_do_not_follow(
    every: Hypotheses, fits: list, seen: Looks
) -> None:
    of_id = {h.effect.id: h for h in every.direct}
    scores = [score(of_id["cable-elasticity"], 900.0), score(of_id["rotational-drag"], 890.0)]
    looked = seen(scores, shortened=True, tried=(of_id["cable-mass"], of_id["swivel-damping"]))
    found = additions(looked, 1, GROUND, None)
    assert [one.score.tried[0].effect.id for one in found] == ["rotational-drag"]


def test_where_the_motion_is_followed_terms_begin_from_nothing_but_stiffness(
    every: Hypotheses, fits: list, seen: Looks
) -> None:
    """A leap leaves body and states behind: so frictions and the mass of cables were lost, whose scores were right."""
    of_id = {h.effect.id: h for h in every.direct}
    scores = {id: score(of_id[id], 900.0) for id in ("rotational-drag", "cable-elasticity")}
    for shortened, springs, id, expected in (
        (True, True, "rotational-drag", 0.0),
        (True, False, "rotational-drag", 0.1),
        (False, False, "rotational-drag", 0.0),
        (True, True, "cable-elasticity", 0.1),
        (False, False, "cable-elasticity", 0.1),
    ):
        looked = seen(list(scores.values()), shortened=shortened, springs=springs)
        Addition(looked, scores[id]).fitted(GROUND, None)
        assert fits[-1][0] == (id,)
        assert fits[-1][1][-1][0] == expected


def test_what_has_scores_at_some_values_only_races_though_others_fill_the_places(
    every: Hypotheses, seen: Looks
) -> None:
    """A loose mass whose best scanned value is far from its own says less there than frictions that merely imitate."""
    ids = list(dict.fromkeys(h.effect.id for h in every.direct if h.effect.id != "loose-mass"))
    others = [next(h for h in every.direct if h.effect.id == id) for id in ids][: SHARED.shortlist + 2]
    scores = [*(score(h, 900.0 - k) for k, h in enumerate(others)), score(masses(every)[0], 500.0)]
    found = [one.tried[0].effect.id for one in seen(scores, shortened=True).additions(3)]
    assert found[: SHARED.shortlist] == [h.effect.id for h in others[: SHARED.shortlist]]
    assert found[-1] == "loose-mass"


def test_a_model_of_which_nothing_can_be_said_to_first_order_gets_no_additions(seen: Looks) -> None:
    nothing = seen([], shortened=False)
    assert nothing.additions(3) == ()


def test_one_kind_does_not_fill_the_race(every: Hypotheses, seen: Looks) -> None:
    """The same friction at each cable is one idea, not five."""
    frictions = [h for h in every.direct if h.effect.id == "attachment-friction"]
    others = [next(h for h in every.direct if h.effect.id == id) for id in ("air-drag-linear", "cable-mass")]
    looked = seen([score(h, 900.0 - k) for k, h in enumerate([*frictions, *others])], shortened=True)
    ids = [one.tried[0].effect.id for one in looked.additions(3)]
    assert ids == ["attachment-friction"] * SHARED.runners_up + ["air-drag-linear", "cable-mass"]
    assert len(ids) <= SHARED.shortlist
