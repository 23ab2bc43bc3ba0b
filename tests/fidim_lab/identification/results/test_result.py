"""The whole of `identify`: spreads, consistency, verdicts, files, and honesty."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.errors import FileError, SetupError
from fidim_lab.identification.equations import consistency, uncertainty
from fidim_lab.identification.equations.estimators import ESTIMATORS, Method, method_named
from fidim_lab.identification.equations.problem import build
from fidim_lab.identification.identify import identify
from fidim_lab.identification.motion.recipe import BEST
from fidim_lab.identification.motion.trajectory import predict
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.identification.results.result_file import read_result, write_result
from fidim_lab.identification.results.validation import QUICK, expected_sigma_perp

NOISE = 1e-4


@pytest.fixture(scope="module")
def result(recorded) -> IdentificationResult:
    return identify(recorded(noise=NOISE), checks=QUICK)


def test_a_noisy_campaign_is_identified_within_its_uncertainty(result, true_body):
    assert result.outcome is ResultOutcome.CONVERGED
    stated = np.array([max(p.sd, p.spread or 0.0) for p in result.parameters.values()])
    errors = (result.body.vector - true_body.vector) / stated
    assert np.abs(errors).max() < 4
    assert np.abs(result.body.com[2] - true_body.com[2]) < 2e-3
    assert result.noise_ratio == pytest.approx(1.0, abs=0.25)


def test_repetition_stays_within_the_stated_sd(recorded, true_body):
    """Eq. 32 takes the noise of W as white; ours grows with f², so low frequencies are better than it says."""
    found = [identify(recorded(noise=NOISE, seed=seed), checks=QUICK) for seed in range(1, 7)]
    errors = np.array([r.body.vector - true_body.vector for r in found])
    stated = np.mean([[p.sd for p in r.parameters.values()] for r in found], axis=0)
    ratio = np.sqrt((errors**2).mean(axis=0)) / stated
    assert ratio.max() < 1.3
    assert ratio.min() > 0.15


def test_held_out_sigma_perp_is_as_expected(result):
    assert result.sigma_W is not None
    expected = expected_sigma_perp(result.sigma_W, result.body, 2)
    [held_out] = [w for w in result.windows if w.role is Role.VALIDATE]
    assert held_out.sigma_perp == pytest.approx(expected, rel=0.35)
    assert held_out.residual is not None
    by_hand = np.sqrt(np.sum(held_out.residual.epsilon**2) / len(held_out.residual.t))
    assert held_out.sigma_perp == pytest.approx(by_hand)


def test_missing_physics_is_not_called_noise(recorded):
    campaign = recorded(noise=NOISE)
    windows = tuple(
        replace(w, lengths=w.lengths + 0.008 * np.array([k - 2.0, 1.0, 0.0, 0.0]))
        for k, w in enumerate(campaign.windows)
    )
    found = identify(replace(campaign, windows=windows), checks=QUICK)
    assert found.noise_ratio is not None
    assert found.noise_ratio > 1.5
    assert any("times what marker noise explains" in w for w in found.warnings)
    assert any("not as the robot file says" in w for w in found.warnings)


def test_the_true_body_predicts_a_window_to_its_noise_and_a_wrong_one_does_not(recorded, true_body):
    campaign = recorded(noise=NOISE)
    problem = build(campaign, BEST, campaign.windows[:1])
    found = predict(problem.mechanism, true_body, problem.equations[0].measured)
    assert found is not None
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.1)
    assert found.rms == pytest.approx(NOISE, rel=0.05)
    off = replace(true_body, com=true_body.com * 1.02)
    worse = predict(problem.mechanism, off, problem.equations[0].measured)
    assert worse is None or worse.chi2_per_dof > 10


def test_a_slack_or_absent_prediction_is_none(recorded, true_body):
    campaign = recorded()
    problem = build(campaign, BEST, campaign.windows[:1])
    heavy = replace(true_body, com=true_body.com * -3.0)  # G above the attachments: it tips over
    assert predict(problem.mechanism, heavy, problem.equations[0].measured) is None


def test_jackknife_and_bootstrap_of_a_mean_are_the_textbook_ones():
    """One "parameter" that is the mean of one number a window: both spreads are known."""
    numbers = np.array([1.0, 2.0, 4.0, 7.0, 11.0])
    blocks = [np.full((1, 10), x) for x in numbers]

    def mean(stacked, rows):
        assert rows == len(stacked)
        return np.full(9, stacked[:, 0].mean())

    replicates = uncertainty.leave_one_out(blocks, [1] * 5, mean)
    assert replicates is not None
    standard_error = numbers.std(ddof=1) / np.sqrt(5)
    np.testing.assert_allclose(uncertainty.jackknife_sd(replicates), standard_error)
    drawn = uncertainty.bootstrap_sd(blocks, [1] * 5, mean, draws=4000)
    np.testing.assert_allclose(drawn, numbers.std() / np.sqrt(5), rtol=0.05)
    np.testing.assert_array_equal(drawn, uncertainty.bootstrap_sd(blocks, [1] * 5, mean, draws=4000))
    assert uncertainty.leave_one_out(blocks[:2], [1, 1], mean) is None
    assert uncertainty.bootstrap_sd(blocks[:2], [1, 1], mean) is None


def test_two_windows_say_that_they_show_no_spread(recorded):
    campaign = recorded(noise=NOISE)
    found = identify(replace(campaign, windows=campaign.windows[:2]), checks=QUICK)
    assert found.parameters["s_z"].spread is None
    assert any("Fewer than three windows" in w for w in found.warnings)
    assert found.to_json()["parameters"]["s_z"]["sd_bootstrap"] is None  # type: ignore[index]


@pytest.mark.parametrize(
    ("com", "inertia", "says"),
    [
        ((0.0, 0.0, 0.1), (0.05, 0.05, 0.02), None),
        ((0.0, 0.0, 0.3), (0.05, 0.05, 0.02), "principal moment"),
        ((0.0, 0.0, 0.0), (0.01, 0.02, 0.05), "triangle inequality"),
    ],
)
def test_bodies_that_cannot_exist_are_named(com, inertia, says):
    body = Body(com=np.array(com), inertia=np.array([*inertia, 0.0, 0.0, 0.0]))
    assert consistency.can_exist(body) is (says is None)
    assert consistency.can_move(body) is (says != "principal moment")
    assert (says or "can exist") in consistency.sentence(body)


def test_a_cloud_of_masses_always_exists_and_has_the_pseudo_inertia_of_its_points():
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (20, 3))
    second = np.einsum("ki,kj->ij", points, points) / 20
    J = np.trace(second) * np.eye(3) - second
    body = Body(com=points.mean(axis=0), inertia=J[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    homogeneous = np.column_stack([points, np.ones(20)])
    np.testing.assert_allclose(consistency.pseudo_inertia(body), homogeneous.T @ homogeneous / 20, atol=1e-15)
    assert consistency.can_exist(body)


def test_inertia_about_the_centre_of_mass_has_its_error(result, true_body):
    about = result.about_com()
    central = true_body.inertia_about_com
    for name, (i, j) in {"I_xx": (0, 0), "I_yy": (1, 1), "I_zz": (2, 2), "I_xy": (0, 1)}.items():
        stated = max(about[name].sd, about[name].spread or 0.0)
        assert abs(about[name].value - central[i, j]) < 4 * stated


def test_only_what_is_built_can_be_asked_for():
    assert method_named("tls") is Method.TLS
    assert {*ESTIMATORS, Method.MLE} == set(Method)
    assert method_named("iv") is Method.IV
    with pytest.raises(SetupError, match="no method 'kalman'"):
        method_named("kalman")


def test_json_is_exactly_the_format(result):
    table = result.to_json()
    assert list(table) == [
        "format", "campaign", "method", "outcome", "message", "parameters", "non_essential", "sigma_W", "C", "windows",
        "geometry",
        "removed", "seconds",
    ]  # fmt: skip
    assert table["outcome"] == "converged"
    assert list(table["parameters"]) == list(PARAMETER_NAMES)  # type: ignore[call-overload]
    for parameter in table["parameters"].values():  # type: ignore[attr-defined]
        assert set(parameter) == {"value", "sd", "sd_bootstrap", "nominal", "seen"}
    for window in table["windows"]:  # type: ignore[attr-defined]
        assert set(window) == {"id", "role", "chi2_per_dof", "rms_mm", "sigma_perp", "used"}
    assert json.loads(json.dumps(table, allow_nan=False)) == table


def test_a_result_file_comes_back(result, tmp_path):
    path = tmp_path / "result.json"
    write_result(path, result)
    read = read_result(path)
    np.testing.assert_array_equal(read.body.vector, result.body.vector)
    assert [w.id for w in read.windows] == [w.id for w in result.windows]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.update(format="fidim-result/2"), "format"),
        (lambda t: t.update(extra=1), "extra"),
        (lambda t: t["parameters"].pop("s_z"), "s_z missing"),
        (lambda t: t["parameters"].update(mass={"value": 1.0}), "mass unknown"),
        (lambda t: t["parameters"]["s_x"].update(value="far"), r"parameters, s_x, value"),
        (lambda t: t["windows"][0].pop("used"), r"windows 1, used"),
    ],
)
def test_a_wrong_result_file_names_its_key(result, tmp_path, change, says):
    table = json.loads(json.dumps(result.to_json()))
    change(table)
    path = tmp_path / "result.json"
    path.write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(FileError, match=says):
        read_result(path)


def test_no_result_file_and_no_json(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_result(tmp_path / "none.json")
    (tmp_path / "bad.json").write_text("{", encoding="utf-8")
    with pytest.raises(FileError, match="JSON"):
        read_result(tmp_path / "bad.json")
