"""What angular rates alone show of a pendulum: against a closed form, and their derivatives against differences."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.own_sensors import RATES
from fidim_lab.data.records import Campaign, Robot, Role, Survey, Window
from fidim_lab.data.robot_file import read_robot
from fidim_lab.effects.geometry.gyroscope import GyroscopeMount
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify
from fidim_lab.identification.mle.fit import fit, likelihood_of
from fidim_lab.identification.mle.starts.start import Guess, first_guesses
from fidim_lab.identification.mle.trajectories.likelihood import Point, linearised, simulate, stepped
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import FINE

NOISE = 2e-3
HALF_ABOVE, HALF_BELOW, HANGS = 0.30, 0.25, 2.0
"""m: half the distances of anchors and of attachments, and how far these hang below those"""


@pytest.fixture
def bifilar() -> Robot:
    """The example, its geometry exact."""
    found = read_robot(Path(__file__).parents[4] / "examples" / "robots" / "bifilar.toml")
    sensors = replace(found.sensors, gyro_noise=NOISE, encoder_resolution=1e-5)
    return replace(found, survey=Survey.alike(2, 0.0, 0.0), sensors=sensors)


def yawing(inertia: float, seconds: float, rng: np.random.Generator, amplitude: float = 0.06) -> Window:
    """A window of yaw alone, by the textbook: T = 2π √(I H / (g a b)) for half distances a, b; I per unit mass."""
    t = np.arange(0, seconds, 0.02)
    pulsation = np.sqrt(9.81 * HALF_ABOVE * HALF_BELOW / (inertia * HANGS))
    rates = np.zeros((len(t), 3))
    rates[:, 2] = amplitude * pulsation * np.cos(pulsation * t + 0.4)
    rates += 0.015 * rng.normal(size=3) + 5e-5 * t[:, np.newaxis] + NOISE * rng.normal(size=rates.shape)
    cord = float(np.hypot(HANGS, HALF_ABOVE - HALF_BELOW))
    lengths = np.full((len(t), 2), cord)
    return Window(
        "w1",
        Role.IDENTIFY,
        t,
        np.full((len(t), 1, 3), np.nan),
        lengths,
        None,
        further=dict(zip(RATES, rates.T, strict=True)),
    )


@pytest.mark.parametrize("inertia", [pytest.param(0.040, marks=pytest.mark.slow), 0.071])
def test_yaw_alone_shows_the_inertia_of_the_textbook_and_nothing_else(bifilar: Robot, inertia: float) -> None:
    window = yawing(inertia, 10.0, np.random.default_rng(1))
    result = identify(Campaign("yaw", bifilar, 50.0, (window,)), Method.MLE, native=True)
    found = result.parameters["I_zz"]
    assert found.seen
    assert found.value == pytest.approx(inertia, rel=5e-3)  # s_x and s_y of some mm add to it
    assert found.sd < 2e-2 * inertia
    assert abs(found.value - inertia) < 2 * found.sd
    assert not any(result.parameters[name].seen for name in ("I_xx", "I_yy"))
    assert "I_xx" in result.answer.not_known


def test_where_only_bodies_that_cannot_exist_fit_better_the_best_that_can_is_told(bifilar: Robot) -> None:
    window = yawing(0.0737, 10.88, np.random.default_rng(11), amplitude=0.048)
    result = identify(Campaign("yaw", bifilar, 50.0, (window,)), Method.MLE, native=True)
    assert result.outcome.answers
    found = result.parameters["I_zz"]
    assert found.seen
    assert abs(found.value - 0.0737) < 2 * found.sd < 0.002


def test_derivatives_of_rates_are_those_of_differences(bifilar: Robot) -> None:
    mechanism = Mechanism(bifilar, (GyroscopeMount(),), [0.03, -0.02, 0.01, 0.02])
    recording = prepare(yawing(0.055, 3.0, np.random.default_rng(2), amplitude=0.3), bifilar, rates=True)
    shared = np.concatenate([bifilar.nominal.vector, mechanism.theta])
    guess = first_guesses(mechanism, bifilar.nominal, [recording])[0]
    assert isinstance(guess, Guess)
    likelihood = likelihood_of(mechanism, shared, (recording,), [guess], bifilar.sensors)
    ends = np.array([recording.end])
    here = simulate(likelihood, Point(shared, likelihood.guesses), ends, FINE)
    assert here is not None
    linear = linearised(likelihood, here)[0]
    by = np.concatenate([linear.by_own, linear.by_shared], axis=1)
    for column in range(by.shape[1]):
        step = 1e-5 * np.eye(by.shape[1])[column]
        sides = [
            simulate(
                likelihood,
                stepped(likelihood, here, s * step[np.newaxis, : likelihood.own], s * step[likelihood.own :]),
                ends,
                FINE,
            )
            for s in (1, -1)
        ]
        assert sides[0] is not None
        assert sides[1] is not None
        difference = (sides[0].residuals[0].markers - sides[1].residuals[0].markers) / 2e-5
        exact = by[: len(difference), column]
        assert np.abs(difference - exact).max() < 1e-6 * max(1.0, float(np.abs(exact).max()))


def test_bias_and_drift_are_noise(bifilar: Robot) -> None:
    """As if each window had them as unknowns with their priors: the generalised sum of squares, worked out whole."""
    rng = np.random.default_rng(3)
    mechanism = Mechanism(bifilar, (GyroscopeMount(),))
    recording = prepare(yawing(0.055, 2.0, rng), bifilar, rates=True)
    guess = first_guesses(mechanism, bifilar.nominal, [recording])[0]
    assert isinstance(guess, Guess)
    shared = np.concatenate([bifilar.nominal.vector, mechanism.theta])
    likelihood = likelihood_of(mechanism, shared, (recording,), [guess], bifilar.sensors)
    rows = rng.normal(size=3 * len(recording.t))
    whitened = likelihood.whitened(0, rows, np.ones((len(recording.t), 1, 3), dtype=bool))
    about = recording.t - recording.t.mean()
    covariance = NOISE**2 * np.eye(len(about)) + 0.05**2 + 1e-3**2 * np.outer(about, about)
    axes = rows.reshape(-1, 3)
    assert float(whitened @ whitened) == pytest.approx(
        float(np.trace(axes.T @ np.linalg.solve(covariance, axes))), rel=1e-6
    )


def test_a_gyroscope_needs_maximum_likelihood_and_company_of_its_own_kind(bifilar: Robot) -> None:
    window = yawing(0.055, 6.0, np.random.default_rng(4))
    with pytest.raises(SetupError, match="shows none"):
        identify(Campaign("yaw", bifilar, 50.0, (window,)), Method.TLS)
    seen = replace(window, id="w2", markers=np.zeros_like(window.markers))
    with pytest.raises(SetupError, match="two campaigns"):
        identify(Campaign("both", bifilar, 50.0, (window, seen)), Method.MLE)


def test_what_asks_for_markers_says_so(bifilar: Robot) -> None:
    with pytest.raises(RefusedError, match="rates alone, which fidim identify takes"):
        fit(Mechanism(bifilar), [yawing(0.055, 6.0, np.random.default_rng(6))])


def test_without_lengths_a_tape_is_asked_for(bifilar: Robot) -> None:
    window = replace(yawing(0.055, 6.0, np.random.default_rng(5)), lengths=None)
    with pytest.raises(RefusedError, match="how long the cables are"):
        identify(Campaign("yaw", bifilar, 50.0, (window,)), Method.MLE, native=True)
