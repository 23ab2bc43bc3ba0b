"""Held-out windows that a right model misses by its own errors count as followed; missing physics does not hide there.

One short window tells little of how the platform swings elsewhere: there the right model is seen to be off.
"""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import predict_all
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.fitting.beyond_errors import beyond_errors
from fidim_lab.mismatch.fitting.fit_data import short_fit
from fidim_lab.mismatch.fitting.holdout import chi2_beyond_errors
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


def recorded(robot: Robot, *hidden: str) -> Campaign:
    effects = tuple(parse_effect(text, robot.n) for text in hidden)
    world = make_world(robot, np.random.default_rng(31), effects)
    plan = random_plan(robot, "few", 1, 4, 31)
    return simulate_campaign(robot, plan, world, np.random.default_rng(32), recording=Sampling(3.0))[0]


def chi2(values: list[np.ndarray], noise: float) -> float:
    return sum(float(np.nansum((one / noise) ** 2)) for one in values)


def left(found: Fit, campaign: Campaign, free: np.ndarray) -> tuple[float, float, int]:
    """χ² of the held-out windows as predicted, beyond errors, and their number of figures."""
    robot = campaign.robot
    recordings = [prepare(window, robot) for window in campaign.of_role(Role.VALIDATE)]
    predicted = predict_all(found.likelihood.mechanism, found.values, recordings, robot.sensors)
    plain = [one.remainder.residuals for one in predicted]
    count = sum(int(np.isfinite(one).sum()) for one in plain)
    after = beyond_errors(found, free, predicted)
    noise = robot.sensors.marker_noise
    return chi2(plain, noise), chi2(after, noise), count


@pytest.fixture(scope="module")
def fitted(irma4: Robot) -> tuple[Campaign, Fit]:
    campaign = recorded(irma4)
    return campaign, short_fit(Mechanism(irma4, native=True), campaign.of_role(Role.IDENTIFY))


def test_what_the_fit_does_not_know_is_no_misfit(fitted: tuple[Campaign, Fit]) -> None:
    campaign, found = fitted
    everything = np.ones(len(found.values), dtype=bool)
    before, beyond, count = left(found, campaign, everything)
    assert before > count + 6 * np.sqrt(2 * count), "that must be seen"
    assert beyond < count + 3 * np.sqrt(2 * count)
    # what the fit held stays where it is
    assert left(found, campaign, ~everything)[1] == pytest.approx(before, rel=0.02)


def test_missing_physics_stays(irma4: Robot, fitted: tuple[Campaign, Fit]) -> None:
    _, found = fitted
    windy = recorded(irma4, "air-drag-linear:c=1.5")
    before, beyond, count = left(found, windy, np.ones(len(found.values), dtype=bool))
    assert before > 3 * count
    assert beyond > 1.5 * count


def test_what_a_body_changes_by_is_known_no_better_than_it_was_estimated(fitted: tuple[Campaign, Fit]) -> None:
    campaign, found = fitted
    sideways = np.eye(9)[:, 1:2]
    off = -0.003 * sideways[:, 0]  # m: of the centre of mass
    known = [replace(window, body_change=off) for window in campaign.windows]
    open_ = [replace(window, body_change_by=0.006 * sideways) for window in known]
    everything = np.ones(len(found.values), dtype=bool)
    before, beyond, count = left(found, replace(campaign, windows=tuple(known)), everything)
    assert beyond > 2 * count, "that must be seen"
    assert left(found, replace(campaign, windows=tuple(open_)), everything)[:2] == (
        pytest.approx(before),
        pytest.approx(count, abs=4 * np.sqrt(2 * count)),
    )


def test_nothing_is_recorded_where_nothing_was(fitted: tuple[Campaign, Fit]) -> None:
    campaign, found = fitted
    window = campaign.of_role(Role.VALIDATE)[0]
    markers = window.markers.copy()
    markers[100:150] = np.nan
    recording = prepare(replace(window, markers=markers), campaign.robot)
    predicted = predict_all(found.likelihood.mechanism, found.values, [recording], campaign.robot.sensors)
    (after,) = beyond_errors(found, np.ones(len(found.values), dtype=bool), predicted)
    assert np.array_equal(np.isnan(after), np.isnan(predicted[0].remainder.residuals))


def test_the_figure_beyond_errors_is_that_of_the_held_out_windows(fitted: tuple[Campaign, Fit]) -> None:
    campaign, found = fitted
    _, beyond, count = left(found, campaign, np.ones(len(found.values), dtype=bool))
    assert chi2_beyond_errors(found, campaign.of_role(Role.VALIDATE)) == pytest.approx((beyond, count), rel=0.02)
