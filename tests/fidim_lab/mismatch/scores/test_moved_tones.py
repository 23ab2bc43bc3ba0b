"""A periodic term that was found at a wrong frequency: it is looked for again beside the others, and moves."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, hypotheses
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.scores.views import View, _own_phase, _without
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection, _less_doubtful


@pytest.fixture(scope="module")
def every(irma4: Robot) -> Hypotheses:
    return hypotheses(irma4)


def at(every: Hypotheses, frequency: float) -> Hypothesis:
    return next(h for h in every.periodic if h.effect.id == "periodic-force" and h.absent[-1] == frequency)


def test_a_periodic_term_stays_among_what_is_looked_at_and_others_do_not(every: Hypotheses) -> None:
    drag = next(h for h in every.direct if h.effect.id == "air-drag-linear")
    used = (at(every, 1.3), drag)
    left = _without(every, used)
    assert len(left.periodic) == len(every.periodic)
    assert drag.effect not in {h.effect for h in left.direct}
    assert len(left.direct) == len(every.direct) - 1


def test_no_other_variant_of_what_is_there_is_looked_at(every: Hypotheses) -> None:
    wide = type("Wide", (type(at(every, 1.3).effect),), {})()
    left = _without(every, (replace(at(every, 1.3), effect=wide),))
    assert {h.effect.id for h in left.periodic} == {"frame-sway"}


@dataclass(frozen=True)
class Seen(View):
    """A view without a fit."""

    def _can_be_fitted(self, effect: object) -> bool:
        return True

    @property
    def pairs(self) -> tuple[Score, ...]:
        return ()


@pytest.fixture
def seen(searched: Selection, claim: Callable[..., Candidate]) -> Callable[..., Seen]:
    """These scores, at a model with these terms that is followed over whole windows."""

    def made(tried: tuple[Hypothesis, ...], *scores: Score) -> Seen:
        model = claim(*tried, fitted=1.1).model
        projected = replace(searched.first.projected, left=40_000.0, dof=36_000)
        return Seen(model, projected, scores, searched.first.context, model.fit)

    return made


def score(tried: Hypothesis, nats: float) -> Score:
    return Score((tried,), (np.zeros(len(tried.scored)),), 2 * nats, nats)


def test_with_no_room_left_only_the_frequency_may_move(every: Hypotheses, seen: Callable[..., Seen]) -> None:
    drag = next(h for h in every.direct if h.effect.id == "air-drag-linear")
    moved = score(at(every, 0.5), 1940.0)
    model = (at(every, 1.3),)
    looked = seen(model, score(drag, 1950.0), moved, score(at(every, 0.6), 900.0))
    assert looked.additions(0) == (moved,)
    assert {s.tried[0].effect.id for s in looked.additions(1)} == {"air-drag-linear", "periodic-force"}


def test_where_nothing_asks_for_another_frequency_nothing_moves(every: Hypotheses, seen: Callable[..., Seen]) -> None:
    assert seen((at(every, 1.3),), score(at(every, 0.5), 3.0)).additions(0) == ()


def test_a_tone_that_is_there_with_one_phase_may_get_a_phase_of_each_window(
    every: Hypotheses, irma4: Robot, seen: Callable[..., Seen], claim: Callable[..., Candidate]
) -> None:
    wide = replace(at(every, 1.3), effect=next(e for e in by_id(irma4, "periodic-force") if e.of_each_window))
    same, own = score(at(every, 1.3), 100.0), score(wide, 1900.0)

    assert _own_phase((same,), (own,), claim(at(every, 1.3)).model) == (own,)
    assert _own_phase((same,), (own,), claim(wide).model) == ()
    assert _own_phase((same,), (score(wide, 103.0),), claim().model) == ()
    assert seen((at(every, 1.3),), own).additions(0) == (own,)


def test_a_search_is_repeated_without_what_may_stand_in_anothers_place(
    every: Hypotheses, claim: Callable[..., Candidate], monkeypatch
) -> None:
    drag, friction, creep = (
        next(h for h in every.direct if h.effect.id == id)
        for id in ("air-drag-linear", "swivel-friction", "cable-creep")
    )

    def doubtful(*tried: Hypothesis, prices: tuple[float, ...], white: bool = False) -> list[list[int]]:
        monkeypatch.setattr("fidim_lab.mismatch.selection.select.price", lambda model, k: prices[k])
        return _less_doubtful(claim(*tried, white=white))

    tone = at(every, 1.3)
    assert doubtful(drag, friction, creep, prices=(900.0, 40.0, 300.0)) == [[0, 2]]
    assert doubtful(drag, tone, creep, prices=(900.0, 300.0, 40.0)) == [[0, 2], [0, 1]]
    assert doubtful(drag, tone, creep, prices=(900.0, 40.0, 300.0)) == [[0, 2]]
    assert doubtful(drag, tone, prices=(900.0, 40.0)) == [[0]]
    assert doubtful(drag, friction, prices=(900.0, 40.0)) == []  # there is room for a third
    assert doubtful(drag, friction, creep, prices=(900.0, 40.0, 300.0), white=True) == []
