"""Safe torque off and load as a drive tells them, and a brake by hand: our drivers on simulated drives."""

import asyncio

import pytest

from drivers.cia402.bring_up import Standing, inspect
from drivers.cia402.dictionary import GENERIC_EDS, Load, WinchConfig
from drivers.cia402.motion import Cia402Winch, pull_taut
from drivers.cia402.watch import CanopenMaster, set_brake
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.data.rigs.rig_winch_tables import Signal
from fidim_lab.errors import DeviceError, RefusedError
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

CLOCK = LoopClock()
CONFIG = WinchConfig(
    name="winch",
    node_id=1,
    counts_per_turn=40_000,
    drum_radius=0.03,
    rated_current=5.0,
    current_limit=4.0,
    max_speed=0.3,
    max_acceleration=2.0,
    length_limits=(0.3, 3.0),
    home_length=1.0,
    sto=Signal(bit=3),
    brake_output=Signal(bit=0),
)


class Slack(DrumShaft):
    """A cable that hangs slack for some counts, and pulls like a spring after that."""

    counts = 10_000

    @property
    def load_current(self):
        stretched = -self.motion(CLOCK.now()).position - self.counts
        return -1e-3 * max(stretched, 0.0)


def on_a_bus(work, config=CONFIG, shaft=DrumShaft, rules=()):
    """Carry out `work(winch, drive)` with the control loop running."""

    async def main():
        bus = InProcessBus(CLOCK.now)
        bus.rules.extend(rules)
        master = CanopenMaster(bus, CLOCK, sync_rate=100.0)
        drive = SimulatedDrive(1, read_eds(GENERIC_EDS, 1), shaft())
        bus.attach(drive)
        winch = Cia402Winch(config, master)

        async def live():
            while True:
                bus.advance(CLOCK.now())
                await CLOCK.sleep(0.005)

        tasks = [asyncio.ensure_future(one) for one in (master.run(), live(), winch.watch_health())]
        try:
            return await work(winch, drive)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    return run(main())


def test_a_bit_at_its_level():
    low = Signal(bit=2, active=0)
    assert low.is_active(0b011)
    assert not low.is_active(0b100)
    assert (low.put(0b111, True), low.put(0b001, False), Signal(bit=0).put(0b10, True)) == (0b011, 0b101, 0b11)


def test_no_drive_is_enabled_with_safe_torque_off_and_that_is_said():
    async def work(winch, drive):
        await winch.configure()
        drive.faults.safe_torque_off(True)
        with pytest.raises(DeviceError, match=r"safe torque off \(STO\) is active"):
            await winch.enable()
        drive.faults.safe_torque_off(False)
        await winch.enable()
        return winch.latest().state

    assert on_a_bus(work) is DriveState.OPERATION_ENABLED


@pytest.mark.parametrize(("times", "says"), [(5, ""), (10_000, "its samples (TPDO) have been exactly the same for")])
def test_a_load_that_flickers_between_samples_is_no_frozen_one(times, says):
    """After a second in which nothing changes, the load that is asked by SDO is another for so many times."""
    told = []

    def flickers(data):
        if data[1:4] != b"\x78\x60\x00":
            return data
        told.append(data)
        return data[:4] + bytes((data[4] ^ (10 <= len(told) < 10 + times),)) + data[5:]

    async def work(winch, _drive):
        await winch.configure()
        await winch.enable()
        await CLOCK.sleep(4.0)
        return winch.latest()

    sample = on_a_bus(work, rules=[FrameRule(frozenset({0x581}), change=flickers)])
    assert says in sample.fault
    assert sample.blind == bool(says)
    assert bool(sample.fault) == bool(says)


def test_safe_torque_off_in_operation_is_told_as_the_cause():
    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        await CLOCK.sleep(1.0)
        before = winch.latest().fault
        drive.faults.safe_torque_off(True)
        await CLOCK.sleep(1.1)
        return before, winch.latest()

    before, sample = on_a_bus(work)
    assert before == ""
    assert "safe torque off (STO) is active" in sample.fault
    assert sample.state is DriveState.SWITCH_ON_DISABLED


def test_the_doctor_tells_it():
    async def work(winch, drive):
        drive.faults.safe_torque_off(True)
        found = await inspect(winch.link, winch.config, 127)
        return next(item for item in found if item.object == "60FD:0")

    item = on_a_bus(work)
    assert (item.found, item.standing) == ("active", Standing.WRONG)


