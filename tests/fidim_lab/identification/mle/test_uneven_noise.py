"""Markers that are seen better in some directions than in others, and some markers better than others."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from fidim_lab.data.records import Body, Robot, Window
from fidim_lab.identification.markers.noise_shape import noise_shapes
from fidim_lab.identification.mle.fit import fit
from fidim_lab.model.mechanism import Mechanism

T = np.arange(601) / 100
SWING = 0.1 * np.sin(2 * np.pi * 1.7 * T)[:, None, None] * np.array([1.0, 0.4, -0.2])
UNEVEN = np.array([[0.5, 0.7, 1.5], [1.0, 1.0, 2.0]]) * 1e-4


def drawn(sd: np.ndarray, windows: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """sd: (M, 3), m."""
    random = np.random.default_rng(seed)
    return [(T, SWING + sd * random.standard_normal((len(T), *sd.shape))) for _ in range(windows)]


def test_even_noise_has_no_shape():
    for seed in range(200):
        assert noise_shapes(drawn(np.full((2, 3), 1e-4), 6, seed), 1e-4) == [None] * 6


def test_the_shape_makes_the_noise_even():
    shape, *others = noise_shapes(drawn(UNEVEN, 6, 1), 1e-4)
    assert shape is not None
    assert all(np.array_equal(one, shape) for one in others)
    mean = np.sqrt(np.mean(UNEVEN**2))
    for one, sd in zip(shape, UNEVEN, strict=True):
        assert one @ np.diag(sd**2) @ one.T == pytest.approx(mean**2 * np.eye(3), abs=0.1 * mean**2)


@pytest.mark.parametrize("sd", [np.full((2, 3), 1e-4), UNEVEN])
def test_a_few_recordings_with_swapped_markers_do_not_make_the_shape_of_others(sd: np.ndarray):
    """Two of the paper's 14 recordings with three cables have jumps of millimetres between frames in two markers."""
    good = drawn(sd, 6, 1)
    bad = drawn(sd * np.array([[40.0], [1.0]]), 2, 2)
    alone, beside = noise_shapes(good, 1e-4)[0], noise_shapes(good + bad, 1e-4)
    if alone is None:
        assert beside[:6] == [None] * 6
    else:
        assert np.array(beside[:6]) == pytest.approx(np.array([alone] * 6), rel=0.3, abs=0.1)


@pytest.mark.parametrize("sd", [np.full((2, 3), 1e-4), UNEVEN])
def test_a_recording_with_noise_of_its_own_is_weighed_by_that(sd: np.ndarray):
    own = sd * np.array([[40.0], [1.0]])
    shape = noise_shapes(drawn(sd, 6, 1) + drawn(own, 1, 2), 1e-4)[-1]
    assert shape is not None
    mean = np.sqrt(np.mean(sd**2))
    for one, noise in zip(shape, own, strict=True):
        assert one @ np.diag(noise**2) @ one.T == pytest.approx(mean**2 * np.eye(3), abs=0.4 * mean**2)


@pytest.mark.parametrize("sd", [5e-5, 1e-4, 5e-4])
def test_what_is_stated_is_not_corrected_by_what_all_have(sd: float):
    """Noise of another size than stated in all recordings is told, not weighed away."""
    assert noise_shapes(drawn(np.full((2, 3), sd), 6, 1), 1e-4) == [None] * 6


def test_samples_that_are_off_are_no_noise():
    random = np.random.default_rng(3)
    recordings = drawn(np.full((1, 3), 1e-4), 6, 2)
    for _, markers in recordings:
        markers[random.integers(len(T), size=5), 0, 2] += 0.02
    assert noise_shapes(recordings, 1e-4) == [None] * 6


def test_what_is_stated_beyond_it_is_of_no_known_direction():
    """Errors slower than frames are not seen, and larger than those that are: little is known of directions."""
    assert noise_shapes(drawn(0.2 * UNEVEN, 6, 1), 2e-4) == [None] * 6


@given(st.integers(0, 30), st.integers(1, 3), st.floats(0, 1))
def test_few_samples_and_holes_tell_nothing_or_something_finite(rows, markers, missing):
    random = np.random.default_rng(rows)
    seen = random.standard_normal((rows, markers, 3))
    seen[random.random((rows, markers)) < missing] = np.nan
    (shape,) = noise_shapes([(np.arange(rows) / 100, seen)], 1e-4)
    assert shape is None or np.isfinite(shape).all()


def test_a_fit_weighs_directions_by_their_noise(
    four: Robot, record: Callable[..., list[Window]], truth: Callable[[Robot], Body]
):
    """The error keeps to its ±, which is less than that of a fit which takes all directions for equally good."""
    sd, mean = np.array([0.3, 0.5, 2.0]) * 1e-4, 1e-4 * np.sqrt((0.09 + 0.25 + 4.0) / 3)
    robot, distances = replace(four, sensors=replace(four.sensors, marker_noise=mean)), []
    even = fit(Mechanism(robot, native=True), record(robot, 3, seed=1))
    for seed in range(4):
        random = np.random.default_rng(seed)
        exact = record(robot, 3, seed=seed, noise=0.0)
        windows = [replace(w, markers=w.markers + sd * random.standard_normal(w.markers.shape)) for w in exact]
        found = fit(Mechanism(robot, native=True), windows)
        assert 0.9 < found.chi2_per_dof < 1.1
        error = found.values[:9] - truth(robot).vector
        distances.append(float(error @ np.linalg.solve(found.covariance[:9, :9], error)))
        assert np.exp(np.mean(np.log(found.sd[:9] / even.sd[:9]))) < 0.8
    assert chi2.ppf(1e-3, 36) < sum(distances) < chi2.ppf(0.999, 36)
