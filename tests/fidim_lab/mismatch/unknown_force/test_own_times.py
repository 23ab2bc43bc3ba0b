"""What comes back at a time of its own in every window: times and course found from the windows' own answers."""

import numpy as np
import pytest

from fidim_lab.mismatch.unknown_force.knocks import knocks
from fidim_lab.mismatch.unknown_force.own_times import own_times, rotations

WINDOWS, SHARED, DIRECTIONS = 6, 2, 3


def answers(rng: np.random.Generator, felt: np.ndarray, noise: float) -> np.ndarray:
    """Grams (W, m, m) of windows of 400 numbers, each of which feels weights (W, Q) of its own."""
    found = []
    for weights in felt:
        columns = rng.normal(size=(400, SHARED + len(weights)))
        residual = -columns[:, SHARED:] @ weights + noise * rng.normal(size=400)
        rows = np.column_stack([columns, residual])
        found.append(rows.T @ rows)
    return np.array(found)


def knocked(phases: np.ndarray, frequency: float, width: float, harmonics: int, force: np.ndarray) -> np.ndarray:
    """Weights of [1, sin θ, cos θ, sin 2θ …] (W, Q) of Gaussians at θ = −φ, by the integrals of their series."""
    t = np.arange(4096) / 4096 / frequency
    found = []
    for phase in phases:
        away = (t + phase / (2 * np.pi * frequency) + 0.5 / frequency) % (1 / frequency) - 0.5 / frequency
        course = np.exp(-((away / width) ** 2) / 2)
        waves = [np.mean(course)]
        for k in range(1, harmonics + 1):
            angle = 2 * np.pi * k * frequency * t
            waves += [2 * np.mean(course * np.sin(angle)), 2 * np.mean(course * np.cos(angle))]
        found.append(np.outer(force, waves).ravel())
    return np.array(found)


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between phases, rad."""
    return np.abs(np.angle(np.exp(1j * (one - other))))


def test_phases_and_a_course_of_three_harmonics_come_back_but_for_their_common_turn() -> None:
    rng = np.random.default_rng(1)
    weights = rng.normal(size=6 * DIRECTIONS)
    phases = rng.uniform(-np.pi, np.pi, WINDOWS)
    felt = rotations(phases, 3, len(weights)) @ weights
    found = own_times(answers(rng, felt, 0.01), SHARED, 3, 1.0)
    turned = found.phases - phases
    assert apart(turned, turned[0]).max() < 2 * np.pi / 72 + 0.02
    total = found.grams.sum(axis=0)
    left = total[-1, -1] - total[-1, :-1] @ np.linalg.solve(total[:-1, :-1], total[:-1, -1])
    assert left < 0.02 * total[-1, -1]
    assert found.cost > 0


@pytest.mark.parametrize("width", [0.02, 0.08])
def test_knocks_come_back_with_their_times_and_force(width: float) -> None:
    rng = np.random.default_rng(2)
    force, phases = np.array([0.6, -0.8, 0.1]), rng.uniform(-np.pi, np.pi, WINDOWS)
    felt = knocked(phases, 0.9, width, 10, force)
    found = knocks(answers(rng, felt, 0.002), SHARED, DIRECTIONS, 0.9, 1.0)
    assert apart(found.phases, phases).max() < 2 * np.pi / 48
    total = found.grams.sum(axis=0)
    solved = -np.linalg.solve(total[:-1, :-1], total[:-1, -1])[SHARED:]
    assert found.combined is not None
    whole = (found.combined @ solved).reshape(DIRECTIONS, -1)
    np.testing.assert_allclose(whole[:, 0], force * width * np.sqrt(2 * np.pi) * 0.9, atol=2e-3, rtol=0.1)


def test_of_noise_nothing_is_taken_that_pays_for_its_phases() -> None:
    rng = np.random.default_rng(3)
    noise = answers(rng, np.zeros((WINDOWS, 6 * DIRECTIONS)), 1.0)
    found = own_times(noise, SHARED, 3, 1.0)
    total = found.grams.sum(axis=0)
    gain = total[-1, :-1] @ np.linalg.solve(total[:-1, :-1], total[:-1, -1])
    assert gain < 4 * (6 * DIRECTIONS + SHARED + WINDOWS)
