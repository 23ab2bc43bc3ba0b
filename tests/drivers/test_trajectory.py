"""Moves as functions of time: against exact kinematics integrated in small steps, and what every one must keep."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.trajectory import Trajectory

PLACES = st.floats(-1.0, 1.0)
MOVES = st.builds(
    Trajectory,
    st.just(3.0),
    PLACES,
    PLACES,
    st.floats(0.01, 2.0),
    st.floats(0.1, 5.0),
    st.one_of(st.just(0.0), st.floats(-2.0, 2.0)),
)


@given(MOVES)
def test_it_begins_as_told_and_ends_at_rest_on_its_target(move):
    assert move.at(move.t) == (move.start, move.velocity)
    assert move.end >= move.t
    place, velocity = move.at(move.end - 1e-9)
    assert place == pytest.approx(move.target, abs=1e-7)
    assert velocity == pytest.approx(0.0, abs=1e-7)
    assert move.at(move.end + 10.0) == (move.target, 0.0)


@given(MOVES, st.floats(0.0, 1.0))
def test_place_is_the_sum_of_speeds_and_no_ramp_is_steeper_than_asked(move, part):
    t, step = move.t + part * (move.end - move.t), 1e-5
    (before, v0), (after, v1) = move.at(t), move.at(t + step)
    assert after - before == pytest.approx(0.5 * (v0 + v1) * step, abs=1e-9)
    assert abs(v1 - v0) <= move.acceleration * step * 1.001 + 1e-9
    assert abs(v1) <= max(move.speed, abs(move.velocity)) + 1e-9


@given(PLACES, st.floats(-1.0, 1.0), st.floats(0.1, 5.0))
def test_a_stop_takes_what_its_ramp_needs(place, velocity, ramp):
    stop = Trajectory.stopping(1.0, place, velocity, ramp)
    assert stop.is_stop
    assert stop.end - stop.t == pytest.approx(abs(velocity) / ramp)
    assert stop.target - place == pytest.approx(math.copysign(velocity**2, velocity) / (2.0 * ramp))


def test_before_its_beginning_it_came_at_the_speed_that_it_begins_with():
    assert Trajectory.stopping(1.0, 0.5, 0.2, 2.0).at(0.5) == pytest.approx((0.4, 0.2))
    assert Trajectory.standing(1.0, 0.5).at(-7.0) == (0.5, 0.0)
    assert not Trajectory(0.0, 0.0, 1.0).is_stop
