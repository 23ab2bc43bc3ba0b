import numpy as np
import pytest

from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import tls

CHI = np.array([1.0, 0.3, -0.2, 0.5, 0.4, 0.6, 0.2, 0.01, -0.3, 0.25])


def exact(rows=300, seed=0):
    """W with W χ = 0: random rows made orthogonal to χ."""
    W = np.random.default_rng(seed).standard_normal((rows, 10))
    return W - np.outer(W @ CHI, CHI) / (CHI @ CHI)


def noisy(sigma, seed=1, rows=300):
    return exact(rows) + sigma * np.random.default_rng(seed).standard_normal((rows, 10))


def closest_compatible(W):
    """Eq. 29: the matrix of rank 9 that is closest to W in the Frobenius norm."""
    U, s, Vt = np.linalg.svd(W, full_matrices=False)
    return (U[:, :-1] * s[:-1]) @ Vt[:-1]


def test_exact_equations_give_exact_parameters():
    found = tls.solve(exact())
    np.testing.assert_allclose(found.chi, CHI, atol=1e-12)
    assert found.sigma_W < 1e-14


def test_diagonal_case_by_hand():
    """W = diag(10, 9, …, 1) turned so that the last direction is χ: singular values are known."""
    basis = np.linalg.qr(np.column_stack([CHI, np.eye(10)[:, 1:]]))[0]
    V = np.column_stack([basis[:, 1:], basis[:, 0]])
    W = np.vstack([np.diag(np.arange(10.0, 0.0, -1.0)) @ V.T, np.zeros((7, 10))])
    found = tls.solve(W)
    np.testing.assert_allclose(found.singular_values, np.arange(10.0, 0.0, -1.0))
    np.testing.assert_allclose(found.chi, CHI, atol=1e-12)
    assert found.sigma_W == pytest.approx(1 / np.sqrt(17 - 10))  # Eq. 31
    assert pytest.approx((10 + 1) / 2) == found.C  # Eq. 40


def test_closest_compatible_is_eckart_young_and_solved_by_chi():
    W = noisy(0.05)
    near = closest_compatible(W)
    found = tls.solve(W)
    assert np.linalg.matrix_rank(near, tol=1e-9) == 9
    np.testing.assert_allclose(near @ found.chi, 0.0, atol=1e-11)
    distance = np.linalg.norm(W - near)
    assert distance == pytest.approx(found.singular_values[-1])
    random = np.random.default_rng(5)
    for _ in range(20):  # any other χ needs a larger change of W
        other = found.chi + 0.05 * random.standard_normal(10)
        assert np.linalg.norm(W @ other) / np.linalg.norm(other) > distance


def test_covariance_is_equation_32_written_out():
    W = noisy(0.05)
    found = tls.solve(W)
    near = closest_compatible(W)[:, 1:]
    expected = found.sigma_W**2 * (1 + found.values @ found.values) * np.linalg.inv(near.T @ near)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-8)
    np.testing.assert_allclose(found.percent, 100 * found.sd / np.abs(found.values))


def test_stated_sd_is_what_repetition_shows():
    sigma, runs = 0.03, 300
    solutions = [tls.solve(noisy(sigma, seed)) for seed in range(runs)]
    spread = np.std([s.values for s in solutions], axis=0)
    stated = np.mean([s.sd for s in solutions], axis=0)
    np.testing.assert_allclose(spread, stated, rtol=0.15)
    assert np.mean([s.sigma_W for s in solutions]) == pytest.approx(sigma, rel=0.02)
    bias = np.mean([s.values for s in solutions], axis=0) - CHI[1:]
    assert np.abs(bias / (stated / np.sqrt(runs))).max() < 4


def test_common_scale_and_order_of_rows_do_not_matter_but_columns_do():
    W = noisy(0.05)
    found = tls.solve(W)
    scaled = tls.solve(7.0 * W[::-1])
    np.testing.assert_allclose(scaled.values, found.values, atol=1e-12)
    np.testing.assert_allclose(scaled.sd, found.sd, rtol=1e-9)
    factors = np.array([1, 10, 1, 1, 0.1, 1, 1, 1, 1, 1.0])
    columns = tls.solve(W * factors).values * factors[1:]
    assert np.abs(columns - found.values).max() > 0.1 * found.sd.max()


def test_scaling_effect_is_zero_without_noise_and_says_something_with_it():
    W = exact() * np.array([1, 10, 1, 1, 0.1, 1, 1, 1, 1, 1.0])
    np.testing.assert_allclose(tls.scaling_effect(W), 0.0, atol=1e-10)
    random = np.random.default_rng(2)
    effect = tls.scaling_effect(W + 0.05 * random.standard_normal(W.shape))
    assert np.abs(effect).max() > 1e-4


def test_compressing_changes_nothing():
    W = noisy(0.05)
    whole, small = tls.solve(W), tls.solve(tls.compress(W), rows=len(W))
    np.testing.assert_allclose(small.values, whole.values, atol=1e-12)
    np.testing.assert_allclose(small.covariance, whole.covariance, rtol=1e-8)
    assert tls.compress(W).shape == (10, 10)


def test_non_essential_are_small_and_uncertain_only():
    found = tls.solve(noisy(0.2))
    assert found.percent[6] > 10  # I_xy = 0.01 under σ = 0.2
    essential = tls.solve_essential(noisy(0.2), found)
    assert list(np.flatnonzero(tls.non_essential(found))) == [6]
    assert essential is not None
    assert essential.values[6] == 0
    assert essential.sd[6] == 0
    assert not essential.active[6]
    others = [k for k in range(9) if k != 6]
    np.testing.assert_array_less(np.abs(essential.values - found.values)[others], found.sd[others])
    assert tls.solve_essential(exact(), tls.solve(exact())) is None


def test_uncertain_but_large_is_doubtful_not_dropped():
    found = tls.solve(noisy(1.5, rows=400))
    assert set(tls.doubtful(found)) & {"s_x", "s_y", "I_zz"}
    assert not set(np.flatnonzero(tls.non_essential(found))) & {0, 1, 5}


def test_a_parameter_that_was_not_excited_is_named():
    W = exact()
    W[:, 6] = 0.0  # I_zz never enters
    with pytest.raises(RefusedError, match="I_zz"):
        tls.solve(W)


def test_parameters_that_cannot_be_told_apart_are_named_together():
    W = exact()
    W[:, 9] = 2.0 * W[:, 8]
    with pytest.raises(RefusedError, match=r"I_xz, I_yz|I_yz, I_xz"):
        tls.solve(W)


@pytest.mark.parametrize(
    ("W", "says"), [(np.ones((8, 10)), "too few usable samples"), (np.full((30, 10), np.nan), "not numbers")]
)
def test_hopeless_regressors_are_refused(W, says):
    with pytest.raises(RefusedError, match=says):
        tls.solve(W)
