"""Encoder against command: standing, on the way, stopping; what a healthy drive does never trips it."""

import math

import pytest

from drivers.ports import DriveState, WinchSample
from drivers.trajectory import Trajectory
from procedures.guards.guard import Observation
from procedures.guards.motion_guard import Follower, MotionGuard, Tolerance
from procedures.settings import GuardSettings
from procedures.steps import Phase

TOLERANCE = Tolerance.of(GuardSettings())
HELD = Trajectory.standing(0.0, 1.4)
MOVE = Trajectory(0.0, 1.4, 1.2, 0.1, 0.2)


def sample(t, length, velocity=0.0):
    return WinchSample(t, DriveState.OPERATION_ENABLED, length, velocity, 1.0, True)


def first_trip(place, commanded, velocity=lambda t: 0.0, *, seconds=3.0, step=0.01):
    """When and where a winch that moves by `place` is first said to be wrong."""
    follower = Follower(TOLERANCE)
    for k in range(round(seconds / step)):
        t = k * step
        if says := follower.look(sample(t, place(t), velocity(t)), commanded):
            return t, says
    return None, ""


@pytest.mark.parametrize("speed", [0.001, 0.02, 0.05, -0.05, 0.3])
def test_a_held_winch_that_runs_is_seen_within_ten_millimetres(speed):
    t, says = first_trip(lambda t: 1.4 + speed * t, HELD, lambda t: speed, seconds=10.0)
    assert t is not None
    assert abs(speed) * t <= max(0.0041, 0.01 * abs(speed) * 1.01 + 0.003)
    assert "commanded position" in says or "was commanded" in says


def test_a_spinning_drum_is_seen_by_its_speed_before_its_length():
    t, says = first_trip(lambda t: 1.4 + 0.05 * t, HELD, lambda t: 0.05)
    assert says == "moves at +0.050 m/s, +0.000 m/s was commanded"
    assert t == pytest.approx(TOLERANCE.lasting)


def test_a_drum_that_gives_way_under_a_swinging_platform_is_let_be():
    assert first_trip(lambda t: 1.4 + 0.0015 * math.sin(8.0 * t), HELD, lambda t: 0.012 * math.cos(8.0 * t)) == (
        None,
        "",
    )


@pytest.mark.parametrize("late", [-0.05, 0.0, 0.05])
def test_a_drive_that_follows_its_profile_a_little_early_or_late_is_let_be(late):
    assert first_trip(lambda t: MOVE.at(t - late)[0], MOVE, lambda t: MOVE.at(t - late)[1]) == (None, "")


def test_a_drive_that_halts_or_never_begins_is_seen():
    def halts(t):
        return MOVE.at(min(t, 1.0))[0]

    t, _ = first_trip(halts, MOVE, lambda t: MOVE.at(t)[1] if t < 1.0 else 0.0)
    assert 1.0 < t <= 1.1
    t, _ = first_trip(lambda t: 1.4, MOVE)
    assert MOVE.start - MOVE.at(t)[0] <= 0.01


def test_a_drive_that_goes_to_another_target_is_seen():
    other = Trajectory(0.0, 1.4, 1.6, 0.1, 0.2)
    t, _ = first_trip(lambda t: other.at(t)[0], MOVE, lambda t: other.at(t)[1])
    assert other.at(t)[0] - 1.4 <= 0.01


def test_a_stop_that_is_not_obeyed_is_seen_and_a_stop_that_comes_late_is_let_be():
    stop = Trajectory.stopping(1.0, 1.4, -0.1, 5.0)
    t, _ = first_trip(lambda t: 1.4 - 0.1 * (t - 1.0), stop, lambda t: -0.1)
    assert 0.1 * (t - 1.0) <= 0.012
    late = Trajectory.stopping(1.03, 1.397, -0.1, 5.0)
    assert first_trip(lambda t: late.at(t)[0], stop, lambda t: late.at(t)[1]) == (None, "")


def test_nothing_commanded_nothing_wrong():
    assert Follower(TOLERANCE).look(sample(0.0, 7.0), None) == ""
    assert Follower(TOLERANCE).look(None, HELD) == ""


@pytest.mark.parametrize(("phase", "trips"), [(Phase.RECORDING, True), (Phase.RESTING, False)])
def test_a_guard_may_look_in_one_phase_only_and_names_the_winch(phase, trips):
    guard = MotionGuard(("a", "b"), Tolerance(2e-3), "slip", Phase.RECORDING)
    seen = Observation(0.0, phase, (sample(0.0, 1.4, 9.9), sample(0.0, 1.4025)), None, (HELD, HELD))
    says = guard.look(seen)
    assert says == ("b is +2.5 mm from its commanded position, 2 mm is allowed" if trips else None)


@pytest.mark.parametrize(("speed", "way"), [(0.01, 0.004), (-0.01, 0.004), (0.005, 0.005), (0.05, 0.002)])
def test_a_motor_that_turns_behind_an_encoder_that_stands_is_seen(speed, way):
    t, says = first_trip(lambda t: 1.4, HELD, lambda t: speed)
    assert abs(speed) * t <= way
    assert "does not follow" in says or "was commanded" in says


def test_an_offset_and_noise_of_the_velocity_are_let_be():
    rounding = 0.002  # m/s: a motor without gear that tells whole rpm
    assert first_trip(lambda t: 1.4, HELD, lambda t: rounding, seconds=60.0) == (None, "")
    assert first_trip(lambda t: 1.4, HELD, lambda t: 0.02 * (-1) ** round(t / 0.01), seconds=10.0) == (None, "")
    late = 0.02  # s of the drive's filter
    swing = (lambda t: 1.4 + 0.0015 * math.sin(8.0 * t), lambda t: 0.012 * math.cos(8.0 * (t - late)))
    assert first_trip(swing[0], HELD, swing[1], seconds=10.0) == (None, "")


def test_what_a_move_has_told_is_no_motion_at_rest():
    follower = Follower(TOLERANCE)
    for k in range(200):
        t = 0.01 * k
        assert not follower.look(sample(t, MOVE.at(t)[0], 0.9 * MOVE.at(t)[1]), MOVE)
    rest = Trajectory.standing(2.0, MOVE.at(2.0)[0])
    for k in range(200, 400):
        assert not follower.look(sample(0.01 * k, rest.at(2.0)[0]), rest)


def test_what_moves_while_nothing_is_commanded_is_no_motion_of_the_rest_after_it():
    """As where slack is wound up by torque: the drum turns between two places that are held."""
    follower = Follower(TOLERANCE)
    assert not follower.look(sample(0.0, 1.4), HELD)
    for k in range(1, 100):
        assert not follower.look(sample(0.01 * k, 1.4 - 0.0005 * k, -0.05), None)
    assert not follower.look(sample(1.0, 1.35), Trajectory.standing(1.0, 1.35))
    assert not follower.look(sample(1.01, 1.35), Trajectory.standing(1.0, 1.35))
