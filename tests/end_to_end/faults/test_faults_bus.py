"""A bus that fails, and a host."""

from collections.abc import Callable
from typing import Any

import pytest

from procedures.guards.host_guards import ClockStepGuard
from sim_backends.bus_faults import FrameRule

NODES = (1, 2, 3, 4)


@pytest.mark.fault(
    "bus",
    "the cable to the host is cut",
    reaction="the drives stop by themselves",
    within=0.3,
    says="all 4 winches have not answered for 0.1",
    window="kept",
    held=False,
)
def test_a_cut_bus(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: setattr(stage.bus, "cut", True))


@pytest.mark.fault(
    "bus",
    "the adapter is unplugged",
    reaction="the drives stop by themselves",
    within=0.3,
    says="all 4 winches report a fault: adapter unplugged",
    window="kept",
    held=False,
)
def test_an_unplugged_adapter(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: setattr(stage.bus, "fault", "adapter unplugged"))


@pytest.mark.fault(
    "bus",
    "the controller goes bus-off",
    reaction="the drives stop by themselves",
    within=0.3,
    says="all 4 winches report a fault: the controller is bus-off",
    window="kept",
    held=False,
)
def test_bus_off(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: setattr(stage.bus, "fault", "the controller is bus-off"))


@pytest.mark.fault(
    "bus",
    "single frames of drives are lost",
    reaction="none",
    says="i01",
    window="accepted",
    journal="STEP_FINISHED",
)
def test_lost_frames(rehearsal, fault):
    rules = [
        FrameRule(frozenset({0x180 + node, 0x280 + node}), skip=20 * k + node, count=1, drop=True)
        for node in NODES
        for k in range(15)
    ]
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.extend(rules), after=0.1)


@pytest.mark.fault(
    "bus",
    "a third of a drive's frames are lost",
    reaction="warning",
    within=1.0,
    says="bus cycles of the last second brought no sample",
    window="accepted",
    journal="WARNED",
)
def test_many_lost_frames(rehearsal, fault):
    rules = [FrameRule(frozenset({0x182}), skip=2 * k, count=1, drop=True) for k in range(120)]
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.extend(rules), after=0.1)


@pytest.mark.fault(
    "bus",
    "frames come doubled",
    reaction="none",
    says="i01",
    window="accepted",
    journal="STEP_FINISHED",
)
def test_doubled_frames(rehearsal, fault):
    double = FrameRule(frozenset({0x181, 0x282, 0x583, 0x704}), copies=2)
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.append(double), after=0.1)


@pytest.mark.fault(
    "bus",
    "frames come late by most of a cycle",
    reaction="none",
    says="i01",
    window="accepted",
    journal="STEP_FINISHED",
)
def test_late_frames(rehearsal, fault):
    late = FrameRule(frozenset({0x182, 0x282}), delay=0.003)
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.append(late), after=0.1)


@pytest.mark.fault(
    "bus",
    "frames of a drive are cut short",
    reaction="quick stop",
    within=0.25,
    says="TPDOs had a wrong length",
    window="kept",
    held=False,
)
def test_malformed_frames(rehearsal, fault):
    torn = FrameRule(frozenset({0x182, 0x282}), change=lambda data: data[:3])
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.append(torn))


@pytest.mark.fault(
    "host",
    "the host's heartbeat stops",
    reaction="the drives stop by themselves",
    within=0.3,
    says="all 4 winches ",
    window="kept",
)
def test_a_host_without_heartbeat(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.bus.rules.append(FrameRule(frozenset({0x77F}), drop=True)))


@pytest.mark.fault(
    "host",
    "the laptop is suspended and wakes up",
    reaction="quick stop",
    within=0.05,
    says="all 4 winches report a fault: emergency 0x8130",
    window="kept",
)
def test_a_suspended_laptop(rehearsal, fault):
    """The monotonic clock stands meanwhile: the host wakes up to drives that have missed it, and to another time."""
    wall = [0.0]

    def sleep(stage: Any) -> None:
        wall[0] += 3600.0
        for drive in stage.rig.drives:
            drive.faults.miss_host()

    fault.strikes(rehearsal, sleep, guards=(clock_guard(rehearsal, wall),))


@pytest.mark.parametrize("by", [3600.0, -3600.0], ids=["forth", "back"])
@pytest.mark.fault(
    "host",
    "the time of day is set by an hour, forth or back",
    reaction="warning",
    within=1.0,
    says="the computer's time of day was changed by",
    window="accepted",
    journal="WARNED",
)
def test_a_stepped_clock(rehearsal, fault, by):
    wall = [0.0]
    ended = fault.strikes(
        rehearsal, lambda stage: wall.__setitem__(0, by), after=0.1, guards=(clock_guard(rehearsal, wall),)
    )
    times = [e.t for e in ended.journal]
    assert times == sorted(times), "nothing is timed by it"


def clock_guard(rehearsal: Any, wall: list[float]) -> ClockStepGuard:
    """Of a wall clock that is the simulation's, and `wall` beyond it."""
    now: list[Callable[[], float]] = []
    rehearsal.at("", lambda stage: now.append(stage.now))
    return ClockStepGuard(lambda: now[0]() + wall[0] if now else 0.0)
