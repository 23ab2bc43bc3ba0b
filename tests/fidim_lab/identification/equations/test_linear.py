"""Least squares, instruments and the test between them, on regressors whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import least_squares, linear
from fidim_lab.identification.equations.instruments import instrumented
from fidim_lab.identification.equations.linear import Hausman, Sampled
from fidim_lab.identification.equations.problem import build
from fidim_lab.identification.motion.recipe import BEST

THETA = np.array([0.3, -0.2, 0.5, 0.4, 0.6, 0.2, 0.01, -0.3, 0.25])


def windows(*, noise_of_x: float = 0.0, other: float = 0.1, seed: int = 0, count: int = 6, correlated: bool = False):
    """y = X θ + `other`, seen through X + `noise_of_x`; Z is the true X, but for its own noise."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        X = random.standard_normal((120, 2, 9))
        e = other * random.standard_normal((120, 2))
        if correlated:  # neighbours alike, as after a low-pass
            e = (e + np.roll(e, 1, axis=0) + np.roll(e, 2, axis=0)) / np.sqrt(3)
        y = X @ THETA + e
        seen = X + noise_of_x * random.standard_normal(X.shape)
        Z = X + 0.05 * random.standard_normal(X.shape)
        found.append(Sampled(np.concatenate([-y[..., None], seen], axis=2), Z, 2))
    return found


def plain(sampled):
    return [Sampled.plain(w.W, w.rank) for w in sampled]


def test_least_squares_is_the_textbook_one():
    sampled = plain(windows())
    W = np.concatenate([w.W.reshape(-1, 10) for w in sampled])
    expected = np.linalg.lstsq(W[:, 1:], -W[:, 0], rcond=None)[0]
    found = linear.fit(sampled)
    np.testing.assert_allclose(found.values, expected, atol=1e-12)
    white = 0.1**2 * np.linalg.inv(W[:, 1:].T @ W[:, 1:])
    np.testing.assert_allclose(found.sd, np.sqrt(np.diag(white)), rtol=0.2)
    assert linear.residual_sd(sampled, found.values) == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("correlated", [False, True])
def test_stated_sd_is_what_repetition_shows(correlated):
    fits = [linear.fit(windows(seed=seed, correlated=correlated)) for seed in range(80)]
    spread = np.sqrt(np.mean([(f.values - THETA) ** 2 for f in fits], axis=0))
    np.testing.assert_allclose(np.mean([f.sd for f in fits], axis=0), spread, rtol=0.25)


def test_noise_in_the_regressor_shrinks_least_squares_and_leaves_instruments_alone():
    sampled = windows(noise_of_x=0.5, count=40)
    shrunk = linear.fit(plain(sampled)).values
    np.testing.assert_allclose(shrunk, THETA / (1 + 0.5**2), atol=0.03)
    found = linear.fit(sampled)
    assert np.abs((found.values - THETA) / found.sd).max() < 3.5
    assert linear.strength(sampled) > 0.8


def test_hausman_rejects_as_often_as_its_level_says_where_the_regressor_is_exact():
    """X goes with Z but for something that has nothing to do with the errors: hypothesis zero holds."""
    p = np.array([linear.hausman(windows(seed=seed, correlated=seed % 2 == 0)).p for seed in range(160)])
    assert 0.01 < np.mean(p < 0.05) < 0.12
    assert np.mean(p < 0.5) == pytest.approx(0.5, abs=0.12)


def test_hausman_sees_a_bias_and_says_how_large():
    verdict = linear.hausman(windows(noise_of_x=0.5))
    assert verdict.p < 1e-6
    assert verdict.dof == 9
    assert verdict.biased
    assert "Least squares is biased" in verdict.sentence()
    assert f"χ² = {verdict.statistic:.1f} with 9 degrees of freedom, p" in verdict.sentence()
    assert verdict.parameter in verdict.sentence()


@pytest.mark.parametrize(
    ("p", "shift", "says"),
    [(0.4, 5.0, "No sign"), (1e-5, 0.3, "at most 0.30 sd (s_z): it does not matter"), (1e-5, 3.0, "biased")],
)
def test_three_verdicts(p, shift, says):
    assert says in Hausman(12.3, 9, p, shift, "s_z").sentence()


