"""Drives that an earlier host has left with power: held all the while, or refused by name."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from drivers.cia402.bring_up import refuse_other_master
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.errors import BusError, DeviceError

OnBench = Callable[..., None]
QUICK_STOP, HALTED, DISABLE_VOLTAGE = 0x02, 0x10F, 0x00
SLOW = 2.0
"""s between a drive's heartbeats: longer than to look at all of it"""


async def left(bench: Any, state: str) -> None:
    """A host enables the drive, moves it, and is gone; this is how the drive then stands."""
    await bench.enabled()
    await bench.winch.move_to(2.0, 0.1, 0.3)
    await bench.cycles(50)
    bench.loop_task.cancel()
    await asyncio.gather(bench.loop_task, return_exceptions=True)
    bench.drive.state = state
    bench.drive.put(0x606C, 0)
    bench.drive.controlwords.clear()


async def taken_over(bench: Any, config: Callable[..., Any], **changes: Any) -> Cia402Winch:
    """By a second host; its control loop ends with the test's loop."""
    master = CanopenMaster(bench.bus, LoopClock())
    winch = Cia402Winch(config(**changes), master, takes_over=True)
    bench.loop_task = asyncio.create_task(master.run())
    await winch.configure()
    return winch


def test_a_drive_that_holds_is_taken_over_without_a_command_and_moves_again(on_bench, config):
    async def script(bench: Any) -> None:
        await left(bench, "quick stop")
        there = bench.drive.get(0x6064)
        winch = await taken_over(bench, config)
        assert bench.drive.controlwords == []
        assert winch.latest().state is DriveState.QUICK_STOP_ACTIVE
        assert all(check.ok for check in winch.checks)
        assert {"607D:1", "1A00", "6061:0"} <= {check.object for check in winch.checks}
        await winch.enable()
        await bench.cycles(20)
        assert bench.drive.controlwords[:2] == [QUICK_STOP, HALTED]
        assert DISABLE_VOLTAGE not in bench.drive.controlwords
        assert bench.drive.get(0x6064) == there  # the old move is not resumed
        await winch.move_to(1.1, 0.1, 0.3)
        await bench.cycles(20)
        assert bench.drive.get(0x6064) != there

    on_bench(script)


def test_a_drive_that_acts_only_on_a_controlword_that_changes_is_enabled_again(on_bench, config):
    """It stopped by itself, so what it was told last is still to enable; a drive on CANopenNode sees no other write."""

    async def script(bench: Any) -> None:
        bench.drive.acts_on_changes_only = True
        await left(bench, "quick stop")
        winch = await taken_over(bench, config)
        await winch.enable()
        assert winch.latest().state is DriveState.OPERATION_ENABLED
        assert DISABLE_VOLTAGE not in bench.drive.controlwords

    on_bench(script)


def test_a_drive_that_still_runs_is_stopped_first(on_bench, config):
    async def script(bench: Any) -> None:
        await left(bench, "enabled")
        winch = await taken_over(bench, config)
        assert bench.drive.controlwords == [QUICK_STOP]
        assert winch.latest().state is DriveState.QUICK_STOP_ACTIVE

    on_bench(script)


def test_a_drive_that_has_told_that_it_is_operational_is_not_waited_for_again(on_bench, config):
    async def script(bench: Any) -> None:
        await left(bench, "quick stop")
        master = CanopenMaster(bench.bus, LoopClock())
        winch = Cia402Winch(config(heartbeat=SLOW), master, takes_over=True)
        bench.loop_task = asyncio.create_task(master.run())
        while winch.link.heartbeat is None:
            await bench.cycles(1)
        told = winch.link.heartbeat.t
        await winch.configure()
        assert winch.link.heartbeat.t == told
        assert winch.latest().state is DriveState.QUICK_STOP_ACTIVE

    on_bench(script, heartbeat=SLOW)


