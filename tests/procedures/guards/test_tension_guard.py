"""A motor current that stays exactly the same while its winch moves is no measurement."""

import math

import pytest

from drivers.ports import DriveState, WinchSample
from procedures.guards.guard import Observation
from procedures.guards.robot_guards import TensionGuard
from procedures.settings import GuardSettings
from procedures.steps import Phase


def seen(t, current, velocity, phase=Phase.MOVING):
    sample = WinchSample(t, DriveState.OPERATION_ENABLED, 1.0, velocity, current, False)
    return Observation(t=t, phase=phase, winches=(sample,), frame=None)


@pytest.mark.parametrize(
    ("current", "velocity", "trips"),
    [
        (lambda t: 2.0, 0.1, True),
        (lambda t: 2.0, -0.1, True),
        (lambda t: 2.0 + (t > 0.5) * 0.005, 0.1, False),  # one digit, once
        (lambda t: 2.0, 0.001, False),  # friction may hold a winch that hardly moves
    ],
)
def test_stuck_while_moving(current, velocity, trips):
    guard = TensionGuard([34.0], (20.0, 200.0), GuardSettings())
    says = [guard.look(seen(0.01 * k, current(0.01 * k), velocity)) for k in range(120)]
    assert any(says) == trips
    if trips:
        first = next(k for k, text in enumerate(says) if text)
        assert first == pytest.approx(100, abs=1)
        assert says[first].startswith("the motor current of cable 1 is exactly 2 A for 1 s while its winch moves")


def test_a_drive_that_tells_no_load_leaves_no_tension_known():
    says = TensionGuard([34.0], (20.0, 200.0), GuardSettings()).look(seen(0.0, math.nan, 0.0))
    assert says == "the tension of cable 1 is unknown: its drive reports neither current nor torque"


@pytest.mark.parametrize(("newton", "seconds"), [(0.0, 2.0), (9.0, 2.0), (15.0, None)])
def test_a_hand_may_slacken_a_cable_briefly(newton, seconds):
    guard, slack = TensionGuard([1.0], (20.0, 200.0), GuardSettings()), []
    for k in range(400):
        noise = 3.0 * (-1) ** k
        slack.append(guard.look(seen(0.01 * k, newton + noise * (newton < 5.0), 0.0, Phase.HANDLING)))
    first = next((0.01 * k for k, says in enumerate(slack) if says), None)
    assert first == (None if seconds is None else pytest.approx(seconds, abs=0.02))


def test_what_was_slack_by_hand_is_judged_anew_when_the_hand_is_gone():
    guard = TensionGuard([1.0], (20.0, 200.0), GuardSettings())
    assert not any(guard.look(seen(0.01 * k, 0.0, 0.0, Phase.HANDLING)) for k in range(190))
    says = [guard.look(seen(1.9 + 0.01 * k, 0.0, 0.0, Phase.RESTING)) for k in range(20)]
    assert next(k for k, text in enumerate(says) if text) == pytest.approx(10, abs=1)
    assert "handled" not in says[-1]
