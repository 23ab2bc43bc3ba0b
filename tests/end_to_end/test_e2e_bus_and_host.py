"""The bus fails, or this computer does: the drives stop by themselves, and what is said blames no single drive."""

import asyncio
import threading

import pytest

from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import controlword
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis.machine import State

STEPS = {"MoveTo": 0.4, "Settle": 0.1, "Ask": 1.0, "Record": 0.5}
HOST_TIMEOUT, SPEED, RAMP = 0.25, 0.1, 5.0
"""s, m/s, m/s²: as compose and the settings have them"""
METRES_PER_COUNT = 2e-5

FAILURES = {
    "cable cut": (
        lambda stage: setattr(stage.bus, "cut", True),
        "all 4 winches have not answered for 0.1",
    ),
    "adapter unplugged": (
        lambda stage: setattr(stage.bus, "fault", "adapter unplugged"),
        "all 4 winches report a fault: adapter unplugged",
    ),
    "bus-off": (
        lambda stage: setattr(stage.bus, "fault", "the controller is bus-off"),
        "all 4 winches report a fault: the controller is bus-off",
    ),
    "control loop ended": (
        lambda stage: stage.end_task("CanopenMaster.run"),
        "look at the bus, its adapter and power, and whether this computer's control loop kept up",
    ),
}

ASKED = "control loop ended"
"""the bus still works: once their own watchdogs have stopped the drives, their encoders answer by SDO"""


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.sampled(1)
def test_drives_that_hear_nothing_stop_by_themselves(rehearsal, failure, step):
    breaks, says = FAILURES[failure]
    places = []

    def fault(stage):
        places[:] = [shaft.motion(stage.now()).position for shaft in stage.rig.laboratory.shafts]
        breaks(stage)

    rehearsal.at(step, fault, after=STEPS[step])
    ended = rehearsal.run()
    report = ended.check(held=False)  # nobody could see it
    assert says in report.reason
    assert "cut the power by hand before you go near" in report.held_says
    assert report.held_says.startswith("All winches stand still by now" if failure == ASKED else "NOT VERIFIED")
    assert "winch 1, winch 2, winch 3, winch 4, each: was not seen to stop" in report.held_says
    assert report.exit_code == 3
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}
    farthest = SPEED * (HOST_TIMEOUT + 0.05) + SPEED**2 / (2 * RAMP)
    for (place, _), before in zip(ended.shafts, places, strict=True):
        assert abs(place - before) * METRES_PER_COUNT <= farthest


def test_a_bus_that_fails_at_bring_up(rehearsal):
    rehearsal.at("Enable", lambda stage: setattr(stage.bus, "cut", True), after=0.05)
    ended = rehearsal.run()
    report = ended.check(held=False)
    assert report.reason.startswith(
        "4 of 4 winches: winch 1 (node 1), winch 2 (node 2), winch 3 (node 3), winch 4 (node 4): OPERATIONAL"
    )
    assert {drive.state for drive in ended.drives} == {State.SWITCH_ON_DISABLED}


def test_a_control_loop_that_hangs_for_a_moment_stops_the_drives_and_they_stay_stopped(rehearsal):
    """The loop comes back after half a second, finds its drives stopped, and does not start them again."""

    async def hang(stage):
        clock, times = stage.rig.rig.clock, 50
        rule = FrameRule(frozenset({0x77F}), count=times // 5, drop=True)  # heartbeats of a loop that hangs
        stage.bus.rules.append(rule)
        await clock.sleep(0.01 * times)

    rehearsal.at("MoveTo", lambda stage: stage.tasks.append(asyncio.ensure_future(hang(stage))), after=0.3)
    ended = rehearsal.run()
    report = ended.check()
    assert "all 4 winches report a fault: emergency 0x8130 (heartbeat or node guarding lost)" in report.reason or (
        "all 4 winches are in state “quick stop active”" in report.reason
    )
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}
    stop = controlword(Command.QUICK_STOP)
    assert all(word == stop for _, _, word in ended.controlwords(since=ended.trip.t + 1e-6))


def test_lost_and_doubled_frames_disturb_nothing(rehearsal):
    """Here and there a process data frame is missing or comes twice: values get a cycle older, nothing else."""
    every = [
        FrameRule(frozenset({0x180 + node, 0x280 + node}), skip=100 * k, count=1, drop=True)
        for node in (1, 2, 3, 4)
        for k in range(1, 8)
    ]
    doubled = FrameRule(frozenset({0x181, 0x282, 0x583}), copies=2)
    rehearsal.at("", lambda stage: stage.bus.rules.extend([*every, doubled]))
    report = rehearsal.run().check()
    assert report.exit_code == 0


@pytest.mark.slow
def test_in_real_time_a_process_that_hangs_is_missed_by_its_drives(scene):
    """The whole process stands still for 0.8 s: on a real python-can bus the drives, in their own thread, stop."""
    ended = scene.in_real_time(
        lambda rehearsal: rehearsal.at("MoveTo", lambda stage: threading.Event().wait(0.8), after=0.3),
        starved=(),  # which is what is planted
    )
    report = ended.check(held=ended.report.held, log=False)
    assert report.held
    assert report.exit_code == 3
    assert "this computer stood still for " in report.reason  # whichever guard is the first that sees what came of it
    assert {drive.state for drive in ended.drives} == {State.QUICK_STOP_ACTIVE}
