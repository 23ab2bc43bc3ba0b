"""Each channel is white where nothing is wrong with it, and not where something is, whatever the others show."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.mle.fit import fit
from fidim_lab.mismatch.residuals.channels import Channel, channels, trend
from fidim_lab.model.mechanism import Mechanism


@pytest.fixture(scope="module")
def windows(campaign_of: Callable[..., Campaign]) -> tuple[Window, ...]:
    return campaign_of(seed=45, windows=5, seconds=2.5).of_role(Role.IDENTIFY)


@pytest.fixture(scope="module")
def mechanism(irma4: Robot) -> Mechanism:
    return Mechanism(irma4, native=True)


def shown(mechanism: Mechanism, *windows: Window) -> dict[str, Channel]:
    return {one.channel: one for one in channels(fit(mechanism, windows))}


def test_all_are_white_where_nothing_is_wrong(mechanism: Mechanism, windows: tuple[Window, ...]) -> None:
    found = shown(mechanism, *windows)
    assert list(found) == ["markers", "lengths", "currents"]
    assert all(one.white and one.p > 0.01 and (one.trend_over_windows or 0) > 0.02 for one in found.values())


def test_a_winch_that_creeps_within_windows_shows_in_the_lengths(mechanism, windows) -> None:
    creeping = [replace(w, lengths=w.lengths + 2e-4 * (w.t - w.t[0])[:, None] * [0, 0, 1, 0]) for w in windows]
    found = shown(mechanism, *creeping)
    assert not found["lengths"].white
    assert found["markers"].white


def test_a_count_more_or_less_within_a_window_says_nothing(irma4: Robot, mechanism, windows) -> None:
    count = irma4.sensors.encoder_resolution
    late = [np.where((w.t > w.t[0] + 1.0)[:, None], w.lengths[0] + count, w.lengths[0]) for w in windows]
    counted = [replace(w, lengths=read) for w, read in zip(windows, late, strict=True)]
    assert shown(mechanism, *counted)["lengths"].white


def test_what_motors_lift_beside_the_platform_shows_in_the_currents(mechanism, windows) -> None:
    rubbing = [replace(w, currents=w.currents + 0.2 * np.sin(2 * np.pi * 0.8 * w.t)[:, None]) for w in windows]
    found = shown(mechanism, *rubbing)
    assert not found["currents"].white
    assert found["lengths"].white


def test_a_shift_between_two_windows_shows_in_their_order(mechanism, windows) -> None:
    apart = [replace(w, lengths=w.lengths + 1e-3 * (k > 2) * np.array([1, 0, 0, 0])) for k, w in enumerate(windows)]
    told = shown(mechanism, *apart)["lengths"].trend_over_windows
    assert told is not None
    assert told < 0.01


def test_what_was_not_recorded_is_not_listed(mechanism, windows) -> None:
    bare = [replace(w, lengths=None, currents=None) for w in windows]
    assert list(shown(mechanism, *bare)) == ["markers"]


def test_three_windows_have_no_trend() -> None:
    assert trend(np.random.default_rng(1).normal(size=(3, 2))) is None


@pytest.mark.parametrize("count", [5, 9])
def test_noise_has_a_trend_no_more_often_than_it_says(count: int) -> None:
    rng = np.random.default_rng(7)
    told = np.array([trend(rng.normal(size=(count, 3))) for _ in range(400)])
    assert 0.02 < np.mean(told <= 0.1) < 0.13  # less than 0.1: the courses are alike


@pytest.mark.parametrize("course", [np.arange(8.0), (np.arange(8) > 4) * 2.0, -((np.arange(8) > 0) * 3.0)])
def test_a_drift_and_a_step_are_trends(course: np.ndarray) -> None:
    values = np.random.default_rng(3).normal(size=(8, 3))
    values[:, 1] = 0.3 * values[:, 1] + course
    assert trend(values) is not None
    assert (trend(values) or 1.0) < 0.02
    assert trend(np.zeros((8, 3))) == 1.0
