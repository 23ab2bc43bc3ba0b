"""Two clocks, signals that both saw: the offset comes back within its stated uncertainty."""

import numpy as np
import pytest

from fidim_lab.data.alignment import align_clocks
from fidim_lab.errors import RefusedError

T = np.arange(0.0, 40.0, 0.01)


def swing(t: np.ndarray) -> np.ndarray:
    """Three modes that come and go, as free motion between pushes does."""
    strength = 0.2 + np.sin(0.35 * t) ** 2
    return strength[:, None] * np.column_stack(
        [np.sin(7.0 * t) + 0.5 * np.sin(9.3 * t + 1), np.cos(9.3 * t), np.sin(11.1 * t + 0.3 * np.sin(0.2 * t))]
    )


@pytest.mark.parametrize("offset", [391.2043, -0.0137, 0.0, -5.0004])
def test_the_offset_is_found_whatever_scale_zero_and_rate_the_other_has(offset: float):
    rng = np.random.default_rng(3)
    t_other = np.arange(3.0, 36.0, 1e-3) + offset
    other = 40.0 * swing(t_other - offset) + [5.0, -3.0, 800.0] + rng.normal(size=(len(t_other), 3))
    found = align_clocks(T, swing(T), t_other, other)
    assert abs(found.offset - offset) < 4 * found.sd
    assert found.sd < 5e-4
    assert found.per_channel == pytest.approx(found.offset, abs=2e-3)
    assert found.correlation > 0.99


def test_what_is_stated_of_a_short_recording_is_its_error():
    """Twelve seconds, one signal, as of a jog."""
    short, scores = T[:1200], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0.0, 20.0)
        seen = swing(short + phase)[:, :1]
        t_other = np.arange(-0.5, 12.5, 0.005) + rng.uniform(0.0, 0.01)
        other = swing(t_other + phase - 0.004)[:, :1] + 0.6 * rng.normal(size=(len(t_other), 1))
        found = align_clocks(short, seen, t_other, other)
        scores.append((found.offset - 0.004) / found.sd)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.5
    assert np.max(np.abs(scores)) < 6.0


def test_a_slow_sensor_shows_as_spread_between_channels():
    other = np.column_stack([swing(T - delay)[:, k] for k, delay in enumerate((0.0, 0.01, 0.02))])
    found = align_clocks(T, swing(T), T, other)
    assert found.per_channel == pytest.approx([0.0, 0.01, 0.02], abs=1e-3)
    assert found.sd > 3e-3


def test_a_reversed_signal_shows_in_correlation_and_uncertainty():
    """Half a period off is the best that a reversed oscillation can do."""
    found = align_clocks(T, swing(T), T, -swing(T))
    assert found.correlation < 0.9
    assert found.sd > 5e-3


def test_gaps_are_bridged():
    reference = swing(T)
    reference[1000:1012] = np.nan
    found = align_clocks(T, reference, T + 2.0, swing(T))
    assert found.offset == pytest.approx(2.0, abs=5e-4)


def test_what_says_nothing_about_the_clocks_is_refused():
    with pytest.raises(RefusedError, match="too short"):
        align_clocks(T[:500], swing(T[:500]), T, swing(T))
    still = swing(T)
    still[:, 1] = 3.0
    with pytest.raises(RefusedError, match="Signal 2 does not move"):
        align_clocks(T, still, T, swing(T))
    still[:, 1] = np.nan
    with pytest.raises(RefusedError, match="never seen"):
        align_clocks(T, still, T, swing(T))
