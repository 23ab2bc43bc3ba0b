"""Trapezoids against closed form, and as a property: continuous, within limits, ends at the target."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backends.drive.axis import DrumShaft, ShaftMotion
from sim_backends.drive.axis.profile import standing, stop, trapezoid


def test_from_rest_with_cruise():
    profile = trapezoid(1.0, ShaftMotion(100.0), 1100.0, speed=200.0, acceleration=400.0, deceleration=100.0)
    # 0.5 s up over 50, 2 s down over 200, 750 between at 200
    assert profile.end == pytest.approx(1.0 + 0.5 + 3.75 + 2.0)
    assert profile.at(1.5) == ShaftMotion(pytest.approx(150.0), pytest.approx(200.0), pytest.approx(0.0))
    assert profile.at(1.25) == ShaftMotion(pytest.approx(112.5), pytest.approx(100.0), 400.0)
    assert profile.at(5.25 + 1.0) == ShaftMotion(pytest.approx(1050.0), pytest.approx(100.0), -100.0)
    assert profile.at(99.0) == ShaftMotion(1100.0)


def test_triangle_backwards():
    profile = trapezoid(0.0, ShaftMotion(0.0), -100.0, speed=1e9, acceleration=100.0, deceleration=100.0)
    assert profile.end == pytest.approx(2.0)
    assert profile.at(1.0) == ShaftMotion(pytest.approx(-50.0), pytest.approx(-100.0), pytest.approx(100.0))


def test_too_fast_to_stop_at_the_target_comes_back():
    profile = trapezoid(0.0, ShaftMotion(0.0, 100.0), 10.0, speed=100.0, acceleration=100.0, deceleration=100.0)
    # stops at 50 after 1 s, then a triangle over −40
    assert profile.at(1.0).position == pytest.approx(50.0)
    assert profile.end == pytest.approx(1.0 + 2.0 * math.sqrt(0.4))


def test_faster_than_the_limit_slows_down_first():
    profile = trapezoid(0.0, ShaftMotion(0.0, 300.0), 1000.0, speed=100.0, acceleration=1.0, deceleration=100.0)
    assert profile.at(2.0) == ShaftMotion(pytest.approx(400.0), pytest.approx(100.0), pytest.approx(0.0, abs=1e-9))
    assert profile.end == pytest.approx(2.0 + 5.5 + 1.0)


def test_stop_closed_form():
    profile = stop(2.0, ShaftMotion(10.0, -60.0), 30.0)
    assert profile.at(3.0) == ShaftMotion(pytest.approx(-35.0), pytest.approx(-30.0), 30.0)
    assert (profile.end, profile.rest) == (4.0, ShaftMotion(-50.0))


def test_a_speed_of_zero_goes_nowhere():
    assert trapezoid(0.0, ShaftMotion(5.0), 100.0, 0.0, 1.0, 1.0).at(1e6) == ShaftMotion(5.0)


positive = st.floats(1.0, 1e6)


@given(
    position=st.floats(-1e8, 1e8),
    velocity=st.floats(-1e6, 1e6),
    target=st.floats(-1e8, 1e8),
    speed=positive,
    acceleration=positive,
    deceleration=positive,
)
def test_a_trapezoid_is_continuous_within_limits_and_arrives(
    position, velocity, target, speed, acceleration, deceleration
):
    profile = trapezoid(0.0, ShaftMotion(position, velocity), target, speed, acceleration, deceleration)
    assert profile.at(0.0).position == pytest.approx(position, abs=1e-3)
    assert profile.at(profile.end + 1.0) == ShaftMotion(target)
    if not profile.pieces:
        assert abs(target - position) < 1e-3
        return
    assert [piece.start for piece in profile.pieces] == sorted(piece.start for piece in profile.pieces)
    rounding = 1e-6 + 1e-15 * max(1.0, profile.end) * max(acceleration, deceleration)  # of the times, in counts/s
    size = max(abs(position), abs(target), velocity * velocity / deceleration, 1.0)
    for earlier, later in zip(profile.pieces, profile.pieces[1:], strict=False):
        dt = later.start - earlier.start
        a = earlier.motion.acceleration
        assert later.motion.velocity == pytest.approx(earlier.motion.velocity + a * dt, rel=1e-9, abs=rounding)
        mean = (earlier.motion.velocity + later.motion.velocity) / 2.0
        assert later.motion.position - earlier.motion.position == pytest.approx(mean * dt, rel=1e-6, abs=1e-7 * size)
        assert abs(later.motion.velocity) <= max(speed, abs(velocity)) * (1 + 1e-9)
        assert abs(a) <= max(acceleration, deceleration) * (1 + 1e-9)
    last = profile.pieces[-1].motion
    dt = profile.end - profile.pieces[-1].start
    assert last.velocity + last.acceleration * dt == pytest.approx(0.0, abs=rounding)
    assert last.position + last.velocity * dt / 2.0 == pytest.approx(target, abs=1e-7 * size)


def test_a_shaft_remembers_what_it_did_before_the_last_command():
    shaft = DrumShaft()
    shaft.follow(0.0, stop(0.0, ShaftMotion(0.0, 100.0), 10.0))
    shaft.follow(1.0, standing(95.0))
    assert shaft.motion(-1.0) == ShaftMotion(0.0)
    assert shaft.motion(0.5).position == pytest.approx(48.75)
    assert shaft.motion(1.0) == ShaftMotion(95.0)
