"""Slow motion of a marker besides its swing: told apart from tones of unknown frequency and decay."""

import numpy as np
import pytest

from procedures.outcomes import Outcome
from procedures.recording.marker_drift import drift_measurement

NOMINAL = np.array([1.5, 2.6])
RATE = 100.0


def swing(seconds, amplitude=0.02, factors=(1.13, 0.84), decay=0.05):
    t = np.arange(round(RATE * seconds)) / RATE
    first, second = (
        np.exp(-decay * t) * np.sin(2 * np.pi * f * n * t + 0.7) for f, n in zip(factors, NOMINAL, strict=True)
    )
    place = amplitude * np.column_stack([first, 0.8 * second - 0.3 * first, 0.1 * second])
    return t, place + np.random.default_rng(1).normal(scale=1e-4, size=place.shape) + (1.1, -0.3, -0.4)


def drift(t, begin, seconds, way):
    return np.clip((t - begin) / seconds, 0.0, 1.0)[:, np.newaxis] * np.array(way)


@pytest.mark.parametrize("seconds", [1.5, 3.0, 10.0])
@pytest.mark.parametrize("amplitude", [0.005, 0.02, 0.1])
def test_a_swing_alone_passes(seconds, amplitude):
    one = drift_measurement(*swing(seconds, amplitude), NOMINAL, 0.03)
    assert one.outcome is Outcome.PASS, one.sentence


@pytest.mark.parametrize("way", [(0.03, 0.0, 0.0), (0.0, -0.03, 0.0), (0.0, 0.0, 0.03)])
@pytest.mark.parametrize(("seconds", "begin", "lasts"), [(1.5, 0.0, 1.5), (10.0, 4.0, 1.0), (10.0, 0.0, 10.0)])
def test_thirty_millimetres_are_told(seconds, begin, lasts, way):
    t, place = swing(seconds)
    one = drift_measurement(t, place + drift(t, begin, lasts, way), NOMINAL, 0.03)
    assert one.outcome is not Outcome.PASS, one.sentence
    assert one.value == pytest.approx(0.03, abs=0.012)


def test_a_hundred_millimetres_are_rejected():
    t, place = swing(10.0)
    assert drift_measurement(t, place + drift(t, 2.0, 5.0, (0.1, 0.0, 0.05)), NOMINAL, 0.03).outcome is Outcome.FAIL


def test_a_platform_that_stands_while_its_marker_slides_is_told():
    t, place = swing(10.0, amplitude=0.0)
    one = drift_measurement(t, place + drift(t, 3.0, 2.0, (0.02, 0.0, 0.0)), NOMINAL, 0.03)
    assert one.outcome is Outcome.MARGINAL


def test_too_few_samples_tell_nothing():
    t, place = swing(1.5)
    place[10:] = np.nan
    assert drift_measurement(t, place, NOMINAL, 0.03).outcome is Outcome.UNSET
