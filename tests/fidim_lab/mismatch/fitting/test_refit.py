"""What the freedom of a model's terms costs."""

from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import hypotheses
from fidim_lab.mismatch.linearised.thresholds import LINEARISED
from fidim_lab.model.sensitivity.equations import BODY

SPREADS = (1e-4, 1e-3)


def model(irma4: Robot, correlation: float) -> Completed:
    """Two terms of one parameter each, with posterior spreads of these parts of the prior ones, correlated so."""
    ids = ("air-drag-linear", "swivel-damping")
    tried = tuple(next(h for h in hypotheses(irma4).direct if h.effect.id == id) for id in ids)
    assert [len(h.effect.parameters) for h in tried] == [1, 1]
    sd = np.array(
        [
            part * LINEARISED.hypotheses_broad * h.effect.parameters[0].scale
            for part, h in zip(SPREADS, tried, strict=True)
        ]
    )
    covariance = np.eye(BODY + 2)
    covariance[BODY:, BODY:] = np.outer(sd, sd) * np.array([[1.0, correlation], [correlation, 1.0]])
    return Completed(tried, SimpleNamespace(covariance=covariance), whole=True)  # type: ignore[arg-type]


def test_terms_told_apart_cost_what_each_costs(irma4: Robot) -> None:
    assert model(irma4, 0.0).freedom(1.0) == pytest.approx(-np.log(SPREADS).sum())
    assert model(irma4, 0.0).freedom(4.0) == pytest.approx(-np.log(SPREADS).sum() - 2 * np.log(2.0))


def test_terms_of_which_the_sum_is_told_cost_more_than_their_spreads_say(irma4: Robot) -> None:
    apart, together = model(irma4, 0.0), model(irma4, -0.999999)
    assert together.freedom(1.0) == pytest.approx(apart.freedom(1.0) - 0.5 * np.log(1 - 0.999999**2), rel=1e-6)


def test_what_is_not_told_at_all_costs_nothing(irma4: Robot) -> None:
    one = model(irma4, 0.0)
    one.fit.covariance[BODY:, BODY:] *= 1e12
    assert one.freedom(1.0) == 0.0
    one.fit.covariance[BODY, BODY] = np.inf
    assert one.freedom(1.0) == 0.0
