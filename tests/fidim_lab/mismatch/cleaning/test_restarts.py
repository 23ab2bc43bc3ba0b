"""Pushes that only a matched test shows: found with window and times, and never where nobody pushed."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.cleaning import restarts
from fidim_lab.mismatch.cleaning.clean import clean
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.cleaning.restarts import _has_its_moment, find_pushes
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.fit_data import shortened
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.select import select
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


@cache
def fitted(robot: Robot, *hidden: str, seed: int = 31) -> Baseline:
    plan = random_plan(robot, "short", 3, 1, seed)
    world = make_world(robot, np.random.default_rng(seed), tuple(parse_effect(text, robot.n) for text in hidden))
    made: Campaign = simulate_campaign(robot, plan, world, np.random.default_rng(seed + 1), recording=Sampling(6.0))[0]
    return fit_baseline(clean(made).campaign, native=True, say=lambda _: None)


def pushes(baseline: Baseline) -> tuple[Contact, ...]:
    return find_pushes(baseline.as_it_is, baseline.predicted, baseline.held_out)


@pytest.mark.slow
@pytest.mark.parametrize(("place", "window"), [(2, "i02"), (3, "v01")])
def test_a_faint_push_is_found_with_its_window_and_times(irma4: Robot, place: int, window: str) -> None:
    (push,) = pushes(fitted(irma4, f"hand-contact:fx=0.15,fy=-0.2,start=2.5,stop=3.3,window={place}"))
    assert push.window == window
    assert push.begin == pytest.approx(2.5 - CLEANING.timed, abs=2 * CLEANING.timed)
    assert push.end == pytest.approx(3.3 + CLEANING.timed, abs=2 * CLEANING.timed)
    assert push.gain is not None
    assert push.gain > 30
    assert f"lowers χ² by {push.gain:.0f}" in push.says


def test_nobody_pushes_where_nothing_is_missing(irma4: Robot) -> None:
    baseline = fitted(irma4)
    assert not pushes(baseline)


def test_parts_too_short_for_two_starts_show_no_push(irma4: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    baseline = fitted(irma4)
    first, *others = baseline.campaign.of_role(Role.IDENTIFY)
    found = fit(
        baseline.fit.likelihood.mechanism,
        [shortened(first, 2 * CLEANING.beside - CLEANING.timed), *others],
    )
    model = Completed((), found, whole=True)
    monkeypatch.setattr(restarts, "_odd", lambda leftovers: {first.id})
    assert find_pushes(model, predict(model, ()), ()) == ()


@pytest.mark.slow
def test_physics_that_acts_in_every_window_is_no_push(irma4: Robot) -> None:
    found = select(fitted(irma4, "air-drag-quadratic:c=0.3"), lambda _: None)
    assert not found.pushes
    assert found.best.model.label == "air-drag-quadratic"


@pytest.mark.slow
def test_a_search_ends_at_a_push_that_is_all_that_is_left(irma4: Robot) -> None:
    found = select(fitted(irma4, "hand-contact:fx=0.15,fy=-0.2,start=2.5,stop=3.3,window=2"), lambda _: None)
    assert [push.window for push in found.pushes] == ["i02"]
    assert not found.best.model.tried


def test_parts_of_a_window_know_which_they_were_cut_from(irma4: Robot) -> None:
    campaign = fitted(irma4).campaign
    once = without(campaign, [Contact("i01", 2.0, 2.5, 2.0, 0.25)])
    parts = [window.id for window in once.windows if whole_id(window.id) == "i01"]
    assert parts == ["i01", "i01, part 2"]
    twice = without(replace(once), [Contact("i01, part 2", 4.0, 4.4, 2.0, 0.25)])
    assert [whole_id(window.id) for window in twice.windows].count("i01") == 3
    assert len({window.id for window in twice.windows}) == len(twice.windows)


def test_a_push_has_its_moment_and_physics_has_none() -> None:
    at = np.arange(1.0, 9.25, 0.25)
    times, best = np.column_stack([at, at]), 12
    sharp = 6000 + 900 * np.abs(at - at[best])
    assert _has_its_moment(times, sharp, best)
    broad = 6000 + 8 * np.abs(at - at[best])
    assert not _has_its_moment(times, broad, best)
    short = np.abs(at - at[best]) < 0.9  # so short a window has no time that is far away
    assert _has_its_moment(times[short], broad[short], int(np.argmin(broad[short])))


@pytest.mark.slow
def test_a_push_beside_physics_is_taken_for_no_friction(irma4: Robot) -> None:
    hidden = ("gravity-tilt:rx=0.012,ry=0.006", "hand-contact:fx=0.42,fy=0.38,start=2.5,stop=3.0,window=1")
    found = select(fitted(irma4, *hidden), lambda _: None)
    assert [push.window for push in found.pushes] == ["i01"]
    assert found.best.model.label in ("gravity-tilt", "constant-force")
