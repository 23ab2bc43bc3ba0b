"""A place that stands out is told apart: spikes, a step, a blow, or motion that turns sharply."""

import numpy as np
import pytest

from fidim_lab.identification.markers.rivals import What, judge

SIGMA = np.full(3, 1e-4)
T = (np.arange(41) - 20) / 100


def motion(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    smooth = 0.02 * np.sin(2 * np.pi * np.outer(T, [1.5, 2.0, 3.0]) + np.array([0.3, 1.0, 2.0]))
    return smooth + 1e-4 * random.standard_normal(smooth.shape)


@pytest.mark.parametrize("seed", range(5))
def test_smooth_motion_is_motion(seed: int) -> None:
    found = judge(motion(seed), SIGMA, 20)
    assert found is not None
    assert found.what is What.MOTION


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("bad", [(20,), (20, 21), (19, 21)])
def test_displaced_samples_are_named(seed: int, bad: tuple[int, ...]) -> None:
    samples = motion(seed)
    for k, row in enumerate(bad):
        samples[row] += np.array([2e-3, -1e-3, 5e-4]) * (-1) ** k
    found = judge(samples, SIGMA, 20)
    assert found is not None
    assert found.what is What.BAD
    assert set(bad) <= set(found.rows)
    assert len(found.rows) <= len(bad) + 1


@pytest.mark.parametrize("seed", range(5))
def test_a_step_is_a_step_at_its_row_and_of_its_size(seed: int) -> None:
    samples = motion(seed)
    samples[21:] += np.array([3e-3, 0.0, 1e-3])
    found = judge(samples, SIGMA, 20)
    assert found is not None
    assert (found.what, found.rows) == (What.STEP, (21,))
    assert found.amplitude == pytest.approx(np.array([3e-3, 0.0, 1e-3]), abs=5e-4)


@pytest.mark.parametrize("seed", range(5))
def test_a_blow_is_no_fault(seed: int) -> None:
    """Half a metre a second at once, as when a cable snaps taut."""
    samples = motion(seed) + np.maximum(T - 0.003, 0.0)[:, np.newaxis] * np.array([0.5, -0.2, 0.0])
    found = judge(samples, SIGMA, 20)
    assert found is not None
    assert found.what in (What.BLOW, What.MOTION)


def test_too_few_samples_tell_nothing() -> None:
    samples = motion(0)
    samples[14:26] = np.nan
    assert judge(samples, SIGMA, 20) is None
