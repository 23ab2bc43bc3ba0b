"""What could stand instead of a term that a search has taken, on a campaign of another simulator."""

import pytest

from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, evidence, refit
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.scores.views import View, view
from fidim_lab.mismatch.selection.candidates import common_scale
from fidim_lab.mismatch.selection.confounders import imitators, in_their_place
from fidim_lab.mismatch.selection.search import Search, SearchState
from fidim_lab.mismatch.selection.select import _with_imitators
from fidim_lab.mismatch.selection.thresholds import SELECTION

RATE = 0.004
HIDDEN = (f"clock-rate:rate={RATE}", "air-drag-linear:c=0.5")


@pytest.fixture(scope="module")
def start(baseline_of) -> Baseline:
    """Of a short campaign whose clock runs fast, with some drag."""
    return baseline_of(*HIDDEN, seed=5, windows=4, seconds=4.0)


def term(start: Baseline, id: str) -> Hypothesis:
    return next(h for h in start.tried.direct if h.effect.id == id)


def fitted(start: Baseline, *ids: str) -> Completed:
    tried = [term(start, id) for id in ids]
    found = refit(start.whole_ground, start.as_it_is.fit, tried, [h.absent for h in tried], start.context)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def forced(start: Baseline) -> View:
    """What is seen beside a force that was taken for the clock."""
    return view(fitted(start, "constant-force", "air-drag-linear"), start.tried, start.context)


def test_a_clock_imitates_an_upward_force_and_says_at_what_rate(forced: View) -> None:
    found = {one.tried.effect.id: one for one in imitators(forced, 0)}
    clock = found["clock-rate"]
    assert clock.loss < 5.0 < 0.02 * clock.whole
    assert clock.theta[0] == pytest.approx(RATE, rel=0.1)
    assert found["loose-mass"].loss > 0.1 * clock.whole
    assert "constant-force" not in found


def test_the_best_comes_first_and_each_effect_once(forced: View) -> None:
    found = imitators(forced, 1)
    losses = [one.loss for one in found]
    assert losses == sorted(losses)
    assert len({one.tried.effect.id for one in found}) == len(found)
    assert max(losses) <= found[0].whole + 1e-9


def test_the_imitator_takes_the_place_with_less_freedom(start: Baseline, forced: View) -> None:
    said: list[str] = []
    (found,) = in_their_place(forced, start.whole_ground, said.append)
    assert [h.effect.id for h in found.tried] == ["clock-rate", "air-drag-linear"]
    assert "clock-rate instead of constant-force" in said[0]
    assert evidence(found, forced.model, common_scale([found, forced.model])) > 5.0
    assert found.thetas[0][0] == pytest.approx(RATE, rel=0.1)


def test_a_term_alone_was_chosen_beside_its_rivals_already(start: Baseline) -> None:
    alone = view(fitted(start, "constant-force"), start.tried, start.context)
    assert in_their_place(alone, start.whole_ground, lambda _: None) == []


@pytest.fixture(scope="module")
def rubbing(baseline_of) -> Baseline:
    """Of a short campaign with friction where the cables are attached, and some drag."""
    return baseline_of("attachment-friction:dry=0,viscous=0.01", HIDDEN[1], seed=7, windows=4, seconds=4.0)


def rubbing_at(start: Baseline, *cables: int) -> Completed:
    """As fitted with friction at these cables alone."""
    rubs = [h for h in start.tried.direct if h.effect.id == "attachment-friction" and h.effect.cable in cables]
    tried = [*rubs, term(start, "air-drag-linear")]
    found = refit(start.whole_ground, start.as_it_is.fit, tried, [h.absent for h in tried], start.context)
    assert found is not None
    return found


@pytest.mark.slow
def test_what_was_found_on_one_cable_may_be_on_all_of_them(rubbing: Baseline) -> None:
    single = rubbing_at(rubbing, 1)
    one, seen = single.tried[0], view(single, rubbing.tried, rubbing.context)
    everywhere = in_their_place(seen, rubbing.whole_ground, lambda _: None, SELECTION.search_siblings)
    found = next(m for m in everywhere if (m.tried[0].effect.id, m.tried[0].effect.cable) == (one.effect.id, None))
    assert evidence(found, single, common_scale([found, single])) > 5.0


@pytest.mark.slow
def test_what_was_taken_for_a_turned_frame_may_be_one_cable(baseline_of) -> None:
    start = baseline_of("attachment-offset:dx=-3e-4,dz=-2e-4,cable=2", HIDDEN[1], seed=7, windows=4, seconds=4.0)
    seen = view(fitted(start, "frame-misalignment", "air-drag-linear"), start.tried, start.context)
    assert min(one.loss for one in imitators(seen, 0)) > 20.0
    offset, *_ = imitators(seen, 0, any_cable=True)
    assert (offset.tried.effect.id, offset.tried.effect.cable) == ("attachment-offset", 2)
    assert offset.loss < -20.0
    found = in_their_place(seen, start.whole_ground, lambda _: None)[0]
    assert (found.tried[0].effect.id, found.tried[0].effect.cable) == ("attachment-offset", 2)
    assert found.thetas[0][[0, 2]] == pytest.approx([-3e-4, -2e-4], abs=5e-5)  # y: across the cable


@pytest.mark.slow
def test_what_the_imitator_makes_needless_is_dropped(rubbing: Baseline) -> None:
    both = rubbing_at(rubbing, 1, 2)
    search = Search(rubbing, lambda _: None, False, Budget())
    standing = _with_imitators(search, SearchState(search.trials.judged(both), search.trials.look(both)))
    best, seen = standing.best, standing.last
    found = {(h.effect.id, h.effect.cable) for h in best.model.tried}
    assert found == {("attachment-friction", None), ("air-drag-linear", None)}
    assert seen.model is best.model
    assert best in search.trials.tried
