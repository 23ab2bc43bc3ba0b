"""What is united over the first seconds; hands that only a completed model shows."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.selection import search as module
from fidim_lab.mismatch.selection.candidates import Candidate, candidate
from fidim_lab.mismatch.selection.search import Search
from fidim_lab.mismatch.selection.select import Selection, select


def test_one_optimum_that_was_found_twice_is_fitted_to_whole_windows_once(
    quiet: Baseline, claim: Callable[..., Candidate]
) -> None:
    a, b = quiet.tried.direct[:2]
    models = [
        claim(*tried, fitted=left).model
        for tried, left in [((a,), 1.0), ((a,), 1.00001), ((b,), 1.0), ((a,), 1.01), ((a, b), 1.0)]
    ]
    assert abs(models[1].chi2 - models[0].chi2) < 1.0 < models[3].chi2 - models[0].chi2
    assert module._distinct(models) == [models[0], models[2], models[3], models[4]]


@pytest.mark.parametrize(
    ("id", "white", "united"),
    [("air-drag-linear", True, False), ("air-drag-linear", False, True), ("umbilical", True, True)],
    ids=["a drag that leaves noise", "a drag that leaves more", "a hose that leaves noise"],
)
def test_terms_are_united_but_where_one_of_little_freedom_leaves_only_noise(
    quiet: Baseline,
    searched: Selection,
    claim: Callable[..., Candidate],
    monkeypatch: pytest.MonkeyPatch,
    id: str,
    white: bool,
    united: bool,
) -> None:
    """A hose may have taken the share of another term; a drag has nothing to give back."""
    term = next(h for h in quiet.tried.direct if h.effect.id == id)
    found = claim(term).model
    monkeypatch.setattr(Completed, "is_white", white)
    asked: list[bool] = []
    monkeypatch.setattr(module, "Completed", lambda *_, **__: found)
    search = Search(quiet, lambda _: None, False, Budget(patience=-1.0))
    monkeypatch.setattr(search, "_together", lambda: asked.append(True) or [])
    monkeypatch.setattr(search.trials, "look", lambda _: replace(searched.first, singles=()))
    assert search.over_first_seconds(lambda _: False) == ([found], None)
    assert bool(asked) is united


SOFT = "hand-contact:fx=0.4,fy=-0.32,start=2.3,stop=3.5,window=0"


@pytest.mark.slow
def test_a_soft_hand_at_the_same_time_of_every_window_is_found_beside_other_effects(baseline_of) -> None:
    """The markers sit elsewhere, which by itself leaves more of every segment than the hand does."""
    start = baseline_of(SOFT, "marker-offset:dx=0.01,dy=-0.008", seed=41, windows=5, seconds=8.0)
    term = next(h for h in start.tried.direct if h.effect.id == "marker-offset")
    model = refit(start.whole_ground, start.fit, [term], [term.absent], start.context)
    assert model is not None
    best = candidate(model, predict(model, start.held_out))
    found = Search(start, lambda _: None, True, Budget())._pushes_alike(best)
    assert {contact.window for contact in found} == {window.id for window in start.campaign.windows}
    for contact in found:
        assert contact.begin < 2.3
        assert contact.end > 3.5
    assert Search(start, lambda _: None, False, Budget())._pushes_alike(best) == ()


@pytest.mark.slow
@pytest.mark.parametrize("window", [0, 3], ids=["of every window", "of one window"])
def test_a_strong_hand_is_found_beside_soft_cables_that_only_the_first_seconds_show(baseline_of, window: int) -> None:
    """The model as it is leaves more of every segment than the hand does, and no whole window is followed."""
    hand = f"hand-contact:fx=5.0,fy=0.4,start=3.7,stop=4.6,window={window}"
    start = baseline_of(hand, "cable-elasticity:EA=1.2e5,c=60", seed=43, windows=5, seconds=8.0)
    search = Search(start, lambda _: None, look_for_pushes=True, budget=Budget())
    baseline = candidate(start.as_it_is, start.predicted)
    _, hands = search.best_over_all(baseline, search.over_first_seconds(lambda _: False)[0])
    every = [one.id for one in start.campaign.windows]
    assert [push.window for push in hands] == (every if window == 0 else [every[window - 1]])
    for push in hands:
        assert 3.2 < push.begin < 3.8
        assert 4.4 < push.end < 5.0


@pytest.mark.slow
def test_what_came_first_is_found_anew_once_the_others_are_there(baseline_of) -> None:
    """Alone, a moved attachment is best in a length's place, and a loose mass at a frequency that is not its own."""
    start = baseline_of(
        "marker-offset:dx=-0.0004,dy=0.0008,dz=-0.0005",
        "cable-length-bias:bias=0.0037,cable=1",
        "loose-mass:m=0.1,f=2.4,zeta=0.04,bx=0.02,by=0.05,bz=0.1",
        seed=44,
        windows=8,
        seconds=6.0,
    )
    best = Search(start, lambda _: None, look_for_pushes=True, budget=Budget()).over_first_seconds(lambda _: False)[0][
        0
    ]
    found = {(h.effect.id, h.effect.cable): theta for h, theta in zip(best.tried, best.thetas, strict=True)}
    assert set(found) == {("marker-offset", None), ("cable-length-bias", 1), ("loose-mass", None)}
    assert found["loose-mass", None][1] == pytest.approx(2.4, rel=0.1)


def test_a_known_model_is_not_taken_up_where_nothing_is_missing(
    quiet: Baseline, claim: Callable[..., Candidate]
) -> None:
    known = claim(next(h for h in quiet.tried.direct if h.effect.id == "rotational-drag")).model
    assert not select(quiet, lambda _: None, known=known).best.model.tried
