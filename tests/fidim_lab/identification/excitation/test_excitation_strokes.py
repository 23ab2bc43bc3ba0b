"""Strokes: where and when they go, and what they do to an oscillator, against a numerical integration."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fidim_lab.errors import OurBugError
from fidim_lab.identification.excitation.strokes import Chain, Pattern, timeline

PATTERNS = st.builds(Pattern, half=st.floats(0.1, 0.5), turns=st.integers(1, 8), duty=st.floats(0.5, 0.95))


def moved(pattern: Pattern, count: int = 800) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """t, offset, speed, acceleration of the unit chain, integrated piece by piece."""
    line = timeline((pattern,), (0.0,), pattern.seconds, count)
    a, h = line.patterns[:, 0], line.steps
    speed = np.concatenate([[0.0], np.cumsum(a * h)])
    offset = np.concatenate([[0.0], np.cumsum(speed[:-1] * h + a * h**2 / 2)])
    return line.t, offset, speed, a


@given(PATTERNS)
@example(Pattern(half=0.11626980147154892, turns=4, duty=0.5))  # the rounding adds up
def test_every_stroke_ends_at_rest_at_its_target(pattern: Pattern):
    t, offset, speed, _ = moved(pattern)
    for start, duration, target in zip(pattern.starts, pattern.durations, pattern.targets, strict=True):
        k = np.argmin(np.abs(t - start - duration))
        assert abs(offset[k] - target) < 1e-5
        assert abs(speed[k]) < 5e-7 * pattern.speed  # its edges are rounded to a nanosecond
    assert np.abs(speed).max() <= pattern.speed * (1 + 1e-6)
    assert np.abs(offset).max() <= 1 + 1e-5


@given(PATTERNS, st.floats(1.0, 4.0), st.floats(0.0, 0.1))
def test_response_is_that_of_a_damped_oscillator(pattern: Pattern, frequency: float, ratio: float):
    s = 2 * np.pi * frequency * (-ratio + 1j * np.sqrt(1 - ratio**2))
    line = timeline((pattern,), (0.0,), pattern.seconds, 800)
    y = 0.0
    for a, h in zip(line.patterns[:, 0], line.steps, strict=True):
        y = y * np.exp(s * h) + a * (np.exp(s * h) - 1) / s
    assert pattern.response(np.array([s]))[0] == pytest.approx(y, abs=1e-7 * pattern.acceleration)


@given(PATTERNS, st.floats(1.0, 4.0), st.floats(0.0, 0.1))
def test_offset_acceleration_and_response_on_the_way(pattern: Pattern, frequency: float, ratio: float):
    s = 2 * np.pi * frequency * (-ratio + 1j * np.sqrt(1 - ratio**2))
    t, offset, _, acceleration = moved(pattern)
    found, bent = pattern.motion(t)
    np.testing.assert_allclose(found, offset, atol=1e-5)
    lasting = np.diff(t) > 1e-6  # edges are rounded to a nanosecond
    np.testing.assert_allclose(pattern.motion((t[1:] + t[:-1]) / 2)[1][lasting], acceleration[lasting])
    assert bent[0] == 0.0
    np.testing.assert_allclose(pattern.motion(np.array([-1.0, pattern.seconds + 1.0])), 0.0, atol=1e-9)
    steps = np.exp(s * np.diff(t))
    y = np.zeros(len(t), dtype=complex)
    for k, (a, step) in enumerate(zip(acceleration, steps, strict=True)):
        y[k + 1] = y[k] * step + a * (step - 1) / s
    np.testing.assert_allclose(pattern.responses(np.array([s]), t)[0], y, atol=1e-6 * pattern.acceleration)


def test_a_chain_says_the_most_its_cables_do():
    chain = Chain(Pattern(0.3, 3, 0.9), np.array([0.01, -0.02]))
    assert chain.longest == 0.02
    assert chain.acceleration == pytest.approx(8 * 0.02 / 0.27**2)
    assert chain.speed == pytest.approx(4 * 0.02 / 0.27)
    assert chain.offsets[0] == pytest.approx([0.01, -0.02])
    assert chain.offsets[-1] == pytest.approx([0, 0])


def test_too_few_steps_are_refused():
    with pytest.raises(OurBugError, match="foreseen"):
        timeline((Pattern(0.3, 3, 0.9),), (0.0,), 5.0, 20)