def test_windows_of_worse_equations_count_less():
    good, bad = windows(count=5), windows(count=1, other=3.0, seed=9)
    evened = linear.evened(plain([*good, *bad]))
    sizes = [np.sqrt(np.mean(linear.residual(w, THETA) ** 2)) for w in evened]
    np.testing.assert_allclose(sizes, sizes[0], rtol=0.1)
    far = np.abs(linear.fit(evened).values - linear.fit(plain(good)).values)
    unweighted = np.abs(linear.fit(plain([*good, *bad])).values - linear.fit(plain(good)).values)
    assert far.max() < 0.3 * unweighted.max()


def test_compressed_windows_answer_the_same_and_a_dropped_parameter_is_zero():
    sampled = windows(noise_of_x=0.2)
    rows = sum(w.rows for w in sampled)
    small = np.concatenate([linear.compressed(w) for w in sampled])
    np.testing.assert_allclose(linear.solve(small, rows), linear.fit(sampled).values, atol=1e-12)
    kept = np.arange(9) != 6
    without = linear.fit(sampled, kept)
    assert without.values[6] == 0
    assert without.sd[6] == 0
    np.testing.assert_allclose(without.values[kept], linear.fit(sampled).values[kept], atol=0.02)


def test_what_the_motion_does_not_excite_is_named():
    sampled = plain(windows())
    for w in sampled:
        w.W[..., 9] = 2.0 * w.W[..., 8]
    with pytest.raises(RefusedError, match=r"I_xz, I_yz|I_yz, I_xz"):
        linear.fit(sampled)
    with pytest.raises(RefusedError, match="too few usable samples"):
        linear.solve(np.ones((4, 19)), 8)
    with pytest.raises(RefusedError, match="not numbers"):
        linear.solve(np.full((30, 19), np.nan), 30)


def test_instruments_are_the_true_regressor(recorded, true_body):
    """With the true body they agree with the regressor of the noise-free recording, far below the noise."""
    noisy, clean = build(recorded(noise=3e-4), BEST), build(recorded(), BEST)
    made = instrumented(noisy, noisy.mechanism, noisy.equations[:2], true_body, true_body)
    assert made.missing == ()
    for sampled, truth in zip(made.windows, clean.equations, strict=False):
        X = truth.decimated(true_body)[..., 1:]
        assert len(sampled.Z) == len(X)
        noise = np.linalg.norm(sampled.W[..., 1:] - X)
        assert np.linalg.norm(sampled.Z - X) < 0.2 * noise


def test_a_window_that_cannot_be_simulated_is_named(recorded, true_body):
    problem = build(recorded(noise=1e-4), BEST)
    heavy = Body(-3.0 * true_body.com, true_body.inertia)  # G above the attachments: it tips over
    made = instrumented(problem, problem.mechanism, problem.equations[:1], heavy, true_body)
    assert made.missing == ("w1",)


def test_both_methods_find_the_body_and_instruments_mend_the_bias(recorded, true_body):
    """0.6 mm noise: least squares is off by several sd, instruments are not."""
    problem = build(recorded(noise=6e-4), BEST)
    ls, iv = least_squares.estimate_ls(problem), least_squares.estimate_iv(problem)
    off = {name: np.abs((e.values - true_body.vector) / e.sd).max() for name, e in (("ls", ls), ("iv", iv))}
    assert off["iv"] < 4
    assert off["ls"] > off["iv"]
    assert any("Durbin–Wu–Hausman: χ² = " in note for note in ls.notes)
    assert any("Durbin–Wu–Hausman: χ² = " in note for note in iv.notes)
    assert iv.leave_one_out is not None
    assert iv.sd_bootstrap is not None
    assert iv.noise_ratio == pytest.approx(6.0, rel=0.2)  # the robot file says 0.1 mm


def test_instruments_need_lengths(recorded):
    campaign = recorded(noise=1e-4, cluster=True)
    blind = replace(campaign, windows=tuple(replace(w, lengths=None) for w in campaign.windows))
    problem = build(blind, BEST)
    with pytest.raises(RefusedError, match="no instruments"):
        least_squares.estimate_iv(problem)
    assert any("cannot be tested" in note for note in least_squares.estimate_ls(problem).notes)
