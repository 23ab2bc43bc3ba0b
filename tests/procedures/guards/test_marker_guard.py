"""The guard of the main marker: old places under new numbers; silence and freezing are in the tests of faults."""

import numpy as np
import pytest

from drivers.ports import MarkerFrame
from procedures.guards.guard import Observation
from procedures.guards.robot_guards import MarkerGuard
from procedures.steps import Phase

RATE = 100.0


def swing(frames: int, digit: float = 0.0, noise: float = 1e-4) -> np.ndarray:
    """m, (frames, 3)."""
    t = np.arange(frames) / RATE
    rng = np.random.default_rng(3)
    ways = [0.015 * np.exp(-0.05 * t) * np.cos(2.0 * np.pi * f * t) for f in (0.9, 1.1, 1.3)]
    places = np.stack(ways, axis=1) + noise * rng.standard_normal((frames, 3))
    return np.round(places / digit) * digit if digit else places


def trips(places: np.ndarray, phase: Phase = Phase.RESTING) -> list[str]:
    guard, said = MarkerGuard(3.0), []
    for number, place in enumerate(places.tolist(), start=1):
        frame = MarkerFrame(number=number, t=number / RATE, positions=(tuple(place),))
        says = guard.look(Observation(t=number / RATE, phase=phase, winches=(), frame=frame, commanded=()))
        said += [says] if says else []
    return said


@pytest.mark.parametrize("behind", [10, 83, 300])
@pytest.mark.parametrize("phase", [Phase.RESTING, Phase.MOVING, Phase.HANDLING])
def test_old_places_under_new_numbers_are_told_by_how_far_they_are_behind(behind, phase):
    places = swing(1000)
    late = np.concatenate([places[:500], places[500 - behind : 1000 - behind]])
    assert f"the places of {behind} frames before" in trips(late, phase)[0]


def test_while_a_window_is_recorded_its_own_check_rejects_it():
    places = swing(1000)
    late = np.concatenate([places[:500], places[417:917]])
    assert trips(late, Phase.RECORDING) == []


@pytest.mark.parametrize("digit", [0.0, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("noise", [0.0, 2e-5, 3e-4])
def test_an_honest_stream_of_few_digits_is_none(digit, noise):
    assert trips(swing(6000, digit, noise)) == []
