"""Which models of the first seconds are fitted to whole windows, in which order."""

from types import SimpleNamespace

import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis, hypotheses
from fidim_lab.mismatch.selection import whole_windows as module


@pytest.mark.parametrize(
    ("white", "left", "expected", "hopeless"),
    [
        # whether the pair leaves only noise of the first seconds; what is left by it, by one of it and by another term;
        # what is fitted to whole windows, two at once where the first is doubtful; from where on that is in vain
        (True, (40.0, 35.0, 50.0), ["a + b", "c"], 30.0),
        (False, (40.0, 35.0, 50.0), ["a + b", "c"], 30.0),
        (True, (2.0, 2.0, 2.0), ["a + b", "a", "c"], 30.0),
        (False, (2.0, 2.0, 2.0), ["a + b", "c", "a"], 30.0),
        (True, (None, 2.0, 2.0), ["a + b", "a", "c"], 30.0),  # not found at all says nothing of others
        (True, (4.0, 2.0, 2.0), ["a + b", "c"], 3.0),
    ],
)
def test_a_model_with_fewer_terms_than_one_that_was_hopeless_is_not_fitted(
    irma4: Robot,
    monkeypatch: pytest.MonkeyPatch,
    white: bool,
    left: tuple[float | None, ...],
    expected: list[str],
    hopeless: float,
) -> None:
    ids = ("air-drag-linear", "swivel-friction", "rotational-drag")
    a, b, c = (next(h for h in hypotheses(irma4).direct if h.effect.id == id) for id in ids)
    whole = dict(zip([(a, b), (a,), (c,)], left, strict=True))
    short = [
        SimpleNamespace(tried=tried, excess=1.1, label=" + ".join("abc"[(a, b, c).index(h)] for h in tried), fit=None)
        for tried in whole
    ]
    for one in short:
        one.thetas, one.is_white = [], white
    said: list[str] = []

    def refit(ground: object, donor: object, tried: tuple[Hypothesis, ...], *_: object, **__: object) -> object:
        return None if whole[tried] is None else SimpleNamespace(excess=whole[tried], tried=tried)

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "widened", lambda start, found, tried: found)
    monkeypatch.setattr(module, "accepted", lambda baseline, fresh, **_: None)
    trials = SimpleNamespace(
        tried=[],
        pruned=lambda found: found,
        judged_or_wider=lambda found, new: SimpleNamespace(is_white=False, model=found),
    )
    start, baseline = SimpleNamespace(whole_ground=None, context=None), SimpleNamespace(model=None)
    stage = module.WholeWindows(start, said.append, Budget(), trials, hopeless)  # type: ignore[arg-type]
    best, followed = stage.best(baseline, short)  # type: ignore[arg-type]
    assert best is baseline
    assert followed is (2.0 in left)
    assert said == [f"fitting {label} to whole windows" for label in expected]
