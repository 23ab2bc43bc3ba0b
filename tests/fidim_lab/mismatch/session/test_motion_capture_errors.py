"""Errors of motion capture that are neither physics nor samples: what is said of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.sealed.campaigns import NATIVE, SealedRecipe, sealed_campaign
from fidim_lab.data.records import Campaign, Robot, Window
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.explain import explain

pytestmark = pytest.mark.slow
Rng = np.random.Generator


@pytest.fixture(scope="module")
def quiet(irma4: Robot) -> Campaign:
    """Without noise."""
    recipe = SealedRecipe("quiet", irma4, (), NATIVE, (6, 3), 100.0, True, 45)
    return sealed_campaign(recipe, noise=0.0)[0]


def with_errors(quiet: Campaign, errors: Callable[[Window, Rng], np.ndarray]) -> Campaign:
    rng, sd = np.random.default_rng(1), quiet.robot.sensors.marker_noise
    windows = (replace(w, markers=w.markers + sd * errors(w, rng)) for w in quiet.windows)
    return replace(quiet, windows=tuple(windows))


def test_noise_that_is_larger_along_one_direction_is_nothing_missing(quiet: Campaign) -> None:
    turned = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    found = explain(with_errors(quiet, lambda w, rng: rng.normal(size=w.markers.shape) * [0.5, 0.7, 1.5] @ turned))
    assert found.verdict is Verdict.NOTHING_MISSING, found.message


def test_slow_noise_within_what_is_stated_asks_for_a_recording_at_rest(quiet: Campaign) -> None:
    slow = 0.9

    def errors(w: Window, rng: Rng) -> np.ndarray:
        return np.sqrt(1 - slow**2) * lfilter([1.0], [1.0, -slow], rng.normal(size=w.markers.shape), axis=0)

    found = explain(with_errors(quiet, errors))
    assert not found.effects
    assert "within the stated noise" in found.message
    assert "at rest" in found.next_experiment


def test_cameras_that_shake_are_told_with_their_frequency(quiet: Campaign) -> None:
    def errors(w: Window, rng: Rng) -> np.ndarray:
        shaking = 2 * np.sin(2 * np.pi * 13.2 * w.t + rng.uniform(0, 6))
        return rng.normal(size=w.markers.shape) + shaking[:, None, None] * np.array([0.8, 0.6, 0.0])

    found = explain(with_errors(quiet, errors))
    assert found.verdict is Verdict.UNKNOWN_PHYSICS
    assert "13.2 Hz" in found.message
    assert "13.2 Hz" in found.next_experiment  # the middle of a band of 0.5 Hz


def test_a_wand_of_another_length_is_found(quiet: Campaign) -> None:
    noisy = with_errors(quiet, lambda w, rng: rng.normal(size=w.markers.shape))
    scaled = replace(noisy, windows=tuple(replace(w, markers=1.002 * w.markers) for w in noisy.windows))
    found = explain(scaled)
    assert [one.id for one in found.effects] == ["capture-scale"], found.message
    assert found.effects[0].parameters["scale"].value == pytest.approx(0.002, abs=1e-4)
