"""Encoders of the swivels: a channel of their own, and what they allow of friction there."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Role, Window
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.certainty import with_swivels
from fidim_lab.mismatch.conclusion.explanation import ClassMember, Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter
from fidim_lab.mismatch.residuals.channels import Channel, channels
from fidim_lab.mismatch.residuals.swivels import lag, swivels
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.own_sensors import OwnNoise
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

NOISE = OwnNoise(swivel=2e-4)


@pytest.fixture(scope="module")
def windows(irma4: Robot) -> tuple[Window, ...]:
    world, rng = make_world(irma4, np.random.default_rng(51)), np.random.default_rng(52)
    plan = random_plan(irma4, "swivels", 4, 0, 51)
    campaign = simulate_campaign(irma4, plan, world, rng, recording=Sampling(2.5, own_sensors=NOISE))[0]
    return campaign.of_role(Role.IDENTIFY)


def fitted(robot: Robot, *windows: Window) -> Fit:
    return fit(Mechanism(robot, native=True), windows)


def shown(found: Fit) -> Channel:
    return next(one for one in channels(found) if one.channel == "swivels")


def with_read(window: Window, k: int, read: np.ndarray) -> Window:
    return replace(window, further={**window.further, f"s{k}": read})


def held_back(window: Window, behind: float) -> Window:
    """By so many rad behind the way in which each cable turns."""
    for k in range(1, 5):
        read = window.further[f"s{k}"]
        smooth = np.convolve(np.pad(read, 10, mode="edge"), np.ones(21) / 21, mode="valid")
        rate = np.gradient(smooth, window.t)
        window = with_read(window, k, read - behind * np.tanh(rate / 0.01))
    return window


def test_swivels_that_follow_are_white_whatever_their_zeros_and_delay(irma4: Robot, windows) -> None:
    later = [with_read(w, 1, np.interp(w.t - 0.005, w.t, w.further["s1"]) + 0.7) for w in windows]
    found = shown(fitted(irma4, *later))
    assert found.white
    assert found.trend_over_windows is not None
    assert found.trend_over_windows > 0.01


def test_swivels_that_stick_are_not_white_and_the_motion_is_as_it_was(irma4: Robot, windows) -> None:
    found = fitted(irma4, *(held_back(w, 1e-3) for w in windows))
    assert not shown(found).white
    assert found.explained


def test_a_zero_that_was_lost_between_windows_shows_in_their_order(irma4: Robot, windows) -> None:
    lost = [with_read(w, 3, w.further["s3"] + 0.01 * (n > 1)) for n, w in enumerate(windows)]
    found = shown(fitted(irma4, *lost))
    assert found.trend_over_windows is not None
    assert found.trend_over_windows < 0.05


def test_the_lag_is_found_with_its_friction_at_most(irma4: Robot, windows) -> None:
    behind = lag(swivels(fitted(irma4, *(held_back(w, 1e-3) for w in windows))))
    assert behind is not None
    assert behind.angle == pytest.approx(1e-3, rel=0.3)
    assert behind.sd < 1e-4
    none = lag(swivels(fitted(irma4, *windows)))
    assert none is not None
    assert abs(none.angle) < 5 * none.sd
    assert none.most_torque < behind.most_torque
    tension = np.mean([one.tensions for one in swivels(fitted(irma4, *windows))])
    assert behind.most_torque == pytest.approx(2 * irma4.cables[0].radius * tension * 1e-3, rel=0.5)


def test_two_windows_of_one_cable_tell_no_lag(irma4: Robot, windows) -> None:
    bare = [replace(w, further={}) for w in windows]
    assert not swivels(fitted(irma4, *bare))
    assert lag([]) is None


def told(c: float, *, single: bool = False) -> Explanation:
    none = Before(1.0, 1.0)
    sizes = {"c": EffectParameter(c, 1e-4, "N m")}
    member = ClassMember("swivel-friction", None, 1.0, sizes)
    cause = NamedCause("attachment-friction", None, ("swivel-friction",), {}, "says", (member,), single=single)
    return Explanation("c", Verdict.EXPLAINED, (cause,), (), none, none, (), {}, {}, "Read them.", "Left out.", 1.0)


def test_friction_that_swivels_do_not_show_is_said_not_to_be_there(irma4: Robot, windows) -> None:
    found = fitted(irma4, *windows)
    large = with_swivels(told(0.05), found)
    assert "lag behind the cables by" in large.message
    assert (large.next_experiment or "").endswith("not 0.05 N m: look at attachments and pulleys first.")
    assert with_swivels(told(1e-6), found).next_experiment == "Read them."
    assert with_swivels(told(0.05, single=True), found).next_experiment == "Read them."
    without = fitted(irma4, *(replace(w, further={}) for w in windows))
    assert with_swivels(told(0.05), without) == told(0.05)
