"""The figures of the protocol's layout, and the law behind the stated uncertainty."""

import numpy as np
import pytest

from drivers.mocap.clock_fit import LEAST_FRAMES, fit_clock

RATE, DRIFT, LATENCY, JITTER, SPIKES, SECONDS = 200.0, 30e-6, 4e-3, 0.5e-3, 0.01, 10.0


def arrivals(rng: np.random.Generator, n: int = int(RATE * SECONDS)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame numbers, arrival times, and the times at which they would arrive with the least latency."""
    numbers = np.arange(1000, 1000 + n)
    least = 5000.0 + (1.0 + DRIFT) * numbers / RATE + LATENCY
    jitter = rng.exponential(JITTER, n) * np.where(rng.random(n) < SPIKES, 10.0, 1.0)
    return numbers, least + jitter, least


def test_bias_is_microseconds_where_least_squares_has_hundreds() -> None:
    rng = np.random.default_rng(5)
    envelope, squares, rates = [], [], []
    for _ in range(40):
        numbers, host, least = arrivals(rng)
        fit = fit_clock(numbers.tolist(), host.tolist(), RATE)
        assert fit is not None
        envelope.append(np.mean([fit.time(number) for number in numbers]) - least.mean())
        rates.append(fit.rate - 1.0 - DRIFT)
        x = numbers - numbers.mean()
        squares.append((np.polyval(np.polyfit(x, host, 1), x) - least).mean())
    assert np.mean(squares) > 400e-6
    assert abs(np.mean(envelope)) < 1e-6
    assert np.max(np.abs(envelope)) < 5e-6
    assert np.std(rates) < 1e-6


@pytest.mark.parametrize("kind", ["exponential", "uniform"])
def test_stated_uncertainty_is_that_of_repeated_trials(kind: str) -> None:
    rng = np.random.default_rng(11)
    offsets, slopes = [], []
    numbers = np.arange(400)
    for _ in range(400):
        jitter = rng.exponential(1e-3, 400) if kind == "exponential" else rng.uniform(0.0, 2e-3, 400)
        fit = fit_clock(numbers.tolist(), (numbers / 100.0 + jitter).tolist(), 100.0)
        assert fit is not None
        offsets.append((fit.offset - fit.reference / 100.0) / fit.sd_offset)
        slopes.append((fit.rate - 1.0) / fit.sd_rate)
    # The step delta is itself estimated from 16 points (25 %), which widens the tails of the ratio.
    assert np.std(offsets) == pytest.approx(1.0, abs=0.35)
    assert np.std(slopes) == pytest.approx(1.0, abs=0.25)
    assert abs(np.mean(offsets)) < 0.25
    assert abs(np.mean(slopes)) < 0.2


def test_without_jitter_it_is_exact() -> None:
    numbers = np.arange(0, 1000, 3)
    fit = fit_clock(numbers.tolist(), (1e6 + 1.0001 * numbers / 100.0).tolist(), 100.0)
    assert fit is not None
    assert fit.rate == pytest.approx(1.0001, abs=1e-10)
    assert fit.time(500) == pytest.approx(1e6 + 5.0005, abs=1e-8)
    assert fit.sd(0) == 0.0


def test_uncertainty_grows_away_from_the_middle() -> None:
    numbers, host, _ = arrivals(np.random.default_rng(1))
    fit = fit_clock(numbers.tolist(), host.tolist(), RATE)
    assert fit is not None
    assert fit.sd(fit.reference) == fit.sd_offset
    assert fit.sd(fit.reference + 10_000) > fit.sd(numbers[-1]) > fit.sd_offset


def test_lost_frames_and_late_ones_do_not_move_it() -> None:
    rng = np.random.default_rng(2)
    numbers, host, least = arrivals(rng)
    keep = rng.random(len(numbers)) > 0.3
    host = host + np.where(rng.random(len(host)) < 0.2, 0.05, 0.0)
    fit = fit_clock(numbers[keep].tolist(), host[keep].tolist(), RATE)
    assert fit is not None
    assert fit.time(1500) - least[500] == pytest.approx(0.0, abs=10e-6)


def test_too_few_frames_tell_nothing() -> None:
    numbers = list(range(LEAST_FRAMES - 1))
    assert fit_clock(numbers, [float(n) for n in numbers], 1.0) is None