def test_a_drive_that_was_being_switched_on_holds_nothing_and_is_brought_up(on_bench, config):
    async def script(bench: Any) -> None:
        await left(bench, "on")
        winch = await taken_over(bench, config)
        assert bench.drive.controlwords == [DISABLE_VOLTAGE]
        assert winch.latest().state is DriveState.SWITCH_ON_DISABLED

    on_bench(script)


def test_what_a_drive_samples_after_a_bring_up_answers_the_newest_sync(on_bench, config):
    """It still answers SYNCs of this host as the last one had it, then none while it is configured (0.3 s here)."""

    async def script(bench: Any) -> None:
        await left(bench, "on")
        clock = LoopClock()

        async def in_its_time(exchange: Callable[[], Any]) -> Any:
            await clock.sleep(0.003)
            return exchange()

        bench.bus.call = lambda _key, exchange: in_its_time(exchange)
        winch = await taken_over(bench, config)
        assert clock.now() - winch.latest().t <= 2.0 * bench.master.period

    on_bench(script)


@pytest.mark.parametrize(("object_", "value"), [(0x6065, 7), (0x605A, 2), (0x1016, 0), (0x1A01, 1), (0x6061, 3)])
def test_a_drive_that_holds_but_is_set_otherwise_is_left_holding_and_refused_by_name(on_bench, config, object_, value):
    async def script(bench: Any) -> None:
        await left(bench, "quick stop")
        bench.drive.put(object_, value, sub=1 if object_ == 0x1016 else 0)
        with pytest.raises(
            DeviceError, match=rf"holds the load, but with other settings than the rig file: {object_:04X}"
        ):
            await taken_over(bench, config)
        assert bench.drive.controlwords == []
        assert bench.drive.state == "quick stop"

    on_bench(script)


def test_a_drive_that_does_not_stop_is_said(on_bench, config):
    async def script(bench: Any) -> None:
        await left(bench, "enabled")
        bench.drive.deaf_to = {QUICK_STOP}
        with pytest.raises(DeviceError, match="was left running and does not stop: operation enabled"):
            await taken_over(bench, config)

    on_bench(script)


def test_a_drive_without_power_is_brought_up_as_ever(on_bench, config):
    async def script(bench: Any) -> None:
        bench.loop_task.cancel()
        winch = await taken_over(bench, config)
        assert bench.drive.controlwords == []
        assert bench.drive.get(0x605A) == 6
        assert winch.latest().state is DriveState.SWITCH_ON_DISABLED

    on_bench(script)


@pytest.mark.parametrize(
    ("frame", "name"),
    [
        ((0x080, b""), "SYNC"),
        ((0x77F, b"\x05"), "node 127"),
        ((0x000, b"\x80\x03"), "NMT"),
        ((0x7E5, bytes(8)), "LSS"),
        ((0x603, bytes(8)), "SDO request to node 3"),
        ((0x403, bytes(4)), "RPDO. to node 3"),
    ],
)
def test_a_second_master_is_heard_before_a_word_is_said(on_bench, frame, name):
    async def script(bench: Any) -> None:
        bench.loop_task.cancel()
        listening = asyncio.ensure_future(refuse_other_master(bench.bus, LoopClock(), 127, 0.2))
        await LoopClock().sleep(0.1)
        bench.bus.deliver(*frame)
        said = len(bench.bus.sent)
        with pytest.raises(BusError, match=rf"Another master is on this bus: 1 .*{name}.* within 0.2 s"):
            await listening
        assert len(bench.bus.sent) == said

    on_bench(script)


def test_heartbeats_of_drives_are_no_master(on_bench):
    async def script(bench: Any) -> None:
        bench.loop_task.cancel()
        listening = asyncio.ensure_future(refuse_other_master(bench.bus, LoopClock(), 127, 0.2))
        await LoopClock().sleep(0.1)
        bench.bus.deliver(0x703, b"\x05")
        await listening

    on_bench(script)
