"""What the freedom of a model's terms costs."""

from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis, hypotheses
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.sensitivity.equations import BODY

SPREADS = (1e-4, 1e-3)


def model(irma4: Robot, correlation: float) -> Completed:
    """Two terms of one parameter each, with posterior spreads of these parts of the prior ones, correlated so."""
    ids = ("air-drag-linear", "swivel-damping")
    tried = tuple(next(h for h in hypotheses(irma4).direct if h.effect.id == id) for id in ids)
    assert [len(h.effect.parameters) for h in tried] == [1, 1]
    sd = np.array([part * SHARED.wide * h.effect.parameters[0].scale for part, h in zip(SPREADS, tried, strict=True)])
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


def sized(irma4: Robot, id: str, values: list[float], covariance: np.ndarray, chi2_per_dof: float = 1.0) -> float:
    """How many sd an effect of these θ is from 0, its θ of this covariance beside a body."""
    tried = next(h for h in hypotheses(irma4).every if h.effect.id == id and len(h.effect.parameters) == len(values))
    whole = np.eye(BODY + len(values))
    whole[BODY:, BODY:] = covariance
    shared = np.concatenate([np.zeros(BODY), values])
    fit = SimpleNamespace(values=shared, covariance=whole, chi2_per_dof=chi2_per_dof)
    return Completed((tried,), fit, whole=True).size_in_sd(0)  # type: ignore[arg-type]


def test_a_term_is_as_large_as_its_amplitude_is_in_sd(irma4: Robot) -> None:
    assert sized(irma4, "air-drag-linear", [0.06], np.array([[0.01**2]])) == pytest.approx(6.0)
    assert sized(irma4, "air-drag-linear", [0.06], np.array([[0.01**2]]), 4.0) == pytest.approx(3.0)


def test_a_force_is_as_large_as_all_its_components_together(irma4: Robot) -> None:
    """Its direction may be open to any extent: along it nothing is lost."""
    along = np.diag([1e-4, 1.0, 1.0])
    assert sized(irma4, "constant-force", [0.06, 0.0, 0.0], along) == pytest.approx(6.0)
    assert sized(irma4, "constant-force", [0.03, 0.04, 0.0], 1e-4 * np.eye(3)) == pytest.approx(5.0)


def test_what_a_scan_settles_is_no_size(irma4: Robot) -> None:
    """A loose mass with a frequency that is known well, and a mass that is not."""
    sd = np.array([0.013, 0.03, 0.01, 0.6, 3.8, 2.7])
    assert sized(irma4, "loose-mass", [0.0157, 4.08, 0.087, 0.03, 0.04, 0.06], np.diag(sd**2)) == pytest.approx(
        1.21, abs=0.01
    )


def test_a_wave_is_as_certain_as_it_is_with_its_phase_held(irma4: Robot) -> None:
    """That of all windows may turn with it: what only this leaves open is no uncertainty of its size."""
    tone = next(one for one in by_id(irma4, "periodic-force") if one.of_each_window)
    tried = Hypothesis(tone, np.zeros(7), tuple(range(6)))
    s, c = np.array([0.3, 0.0, 0.4]), np.array([0.0, 0.1, 0.0])
    turned = np.concatenate([-c, s, [0.0]])
    whole = np.eye(BODY + 7)
    whole[BODY:, BODY:] = 1e-4 * np.eye(7) + np.outer(turned, turned)
    fit = SimpleNamespace(values=np.concatenate([np.zeros(BODY), s, c, [1.2]]), covariance=whole)
    sd = Completed((tried,), fit, whole=True, at_bound=(False,) * 7).theta_of(0)[1]  # type: ignore[arg-type]
    assert np.all((sd > 0.005) & (sd < 0.0101))
