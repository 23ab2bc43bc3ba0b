"""A wider form of an effect counts only within its own range."""

from collections.abc import Callable

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import general, hypotheses
from fidim_lab.mismatch.selection import generalise
from fidim_lab.mismatch.selection.candidates import Candidate


@pytest.mark.parametrize("at_an_edge", [True, False])
@pytest.mark.parametrize("whole", [True, False])
def test_a_form_that_ends_at_the_edge_of_its_range_is_none(
    irma4: Robot,
    quiet: Baseline,
    claim: Callable[..., Candidate],
    monkeypatch: pytest.MonkeyPatch,
    whole: bool,
    at_an_edge: bool,
) -> None:
    """Two drags of the air together press the exponent of a flatter one against 0.75: they are two drags."""
    linear = next(h for h in hypotheses(irma4).direct if h.effect.id == "air-drag-linear")
    ((flat, theta),) = linear.effect.wider(np.array([0.1]), irma4)
    simple = claim(linear, fitted=2.0, whole=whole, theta=np.array([0.1])).model
    wide = claim(general(linear, flat, theta), fitted=1.2, whole=whole, theta=theta, at_an_edge=at_an_edge).model

    def refit(*asked: object, simpler: Completed | None = None) -> Completed:
        del simpler
        return simple if asked[2] == simple.tried else wide

    monkeypatch.setattr(generalise, "refit", refit)
    monkeypatch.setattr(generalise, "in_place_of", lambda *_: wide)
    assert generalise.general_forms(quiet, simple, {linear.effect}) == ([] if at_an_edge else [wide])
