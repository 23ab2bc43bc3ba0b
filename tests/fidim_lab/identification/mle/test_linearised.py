"""Evidence from the linearised sum of squares, against that of the same Gaussian model worked out whole."""

import numpy as np
import pytest

from fidim_lab.identification.mle.evidence import FACTORS, SPREAD_OF_FACTORS, Linearised, as_wide
from fidim_lab.model.sensitivity.equations import BODY

ROWS, THETA = 60, 5
Design = tuple[np.ndarray, np.ndarray]


@pytest.fixture
def design() -> Design:
    """J (rows, body and θ) and y."""
    rng = np.random.default_rng(4)
    return rng.standard_normal((ROWS, BODY + THETA)), 2.0 * rng.standard_normal(ROWS)


def linearised(matrix: np.ndarray, data: np.ndarray, at: np.ndarray) -> Linearised:
    residual = matrix @ at - data
    return Linearised(float(residual @ residual), ROWS - BODY, matrix.T @ matrix, matrix.T @ residual, at[BODY:].copy())


def marginal(matrix: np.ndarray, data: np.ndarray, sd: np.ndarray, temper: float) -> float:
    """ln of the marginal likelihood of body (flat prior) and θ (normal), up to what all models share."""
    covariance = temper * np.eye(ROWS) + matrix[:, BODY:] @ np.diag(sd**2) @ matrix[:, BODY:].T
    weight = np.linalg.inv(covariance)
    body = matrix[:, :BODY]
    inner = body.T @ weight @ body
    left = data - body @ np.linalg.solve(inner, body.T @ weight @ data)
    logdets = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
    return -0.5 * float(data @ weight @ left + logdets)


@pytest.mark.parametrize("temper", [1.0, 3.0])
def test_differences_of_evidence_are_those_of_marginal_likelihoods(design: Design, temper: float) -> None:
    matrix, data = design
    problem = linearised(matrix, data, np.full(BODY + THETA, 0.3))
    sd = np.array([0.5, 1.0, 2.0, 0.1, 0.2])
    every = np.ones(BODY + THETA, dtype=bool)
    some = every & ~np.isin(np.arange(BODY + THETA), [BODY, BODY + 3])
    found = problem.where(every, sd, temper).nats(temper) - problem.where(some, sd, temper).nats(temper)
    less = matrix[:, some], data, sd[some[BODY:]], temper
    assert found == pytest.approx(marginal(matrix, data, sd, temper) - marginal(*less), rel=1e-9)


def test_what_is_held_does_nothing(design: Design) -> None:
    matrix, data = design
    problem = linearised(matrix, data, np.full(BODY + THETA, 0.3))
    body = np.arange(BODY + THETA) < BODY
    there = problem.where(body, np.ones(THETA), 1.0)
    best = np.linalg.lstsq(matrix[:, :BODY], data, rcond=None)[0]
    assert there.left == pytest.approx(float(((matrix[:, :BODY] @ best - data) ** 2).sum()))
    assert there.strain == 0.0


def test_noise_is_what_the_best_point_leaves(design: Design) -> None:
    matrix, data = design
    problem = linearised(matrix, data, np.zeros(BODY + THETA))
    there, temper = problem.settled(np.full(THETA, 10.0))
    assert temper == pytest.approx(there.left / problem.dof, rel=1e-3)


@pytest.mark.parametrize("seen", [1, 2, 12])
def test_what_is_not_seen_is_within_three_sd_however_few_pieces_tell_how_far_they_are_off(seen: int) -> None:
    """By the likeliest factor a marker was 7.6 ± off across what two cables show of it, with exit 0."""
    random, outside, by_likeliest, draws = np.random.default_rng(1), 0, 0, 3000
    prior = -0.5 * (np.log(FACTORS) / SPREAD_OF_FACTORS) ** 2
    for factor in np.exp(SPREAD_OF_FACTORS * random.standard_normal(draws)):
        off = factor * random.standard_normal(seen + 1)
        odds = prior - seen * np.log(FACTORS) - 0.5 * float(off[1:] @ off[1:]) / FACTORS**2
        outside += abs(off[0]) > 3 * as_wide(odds, FACTORS)
        by_likeliest += abs(off[0]) > 3 * FACTORS[np.argmax(odds)]
    assert outside / draws < 0.008  # 0.003 and what 3000 draws scatter by, three times
    assert by_likeliest > 3 * outside or seen > 2
