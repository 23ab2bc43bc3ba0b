"""Winches in cyclic synchronous position mode, and a mode that a drive refuses, on simulated drives."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch, make_winch, pull_taut
from drivers.cia402.motion.cyclic import CyclicWinch
from drivers.cia402.profile import Mode
from drivers.cia402.profile.scale import wrap32
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, RefusedError, SetupError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

EDS = Path(__file__).parents[2] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
COUNTS = 40_000 / (2 * np.pi * 0.03)
"""a metre"""
clock = LoopClock()


def config(node=1, **change):
    usual = WinchConfig(
        name=f"winch {node}",
        node_id=node,
        counts_per_turn=40_000,
        drum_radius=0.03,
        rated_current=5.0,
        current_limit=4.0,
        max_speed=0.3,
        max_acceleration=2.0,
        length_limits=(0.3, 3.0),
        home_length=1.0,
        direction=1 if node % 2 else -1,
        mode=Mode.CYCLIC_POSITION,
    )
    return usual.changed(**change)


class Hall:
    """Drives, their winches, and every sample of all of them."""

    def __init__(self, *configs, sync_rate=250.0):
        self.bus = InProcessBus(clock.now)
        self.frames = []
        self.bus.tap(lambda frame: self.frames.append(frame))
        self.master = CanopenMaster(self.bus, clock, sync_rate=sync_rate)
        self.drives = []
        for one in configs:
            drive = SimulatedDrive(one.node_id, read_eds(EDS, one.node_id), DrumShaft(), position=float(one.home_count))
            self.drives.append(drive)
            self.bus.attach(drive)
        self.winches = [make_winch(one, self.master) for one in configs]
        self.samples = []

    def watch(self, _t):
        found = [winch.latest() for winch in self.winches]
        if all(found):
            self.samples.append([sample.length for sample in found])

    async def world(self):
        while True:
            self.bus.advance(clock.now())
            await clock.sleep(0.002)

    async def __aenter__(self):
        self.tasks = [asyncio.create_task(self.master.run(self.watch)), asyncio.create_task(self.world())]
        return self

    async def __aexit__(self, *_):
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)

    async def all(self, *commands):
        return await asyncio.gather(*commands)

    async def ready(self):
        await self.all(*(winch.configure() for winch in self.winches))
        await self.all(*(winch.enable() for winch in self.winches))
        self.samples.clear()

    async def go(self, lengths, speed=0.2, acceleration=0.5):
        """All together, in proportion to their ways."""
        ways = [abs(length - winch.latest().length) for length, winch in zip(lengths, self.winches, strict=True)]
        shares = [max(way / max(ways), 1e-6) for way in ways]
        await self.all(
            *(
                winch.move_to(length, speed * share, acceleration * share)
                for winch, length, share in zip(self.winches, lengths, shares, strict=True)
            )
        )

    async def arrive(self, seconds=20.0):
        end = clock.now() + seconds
        while not all(winch.latest().target_reached for winch in self.winches):
            assert clock.now() < end
            await clock.sleep(0.01)


def off_the_line(samples, start, goal):
    """How far the lengths left the straight line in length space, m."""
    way = np.array(goal) - start
    gone = np.array(samples) - start
    part = gone @ way / (way @ way)
    return np.abs(gone - np.outer(part, way)).max()


START, GOAL = np.ones(4), np.array([1.3, 0.8, 1.05, 1.0 + 1e-3])


def test_all_go_in_step_from_the_first_cycle_to_the_last():
    async def main():
        async with Hall(*(config(node) for node in range(1, 5))) as hall:
            await hall.ready()
            await hall.go(GOAL)
            await hall.arrive()
            return hall.samples, [winch.latest() for winch in hall.winches]

    samples, ends = run(main())
    assert [end.length for end in ends] == pytest.approx(GOAL, abs=1.0 / COUNTS)
    assert off_the_line(samples, START, GOAL) < 2.5 / COUNTS  # counts are whole numbers
    speeds = np.abs(np.diff(samples, axis=0)).max(axis=0) * 250.0
    assert speeds.max() == pytest.approx(0.2, rel=0.02)


class LateClock(LoopClock):
    """Of a busy computer: now and then it wakes up late, by almost a bus cycle."""

    def __init__(self, lateness):
        self._lateness = iter(lateness)

    async def sleep(self, seconds):
        await super().sleep(seconds + (next(self._lateness, 0.0) if seconds > 0.0 else 0.0))


def test_a_host_that_is_late_at_times_does_not_leave_the_drives_half_way():
    """A sample shows the target before it, but for what a SYNC may come early: a tenth of a cycle."""
    rng = np.random.default_rng(5)
    lateness = np.where(rng.random(5000) < 0.05, rng.uniform(1e-3, 3.9e-3, 5000), rng.exponential(1e-4, 5000))
    speed, syncs, off = 0.25, [], []  # 0.3 m/s is all that the drive may do

    async def main():
        hall = Hall(config())
        hall.master.clock = LateClock(lateness)
        asked = []

        def look(t):
            syncs.append(t)
            asked.append(winch.drive.target)
            values = winch.link.values
            if len(asked) > 1 and values is not None and values.t == t:
                off.append(abs(wrap32(values.position - asked[-2])) / COUNTS)

        (winch,) = hall.winches
        hall.watch = look
        async with hall:
            await hall.ready()
            await winch.move_to(1.6, speed, 2.0)
            await hall.arrive()

    run(main())
    intervals = np.diff(syncs)
    assert intervals.max() > 0.006
    assert intervals.min() > 0.9 * 0.004 - 1e-9
    assert len(off) > 400
    assert max(off) < 0.1 * speed * 0.004 + 2.0 / COUNTS  # 0.11 mm; half way would be 0.5


def test_in_profile_position_they_begin_one_after_the_other():
    """What cyclic mode is for: the same move, each drive by itself."""

    async def main():
        async with Hall(*(config(node, mode=Mode.PROFILE_POSITION) for node in range(1, 5))) as hall:
            await hall.ready()
            await hall.winches[0].move_to(1.3, 0.2, 0.5)
            await hall.all(*(w.move_to(g, 0.2, 0.5) for w, g in zip(hall.winches[1:], GOAL[1:], strict=True)))
            await hall.arrive()
            return hall.samples

    assert off_the_line(run(main()), START, GOAL) > 20.0 / COUNTS


def test_a_hold_in_the_middle_keeps_to_the_line():
    async def main():
        async with Hall(*(config(node) for node in range(1, 5))) as hall:
            await hall.ready()
            await hall.go(GOAL)
            await clock.sleep(1.0)
            await hall.all(*(winch.hold() for winch in hall.winches))
            stood = [winch.latest().length for winch in hall.winches]
            await clock.sleep(1.0)
            return hall.samples, stood, [winch.latest() for winch in hall.winches]

    samples, stood, ends = run(main())
    assert [end.length for end in ends] == stood
    assert 1.1 < stood[0] < 1.25
    assert off_the_line(samples, START, GOAL) < 2.5 / COUNTS
    assert all(end.state is DriveState.OPERATION_ENABLED for end in ends)


def test_nothing_moves_when_power_comes_wherever_the_encoder_stands():
    async def main():
        async with Hall(config(home_count=-1_234_567)) as hall:
            await hall.ready()
            await clock.sleep(1.0)
            return hall.samples

    assert np.ptp(run(main())) == 0.0


def test_through_the_wrap_of_the_encoder():
    top = 2**31 - 1 - round(1.95 * COUNTS)  # the limits lie within 32 bits, the way to them does not leave them

    async def main():
        async with Hall(config(home_count=top, length_limits=(0.9, 2.9))) as hall:
            await hall.ready()
            await hall.go([2.9])
            await hall.arrive()
            return hall.winches[0].latest().length, hall.drives[0]._axis.feedback.position()

    length, count = run(main())
    assert length == pytest.approx(2.9, abs=1.0 / COUNTS)
    assert count == wrap32(count) == top + round(1.9 * COUNTS)


def test_a_quick_stop_in_the_middle_is_not_undone():
    async def main():
        async with Hall(config()) as hall:
            (winch,) = hall.winches
            await hall.ready()
            await hall.go([2.0])
            await clock.sleep(1.0)
            winch.quick_stop()
            await clock.sleep(1.0)
            stood = winch.latest()
            await winch.enable()
            await clock.sleep(0.5)
            again = winch.latest()
            await hall.go([1.1])
            await hall.arrive()
            return stood, again, winch.latest()

    stood, again, end = run(main())
    assert stood.state is DriveState.QUICK_STOP_ACTIVE
    assert 1.0 < stood.length < 1.3
    assert again.length == stood.length
    assert end.length == pytest.approx(1.1, abs=1.0 / COUNTS)


def test_a_bus_fault_stops_all_where_they_are():
    """`quick_stop_all` carries the newest target: another one would be a jump in the same cycle."""

    async def main():
        async with Hall(config()) as hall:
            await hall.ready()
            await hall.go([2.0])
            await clock.sleep(1.0)
            hall.master.quick_stop_all()
            await clock.sleep(0.5)
            return hall.samples

    steps = np.abs(np.diff(run(main()), axis=0)).max()
    assert steps <= 0.2 / 250.0 + 1.5 / COUNTS


def test_a_host_that_is_late_makes_all_slow_and_none_early():
    async def main():
        async with Hall(*(config(node) for node in range(1, 5))) as hall:
            await hall.ready()
            await hall.go(GOAL)
            await clock.sleep(0.8)
            hall.tasks[0].cancel()
            await clock.sleep(0.05)  # the control loop hangs
            hall.tasks[0] = asyncio.create_task(hall.master.run(hall.watch))
            await hall.arrive()
            return hall.samples

    assert off_the_line(run(main()), START, GOAL) < 2.5 / COUNTS


def test_interpolation_period_and_target_are_configured():
    async def main():
        async with Hall(config(), sync_rate=125.0) as hall:
            await hall.winches[0].configure()
            od = hall.drives[0].od
            return [od.number(0x60C2, sub) for sub in (1, 2)], od.number(0x1601, 1), hall.winches[0].checks

    period, mapped, checks = run(main())
    assert period == [8, -3]
    assert mapped == 0x607A0020
    assert {"60C2:1", "60C2:2", "1601:1", "1401:2"} <= {check.object for check in checks}


def test_a_period_that_60c2_cannot_say_is_refused():
    async def main():
        async with Hall(config(), sync_rate=300.0) as hall:
            await hall.winches[0].configure()

    with pytest.raises(SetupError, match=r"a period of 0\.00333333 s cannot be set"):
        run(main())


@pytest.mark.parametrize("what", ["not supported", "not displayed"])
def test_a_drive_without_the_mode_is_refused(what):
    async def main():
        async with Hall(config()) as hall:
            if what == "not supported":
                hall.drives[0].od.fix(0x6502, 0, 1)
            else:
                hall.drives[0].faults.reject_mode(8)
            await hall.winches[0].configure()

    says = {"not supported": "cyclic position mode supported", "not displayed": r"cyclic position \(8\) wanted"}
    with pytest.raises(DeviceError, match=says[what]):
        run(main())


def test_limits_and_a_second_move_are_refused():
    async def main():
        async with Hall(config()) as hall:
            (winch,) = hall.winches
            await hall.ready()
            with pytest.raises(RefusedError, match="a length of 3"):
                await winch.move_to(3.1, 0.1, 0.5)
            await winch.move_to(1.5, 0.1, 0.5)
            with pytest.raises(DeviceError, match="still moving"):
                await winch.move_to(1.2, 0.1, 0.5)

    run(main())


def test_a_mode_that_the_drive_does_not_take_is_an_error_and_the_old_one_stays():
    async def main():
        async with Hall(config(mode=Mode.PROFILE_POSITION)) as hall:
            (winch,) = hall.winches
            hall.drives[0].faults.reject_mode(4)
            await hall.ready()
            with pytest.raises(DeviceError, match=r"profile torque \(4\) displayed \(6061\) expected"):
                await pull_taut(winch, 1.0, 0.1, 0.1)
            await winch.enable()
            await hall.go([1.1])
            await hall.arrive()
            return winch.latest().length

    assert run(main()) == pytest.approx(1.1, abs=1.0 / COUNTS)


def test_the_config_chooses():
    bus = InProcessBus(clock.now)
    master = CanopenMaster(bus, clock)
    assert type(make_winch(config(1), master)) is CyclicWinch
    assert type(make_winch(config(2, mode=Mode.PROFILE_POSITION), master)) is Cia402Winch
