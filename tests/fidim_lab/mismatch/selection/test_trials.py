"""What is fitted on trial, and what is not fitted again."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, general, hypotheses
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.selection import trials as module
from fidim_lab.mismatch.selection.additions import Addition
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.selection.trials import Trials

NOTHING_TRIED = Hypotheses((), (), ())


Models = Callable[..., Completed]


@pytest.fixture(scope="module")
def start(quiet: Baseline) -> Baseline:
    """Beside which no other form of an effect is tried."""
    return replace(quiet, tried=NOTHING_TRIED)


@pytest.fixture(scope="module")
def model(claim: Callable[..., Candidate]) -> Models:
    """With these terms, and this χ²/dof."""

    def made(*tried: Hypothesis, left: float = 1.0, whole: bool = True, theta: np.ndarray | None = None) -> Completed:
        return claim(*tried, fitted=left, whole=whole, theta=theta).model

    return made


def hypothesis(robot: Robot, id: str) -> Hypothesis:
    every = hypotheses(robot)
    return next(h for h in (*every.direct, *every.periodic) if h.effect.id == id)


@pytest.mark.parametrize(
    ("ids", "whole", "fits"),
    [
        (("air-drag-linear", "gravity-tilt"), True, 1),
        (("air-drag-linear", "gravity-tilt"), False, 2),  # over the first seconds fits cost little
        (("air-drag-linear", "periodic-force"), True, 2),  # another frequency is another optimum
    ],
)
def test_pruning_fits_the_same_terms_of_whole_windows_once(
    irma4: Robot,
    start: Baseline,
    model: Models,
    monkeypatch: pytest.MonkeyPatch,
    ids: tuple[str, str],
    whole: bool,
    fits: int,
) -> None:
    first, second = (hypothesis(irma4, id) for id in ids)
    asked: list[tuple[Hypothesis, ...]] = []

    def refit(ground: object, donor: object, tried: list[Hypothesis], *_: object) -> Completed:
        asked.append(tuple(tried))
        return model(*tried, whole=whole)

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "price", lambda model, k: 1.0)
    trials = Trials(start, lambda _: None, Budget())
    pair = model(first, second, whole=whole)
    kept = [trials.keeping(pair, [1]) for _ in range(2)]
    assert [one.tried for one in kept if one] == [(second,)] * 2
    assert len(asked) == fits
    trials.keeping(pair, [0])
    assert asked[-1] == (first,)


@pytest.mark.parametrize(("price", "fits"), [(0.1, 2), (180.0, 1)], ids=["of nothing", "of what is needed"])
def test_a_fit_that_ended_far_before_its_optimum_is_made_again_from_a_better_one(
    irma4: Robot, start: Baseline, model: Models, monkeypatch: pytest.MonkeyPatch, price: float, fits: int
) -> None:
    """Without a term that says next to nothing as much cannot be left as an earlier fit of the others has."""
    drag, tilt = (hypothesis(irma4, id) for id in ("umbilical", "gravity-tilt"))
    left = iter([1.06, 1.059, 1.0] if fits == 2 else [1.06, 1.0])  # going on from where it ended does not help

    def refit(ground: object, donor: object, tried: list[Hypothesis], *_: object) -> Completed:
        return model(*tried, left=next(left))

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "price", lambda model, k: price)
    trials = Trials(start, lambda _: None, Budget())
    both = model(drag, tilt)
    kept = [trials.keeping(both, [0]) for _ in range(3)]
    reached = [one.fit.chi2_per_dof for one in kept if one]
    assert reached == pytest.approx([1.06, *([1.0] * 2 if fits == 2 else [1.06] * 2)])


def test_a_fit_that_ended_far_before_its_optimum_goes_on_as_long_as_that_helps(
    irma4: Robot, start: Baseline, model: Models, monkeypatch: pytest.MonkeyPatch
) -> None:
    tone, mass = (hypothesis(irma4, id) for id in ("periodic-force", "umbilical"))
    begun: list[float] = []
    left = iter([1.5, 1.2, 1.01, 1.005])

    def refit(ground: object, donor: Fit, tried: list[Hypothesis], *_: object) -> Completed:
        begun.append(donor.chi2_per_dof)
        return model(*tried, left=next(left))

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "price", lambda model, k: 0.1)
    trials = Trials(start, lambda _: None, Budget())
    both = model(tone, mass)
    found = trials.keeping(both, [0])
    assert found is not None
    assert found.fit.chi2_per_dof == pytest.approx(1.01)
    assert begun == pytest.approx([1.0, 1.5, 1.2, 1.01])


@pytest.mark.parametrize(
    ("gain", "expected"),
    [(30.0, "whatever the length"), (-30.0, "by length"), (None, "by length")],
)
def test_beside_other_terms_the_form_of_an_effect_that_says_more_is_taken(
    irma4: Robot, start: Baseline, model: Models, monkeypatch: pytest.MonkeyPatch, gain: float | None, expected: str
) -> None:
    every = hypotheses(irma4).direct
    soft, tilt = (next(h for h in every if h.effect.id == id) for id in ("cable-elasticity", "frame-misalignment"))
    asked: list[int] = []

    def in_place_of(best: object, k: int, other: Hypothesis, *_: object) -> Completed | None:
        asked.append(k)
        return None if gain is None else model(other, tilt, whole=False)

    def convincing(best: Completed, found: list[Completed]) -> Completed:
        better = gain is not None and gain > 0 and found[0].tried[0].effect.variant == "whatever the length"
        return found[0] if better else best

    monkeypatch.setattr(module, "in_place_of", in_place_of)
    monkeypatch.setattr(module, "most_convincing", convincing)
    trials = Trials(start, lambda _: None, Budget())
    assert soft.effect.variant == "by length"
    found = trials.in_best_form(model(soft, tilt, whole=False))
    assert found.tried[0].effect.variant == expected
    assert found.tried[1] is tilt
    alone = model(soft, whole=False)
    assert alone.is_white
    assert trials.in_best_form(alone) is alone
    assert set(asked) == {0}


@pytest.fixture
def refits(model: Models, monkeypatch: pytest.MonkeyPatch) -> list[list[np.ndarray]]:
    """θ of every fit; no term can be dropped."""
    begun: list[list[np.ndarray]] = []

    def refit(
        ground: object, donor: object, tried: list[Hypothesis], thetas: list[np.ndarray], *_: object, **__: object
    ):
        begun.append(thetas)
        return model(*tried)

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "price", lambda model, k: SELECTION.trials_droppable + 1)
    return begun


@pytest.mark.parametrize(("lost", "expected"), [(1.0, "air-drag-quadratic"), (30.0, "unknown")])
def test_a_wider_form_that_others_have_made_needless_becomes_the_simple_one(
    irma4: Robot,
    start: Baseline,
    model: Models,
    monkeypatch: pytest.MonkeyPatch,
    refits: list,
    lost: float,
    expected: str,
) -> None:
    every = hypotheses(irma4).direct
    simple, tilt = (next(h for h in every if h.effect.id == id) for id in ("air-drag-quadratic", "gravity-tilt"))
    ((effect, theta),) = simple.effect.wider(np.array([0.5]), irma4)
    steep = general(simple, effect, theta)
    monkeypatch.setattr(module, "advantage", lambda model, less: lost)
    trials = Trials(start, lambda _: None, Budget())
    found = trials.pruned(model(steep, tilt))
    assert [h.effect.id for h in found.tried] == [expected, "gravity-tilt"]
    np.testing.assert_allclose(refits[0][0], [0.0])
    alone = model(steep)
    assert trials.pruned(alone) is alone


@pytest.mark.parametrize(
    ("k", "c", "expected"),
    [
        (0.0, 0.05, ["air-drag-linear", "constant-force"]),
        (1e-3, 0.05, ["air-drag-linear", "constant-force"]),  # a hose that ends 200 m away
        (0.0, 0.0, ["constant-force"]),
        (0.5, 0.05, ["umbilical"]),
    ],
)
def test_a_hose_without_a_spring_falls_into_what_it_stands_for(
    irma4: Robot,
    start: Baseline,
    model: Models,
    monkeypatch: pytest.MonkeyPatch,
    refits: list,
    k: float,
    c: float,
    expected: list[str],
) -> None:
    hose = next(h for h in hypotheses(irma4).direct if h.effect.id == "umbilical")
    theta = np.array([k, c, 0.1, 0.15, 0.05, 0.0, 0.0, 0.2])
    found = model(hose, theta=theta)
    monkeypatch.setattr(module, "advantage", lambda model, less: -10.0)
    told = Trials(start, lambda _: None, Budget()).pruned(found)
    assert [h.effect.id for h in told.tried] == expected
    if len(expected) == 2:
        np.testing.assert_allclose(refits[0][0], [c])
        np.testing.assert_allclose(refits[0][1], theta[2:5])


@pytest.mark.parametrize(("cpu", "widened"), [(1e9, 1), (0.0, 0)])
def test_wider_forms_are_not_tried_once_the_budget_is_spent(
    irma4: Robot,
    start: Baseline,
    searched: Selection,
    model: Models,
    monkeypatch: pytest.MonkeyPatch,
    cpu: float,
    widened: int,
) -> None:
    asked: list[object] = []

    def wider(start: object, found: object, new: object) -> object:
        asked.append(new)
        return found

    monkeypatch.setattr(module, "widened", wider)
    monkeypatch.setattr(module, "rest_of", lambda model: 0.0)
    drag = next(h for h in hypotheses(irma4).direct if h.effect.id == "air-drag-quadratic")
    seen = replace(searched.first, model=model())
    monkeypatch.setattr(Addition, "fitted", lambda *_: model(drag))
    addition = Addition(seen, Score((drag,), (np.zeros(1),), 100.0, 40.0))
    trials = Trials(start, lambda _: None, Budget(patience=cpu))
    found = trials.added(addition, [])
    assert found is not None
    assert found.tried == (drag,)
    assert len(asked) == widened
