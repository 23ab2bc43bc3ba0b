"""What is told of a search: names with their sizes, and whether each is the only one."""

from dataclasses import replace

import pytest

from fidim_lab.mismatch.conclusion import message
from fidim_lab.mismatch.conclusion.verdict import judge
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import refit
from fidim_lab.mismatch.scores.views import view
from fidim_lab.mismatch.selection.candidates import candidate
from fidim_lab.mismatch.selection.select import Selection


@pytest.fixture(scope="module")
def dragged(baseline_of):
    """A baseline, and the search that ended with the drag of rotation that was hidden (340 sd)."""
    start = baseline_of("rotational-drag:c=0.02", seed=7, windows=4, seconds=4.0)
    drag = next(h for h in start.tried.direct if h.effect.id == "rotational-drag")
    model = refit(start.whole_ground, start.as_it_is.fit, [drag], [drag.absent], start.context)
    assert model is not None
    seen = view(model, start.tried, start.context)
    before, best = candidate(start.as_it_is, start.predicted), candidate(model, predict(model, start.held_out))
    return start, Selection(best, before, (best, before), (), seen, seen)


@pytest.mark.parametrize(("faint", "single"), [(30.0, True), (1000.0, False)])
def test_an_effect_so_faint_that_what_is_not_listed_could_be_it_is_not_the_only_name(
    dragged, monkeypatch: pytest.MonkeyPatch, faint: float, single: bool
) -> None:
    start, found = dragged
    monkeypatch.setattr(message, "CONCLUSION", replace(message.CONCLUSION, message_faint=faint))
    (cause,) = message.tell(start, found, judge(found), 0.0).effects
    assert cause.id == "rotational-drag"
    assert cause.single is single
