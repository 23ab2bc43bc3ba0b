"""What is made of an optimum: remainders, spread, bodies that can be, outcome and sentences."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Role
from fidim_lab.identification.equations.consistency import can_exist, can_move, pseudo_inertia
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.mle import spread
from fidim_lab.identification.mle.findings import closing
from fidim_lab.identification.mle.judge import remainder
from fidim_lab.identification.mle.starts.possible import distance_to_boundary, nearest_possible, scales
from fidim_lab.identification.mle.trajectories import stages
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation, WindowResidual
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.results.result import ResultOutcome
from fidim_lab.identification.results.validation import QUICK
from fidim_lab.model.slots import Effect

NOISE = 1e-4


def remainder_of(residuals, window, robot):
    """Judge given residuals (T, 1, 3), in m, as those of a window."""
    recording = prepare(window, robot)
    seen = recording.seen_until(recording.end)[1]
    found = WindowResidual(-residuals[seen] / NOISE, np.zeros(4), np.zeros(8))
    simulation = Simulation(None, np.array([recording.end]), (), None, (found,))  # only residuals and ends are used
    return remainder(Likelihood(_Freedoms(), (recording,), None, NOISE, 2e-5), simulation, 0)


class _Freedoms:
    freedoms = 2
    springs = False
    effects = ()


@pytest.mark.parametrize("gap", [False, True])
def test_white_residuals_are_called_white(gap, four, record):
    window = record(four, 1, seconds=2.0)[0]
    if gap:
        markers = window.markers.copy()
        markers[30:60] = np.nan
        window = replace(window, markers=markers)
        kept = np.isfinite(markers).all(axis=(1, 2))
    else:
        kept = np.full(len(window.t), True)
    white = NOISE * np.random.default_rng(3).normal(size=(kept.sum(), 1, 3))
    left = remainder_of(white, window, four)
    assert left.whiteness == pytest.approx(1, abs=0.5)
    assert left.noise == pytest.approx(NOISE, rel=0.1)
    assert left.chi2_per_dof == pytest.approx(1, abs=0.15)
    assert left.rms == pytest.approx(NOISE, rel=0.07)
    np.testing.assert_allclose(left.predicted + left.residuals, window.markers[kept])
    slow = white + 2 * NOISE * np.sin(6 * window.t[kept])[:, None, None]
    coloured = remainder_of(slow, window, four)
    assert coloured.whiteness > 10
    assert coloured.noise == pytest.approx(NOISE, rel=0.1)
    assert coloured.chi2_per_dof > 2


def test_uneven_sampling_leaves_whiteness_unknown(four, record):
    window = record(four, 1)[0]
    t = np.sort(np.random.default_rng(0).uniform(0, 2, len(window.t)))
    left = remainder_of(np.zeros_like(window.markers), replace(window, t=t), four)
    assert left.whiteness is None
    assert left.noise is None


def tables_of(jacobians, residuals):
    return np.stack(
        [np.linalg.qr(np.column_stack([J, r]), mode="r") for J, r in zip(jacobians, residuals, strict=True)]
    )


@pytest.fixture
def linear():
    """Eight windows of a linear problem with three parameters."""
    random = np.random.default_rng(7)
    J = random.normal(size=(8, 50, 3)) * [1.0, 10.0, 0.1]
    r = random.normal(size=(8, 50))
    nothing = np.column_stack([np.zeros((3, 3)), np.zeros(3)])
    return J, r, tables_of(J, r), nothing


def test_quadratic_is_that_of_all_rows(linear):
    J, r, tables, nothing = linear
    stacked, right = J.reshape(-1, 3), r.ravel()
    found = spread.Quadratic.of(tables, nothing)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(stacked.T @ stacked), rtol=1e-9)
    best = np.linalg.lstsq(stacked, -right, rcond=None)[0]
    np.testing.assert_allclose(found.step(np.full(3, True), np.zeros(3)), best, rtol=1e-9)
    held = found.step(np.array([True, False, True]), np.array([9.0, 0.3, 9.0]))
    assert held[1] == 0.3
    free = np.linalg.lstsq(stacked[:, [0, 2]], -right - 0.3 * stacked[:, 1], rcond=None)[0]
    np.testing.assert_allclose(held[[0, 2]], free, rtol=1e-9)


def test_jackknife_is_the_fit_without_each_window(linear):
    J, r, tables, nothing = linear
    found = spread.leave_one_out(tables, nothing, np.ones(3))
    for k in range(8):
        rest = np.delete(np.arange(8), k)
        wanted = 1 + np.linalg.lstsq(J[rest].reshape(-1, 3), -r[rest].ravel(), rcond=None)[0]
        np.testing.assert_allclose(found[k], wanted, rtol=1e-9)
    assert spread.leave_one_out(tables[:2], nothing, np.ones(3)) is None


def test_bootstrap_sees_what_differs_between_windows(linear):
    J, r, tables, nothing = linear
    nominal = np.sqrt(np.diag(spread.Quadratic.of(tables, nothing).covariance))
    np.testing.assert_allclose(spread.bootstrap_sd(tables, nothing) / nominal, 1, atol=0.6)
    shifted = r + 3 * J[:, :, 0] * np.array([1, -1, 1, -1, 1, -1, 1, -1])[:, None]  # parameter 1 differs by ± 3
    sd = spread.bootstrap_sd(tables_of(J, shifted), nothing)
    assert sd[0] == pytest.approx(3 / np.sqrt(8), rel=0.3)
    np.testing.assert_array_equal(sd, spread.bootstrap_sd(tables_of(J, shifted), nothing))


def test_open_combinations_are_named():
    plausible = np.array([0.1, 0.01, 1.0])
    direction = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    scaled = 1e-6 * np.eye(3) + 0.25 * np.outer(direction, direction)
    covariance = scaled * np.outer(plausible, plausible)
    (found,) = spread.open_combinations(covariance, plausible, ("s_x", "s_y", "s_z"))
    assert {name for name, _ in found.weights} == {"s_x", "s_z"}
    assert found.known == pytest.approx(0.5, rel=1e-3)
    assert str(found) == "0.71 s_x +0.71 s_z (in units of what is plausible)" or str(found).startswith("0.71 s_z")
    assert spread.open_combinations(1e-4 * covariance, plausible, ("s_x", "s_y", "s_z")) == ()


@settings(max_examples=60, deadline=None)
@given(arrays(float, 9, elements=st.floats(-0.3, 0.3)))
def test_the_nearest_possible_body_can_move_and_exist(values):
    body = Body.from_vector(values)
    nearest = nearest_possible(body)
    assert can_move(nearest)
    assert can_exist(nearest)
    np.testing.assert_array_equal(nearest.com, body.com)
    assert nearest_possible(nearest) is nearest or np.allclose(nearest_possible(nearest).vector, nearest.vector)
    assert np.all(scales(nearest) > 0)


def test_a_body_that_can_move_stays(four):
    assert nearest_possible(four.nominal) is four.nominal


def test_distance_to_the_boundary_counts_in_standard_deviations(four):
    body = four.nominal
    eigenvalue, in_sd = distance_to_boundary(body, 1e-8 * np.eye(9))
    assert eigenvalue == pytest.approx(np.linalg.eigvalsh(pseudo_inertia(body))[0])
    assert distance_to_boundary(body, 4e-8 * np.eye(9))[1] == pytest.approx(in_sd / 2)
    flat = Body(np.zeros(3), np.array([0.01, 0.01, 0.021, 0, 0, 0]))
    assert distance_to_boundary(flat, 1e-8 * np.eye(9))[0] < 0


def test_horizons_grow_to_the_end():
    assert stages.stages(10.0) == (0.3, 1.0, 3.0, 10.0)
    assert stages.stages(9.0) == (0.3, 1.0, 3.0, 9.0)
    assert stages.stages(12.0) == (0.3, 1.0, 3.0, 12.0)
    assert stages.stages(100.0) == (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
    assert stages.stages(0.35) == (0.35,)


class Drag(Effect):
    parameters = ("c",)

    def wrench(self, state, theta):
        return -theta[0] * state.twist


def campaign_of(robot, windows):
    held = [
        replace(window, role=Role.VALIDATE) if k == len(windows) - 1 else window for k, window in enumerate(windows)
    ]
    return Campaign("made up", robot, 100.0, tuple(held))


def test_a_result_has_every_field_of_the_format(four, record, truth):
    result = identify(campaign_of(four, record(four, 4, seconds=3.0)), Method.MLE, native=True)
    assert result.outcome in (ResultOutcome.CONVERGED, ResultOutcome.DOUBTFUL)
    table = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert table["method"] == "mle"
    assert list(table["parameters"]) == list(PARAMETER_NAMES)
    for name, value in zip(PARAMETER_NAMES, truth(four).vector, strict=True):
        parameter = table["parameters"][name]
        assert abs(parameter["value"] - value) < 4.5 * parameter["sd"]
        assert parameter["sd_bootstrap"] > 0
    assert all(0.8 < window["chi2_per_dof"] < 1.25 for window in table["windows"])
    assert all(window["rms_mm"] == pytest.approx(0.1, rel=0.15) for window in table["windows"])
    assert all(window["used"] and window["sigma_perp"] > 0 for window in table["windows"])
    assert [window["role"] for window in table["windows"]] == ["identify"] * 3 + ["validate"]
    assert table["sigma_W"] > 0
    for window in result.windows:
        assert window.prediction is not None
        np.testing.assert_allclose(
            window.prediction.motion.positions + window.prediction.motion.rotations @ four.marker,
            window.prediction.markers[:, 0],
            atol=1e-7,
        )


@pytest.mark.slow
def test_missing_physics_is_said_and_not_hidden(four, record):
    windows = record(four, 6, effects=(Drag(),), theta=[0.6])
    windows[0] = replace(windows[0], id="far", markers=1e3 * windows[0].markers)
    result = identify(campaign_of(four, windows), Method.MLE, native=True)
    assert result.outcome is ResultOutcome.MISFIT
    assert not result.outcome.good
    assert any("far is not used" in warning for warning in result.warnings)
    assert any("Something is missing" in warning for warning in result.warnings)
    assert any("not white" in warning for warning in result.warnings)
    assert {window.id: window.used for window in result.windows}["far"] is False


def test_understated_noise_is_seen_as_noise(four, record):
    result = identify(campaign_of(four, record(four, 4, noise=3e-4)), Method.MLE, native=True)
    assert result.outcome is not ResultOutcome.MISFIT
    assert any(re.search(r"marker noise of 0\.(29|3)\d* mm, the robot file says 0.1 mm", w) for w in result.warnings)


def test_the_closing_sentence_follows_the_outcome(four, record):
    good = identify(campaign_of(four, record(four, 4)), Method.MLE, native=True)
    assert re.search(r"explains the recordings down to noise; held-out windows have χ²/dof [01]\.\d", closing(good))
    assert "lacks something" in closing(replace(good, outcome=ResultOutcome.MISFIT))
    assert good.answer.verdict == ResultOutcome.CONVERGED.value
    assert good.answer.next == "Nothing more is needed."


def test_windows_need_not_be_predicted(four, record):
    result = identify(campaign_of(four, record(four, 4)), Method.MLE, checks=QUICK, native=True)
    held_out = result.windows[-1]
    assert held_out.role is Role.VALIDATE
    assert held_out.used
    assert held_out.chi2_per_dof is None