def test_a_brake_is_released_and_applied_without_power_alone():
    async def work(winch, drive):
        brake, device = CONFIG.brake_output, CONFIG.device
        assert drive.od.number(0x60FE, 2) == 0  # nobody has commanded it yet
        await set_brake(winch.link, brake, device, applied=False)
        assert drive.od.number(0x60FE, 1) == 0
        assert drive.od.number(0x60FE, 2) == 1
        await set_brake(winch.link, brake, device, applied=True)
        assert drive.od.number(0x60FE, 1) == 1
        await winch.configure()
        await winch.enable()
        with pytest.raises(DeviceError, match="its brake is its own matter"):
            await set_brake(winch.link, brake, device, applied=False)

    on_a_bus(work)


def test_slack_is_taken_up_by_torque_until_the_cable_is_taut():
    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        wound = await pull_taut(winch, 0.5, 0.1, 0.5)
        await CLOCK.sleep(0.2)
        return wound, winch.latest(), drive.od.number(0x607F)

    wound, sample, limit = on_a_bus(work, shaft=Slack)
    per_metre = CONFIG.scale.counts_per_metre
    assert wound == pytest.approx(10_500 / per_metre, abs=3e-3)  # and the way of its stop
    assert abs(sample.velocity) < 1e-3
    assert sample.state is DriveState.OPERATION_ENABLED
    assert limit == CONFIG.drive_speed(CONFIG.max_speed)


def test_a_cable_that_is_taut_already_is_left_as_it_is():
    """By less torque than its load it would be paid out."""

    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        await CLOCK.sleep(0.1)
        asked = drive.od.number(0x6071)
        return await pull_taut(winch, 0.5, 0.1, 0.5), winch.latest(), asked, drive.od.number(0x6071)

    def loaded():
        shaft = DrumShaft()
        shaft.set_load(-1.0)
        return shaft

    wound, sample, before, after = on_a_bus(work, shaft=loaded)
    assert (wound, after) == (0.0, before)
    assert sample.state is DriveState.OPERATION_ENABLED


def test_a_cable_that_is_paid_out_meanwhile_is_stopped():
    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        pulling = asyncio.ensure_future(pull_taut(winch, 0.5, 0.01, 0.5))
        await CLOCK.sleep(0.2)
        drive.faults.jump_encoder(round(0.01 * CONFIG.scale.counts_per_metre))
        with pytest.raises(DeviceError, match="its cable is paid out"):
            await pulling
        await CLOCK.sleep(0.3)
        return winch.latest()

    sample = on_a_bus(work, shaft=Slack)
    assert sample.velocity == 0.0
    assert sample.state is DriveState.QUICK_STOP_ACTIVE


def test_a_drive_that_tells_torque_is_told_torque():
    """6071 is a part of the rated torque there: 0.5 A are 0.1 N m, 50 per mille of 2 N m."""
    by_torque = CONFIG.changed(load=Load.TORQUE, rated_torque=2.0, torque_constant=0.2)
    assert (CONFIG.torque_digits(0.5), by_torque.torque_digits(0.5)) == (100, 50)
    assert CONFIG.changed(current_offset=0.1).torque_digits(0.5) == 80, "0.1 A are its ammeter's"


class Endless(Slack):
    counts = 10_000_000


def test_a_cable_that_does_not_become_taut():
    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        with pytest.raises(DeviceError, match="the cable is not taut after"):
            await pull_taut(winch, 0.5, 0.1, 0.05)
        await CLOCK.sleep(0.3)
        return winch.latest()

    sample = on_a_bus(work, shaft=Endless)
    assert sample.velocity == 0.0
    assert 0.95 - 0.01 < sample.length < 0.95


@pytest.mark.parametrize(("current", "speed"), [(5.0, 0.1), (0.5, 0.5), (0.0, 0.1)])
def test_pulls_that_are_refused(current, speed):
    async def work(winch, drive):
        await winch.configure()
        await winch.enable()
        with pytest.raises(RefusedError, match="refuses to pull"):
            await pull_taut(winch, current, speed, 0.1)

    on_a_bus(work)


def test_a_drive_without_such_an_output():
    async def work(winch, drive):
        with pytest.raises(DeviceError, match="no brake that can be released by hand"):
            await set_brake(winch.link, winch.config.brake_output, "winch", applied=False)

    on_a_bus(work, CONFIG.changed(brake_output=None))
