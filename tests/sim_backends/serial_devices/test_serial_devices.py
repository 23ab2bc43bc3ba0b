"""Simulated serial devices, met by the drivers through pyserial and pseudo terminals, at the pace of their lines."""

import asyncio
import contextlib

import pytest

from drivers.clock import LoopClock
from drivers.ports import ReleaseState
from drivers.serial_line.gauge import LineGauge
from drivers.serial_line.release import SerialRelease
from fidim_lab.data.rigs.rig_serial import GaugeEntry, Loading, ReleaseEntry
from fidim_lab.errors import DeviceError, RefusedError, SetupError
from sim_backends.serial_devices.gauge import SimulatedGauge
from sim_backends.serial_devices.pty_line import PtyLine
from sim_backends.serial_devices.release import ReleaseTalk, SimulatedRelease

BAUD = 115200
CLOCK = LoopClock()


class Coil:
    """A magnet that remembers how often it was switched."""

    def __init__(self):
        self.energised = False
        self.switched = []

    def switch(self, on):
        self.energised = on
        self.switched.append(on)


@contextlib.asynccontextmanager
async def living(*devices):
    tasks = [asyncio.ensure_future(device.run()) for device in devices]
    try:
        yield
    finally:
        for task in reversed(tasks):
            task.cancel()
            (ended,) = await asyncio.gather(task, return_exceptions=True)
            assert isinstance(ended, asyncio.CancelledError), ended


async def until(condition, seconds=10.0):
    async with asyncio.timeout(seconds):
        while not condition():
            await CLOCK.sleep(0.01)


def release_pair(folder, *, period=0.05, timeout=0.8, watchdog=0.8):
    words = {"hold": b"ON\r", "release": b"OFF\r", "ask": b"?\r", "holds": "COIL 1", "released": "COIL 0"}
    coil, link = Coil(), folder / "release"
    simulated = SimulatedRelease(link, BAUD, CLOCK, coil, ReleaseTalk(**words), watchdog)
    entry = ReleaseEntry(
        port=str(link),
        baud=BAUD,
        loading=Loading.BY_HAND,
        period=period,
        timeout=timeout,
        watchdog=watchdog,
        **words,
    )
    return simulated, SerialRelease(entry, CLOCK), coil


def gauge_pair(folder, *, rate=50.0, ask=b"", baud=BAUD, line="2.5 kg;1 kg", **more):
    link = folder / "cells"
    simulated = SimulatedGauge(link, baud, CLOCK, rate, lambda: line, ask)
    entry = cells(str(link), "{1} kg;{2} kg", baud=baud, rate=rate, ask=ask, scale=9.80665, **more)
    return simulated, LineGauge(entry, CLOCK)


def cells(port, pattern, cables=2, **more):
    columns = {str(cable): f"f{cable}" for cable in range(1, cables + 1)}
    usual = {"baud": BAUD, "scale": 1.0, "offset": 0.0, "rate": 50.0, "age": 0.5, "uncertainty": 0.0}
    return GaugeEntry("load cells", port, pattern=pattern, columns=columns, **{**usual, **more})


def test_commands_are_confirmed_by_the_state_read_back(tmp_path):
    async def run():
        simulated, driver, coil = release_pair(tmp_path)
        async with living(simulated, driver):
            await until(lambda: driver.state is ReleaseState.RELEASED)
            await driver.hold()
            assert coil.energised
            assert driver.state is ReleaseState.HOLDS
            await driver.release()
            assert driver.state is ReleaseState.RELEASED
            assert coil.switched == [True, False]
            assert driver.fault == ""

    asyncio.run(run())


def test_a_command_without_effect_is_an_error_with_what_was_read_back(tmp_path):
    async def run():
        simulated, driver, _ = release_pair(tmp_path)
        simulated.deaf = True
        async with living(simulated, driver):
            await until(lambda: driver.state is ReleaseState.RELEASED)
            with pytest.raises(DeviceError, match=r"“holds” was not confirmed within 0\.8 s: it says “released”"):
                await driver.hold()

    asyncio.run(run())


def test_no_device_is_an_error_that_names_the_port(tmp_path):
    async def run():
        _, driver, _ = release_pair(tmp_path)
        async with living(driver):
            await CLOCK.sleep(0.1)
            with pytest.raises(DeviceError, match=r"release: is not connected: .*release: .*No such file"):
                await driver.hold()
            assert driver.state is ReleaseState.UNKNOWN

    asyncio.run(run())


def test_unplugged_while_it_holds_latches_and_comes_back_without_taking_hold(tmp_path):
    async def run():
        simulated, driver, coil = release_pair(tmp_path)
        async with living(simulated, driver):
            await until(lambda: driver.state is ReleaseState.RELEASED)
            await driver.hold()
            simulated.line.unplug()
            await until(lambda: bool(driver.fault))
            assert "while it held the platform, it was unplugged" in driver.fault
            await until(lambda: not coil.energised)  # its own watchdog
            simulated.line.plug()
            await until(lambda: driver.state is ReleaseState.RELEASED)
            with pytest.raises(DeviceError, match="not acknowledged yet"):
                await driver.hold()
            assert not coil.energised
            await driver.release()  # the safe command is always allowed
            with pytest.raises(RefusedError, match="by name"):
                driver.acknowledge(" ")
            driver.acknowledge("A. Name")
            await driver.hold()
            assert coil.energised

    asyncio.run(run())


def test_letting_go_by_itself_latches(tmp_path):
    async def run():
        simulated, driver, coil = release_pair(tmp_path)
        async with living(simulated, driver):
            await until(lambda: driver.state is ReleaseState.RELEASED)
            await driver.hold()
            coil.switch(False)
            await until(lambda: "let go by itself" in driver.fault)

    asyncio.run(run())


def test_unplugged_while_it_holds_nothing_is_no_fault(tmp_path):
    async def run():
        simulated, driver, _ = release_pair(tmp_path)
        async with living(simulated, driver):
            await until(lambda: driver.state is ReleaseState.RELEASED)
            simulated.line.unplug()
            await until(lambda: driver.state is ReleaseState.UNKNOWN)
            simulated.line.plug()
            await until(lambda: driver.state is ReleaseState.RELEASED)
            assert driver.fault == ""
            await driver.hold()

    asyncio.run(run())


def test_it_lets_go_when_the_host_ends_and_when_it_hangs(tmp_path):
    async def run():
        simulated, driver, coil = release_pair(tmp_path)
        async with living(simulated):
            async with living(driver):
                await until(lambda: driver.state is ReleaseState.RELEASED)
                await driver.hold()
            await until(lambda: coil.switched == [True, False])
            again = release_pair(tmp_path, period=60.0, timeout=4.0)[1]  # a host that asks far too seldom
            async with living(again):
                await until(lambda: again.state is ReleaseState.RELEASED)
                await again.hold()
                await until(lambda: coil.switched == [True, False, True, False])
                await until(lambda: "has not reported its state" in again.fault)

    asyncio.run(run())


@pytest.mark.parametrize("ask", [b"", b"READ?\n"])
def test_lines_become_values_in_si(tmp_path, ask):
    async def run():
        simulated, driver = gauge_pair(tmp_path, ask=ask, offset=0.5)
        async with living(simulated, driver):
            await until(lambda: driver.latest() is not None)
            assert driver.latest().values == pytest.approx((2.5 * 9.80665 + 0.5, 9.80665 + 0.5))
            assert 0.0 <= CLOCK.now() - driver.latest().t < 1.0
            assert driver.columns == ("f1", "f2")

    asyncio.run(run())


def test_a_load_cell_beyond_its_range_or_unplugged_grows_old_and_comes_back(tmp_path):
    async def run():
        simulated, driver = gauge_pair(tmp_path)
        async with living(simulated, driver):
            await until(lambda: driver.latest() is not None)
            simulated.garbled = True
            await until(lambda: driver.counters.malformed >= 3)
            old = driver.latest()
            simulated.line.unplug()
            await until(lambda: driver.problem)
            simulated.garbled = False
            assert driver.latest() is old
            simulated.line.plug()
            await until(lambda: driver.latest() is not old)
            assert driver.problem == ""

    asyncio.run(run())


def test_a_slow_line_takes_its_time(tmp_path):
    """At 2400 baud 480 bytes a second go over the line; a pseudo terminal by itself would take them all at once."""

    async def run():
        line = PtyLine(tmp_path / "slow", 2400, CLOCK, lambda data: None)
        line.plug()
        begin = CLOCK.now()
        await line.send(b"x" * 96)
        assert 0.4 <= CLOCK.now() - begin < 2.0
        line.unplug()

    asyncio.run(run())


def test_simulated_lines_take_nobodys_place(tmp_path):
    async def run():
        (tmp_path / "file").write_text("mine")
        with pytest.raises(SetupError, match="something else of this name"):
            PtyLine(tmp_path / "file", BAUD, CLOCK, lambda data: None).plug()
        (tmp_path / "left").symlink_to("/dev/pts/99999")  # by a simulator that was killed
        line = PtyLine(tmp_path / "left", BAUD, CLOCK, lambda data: None)
        line.plug()
        assert (tmp_path / "left").exists()
        line.unplug()
        assert not (tmp_path / "left").is_symlink()

    asyncio.run(run())


def test_two_programs_cannot_have_one_line(tmp_path):
    async def run():
        simulated, first = gauge_pair(tmp_path)
        second = gauge_pair(tmp_path)[1]
        async with living(simulated, first):
            await until(lambda: first.latest() is not None)
            async with living(second):
                await until(lambda: "exclusively lock" in second.problem)
                assert second.latest() is None

    asyncio.run(run())


def test_a_url_that_pyserial_does_not_know(tmp_path):
    async def run():
        with pytest.raises(SetupError, match="load cells nonsense://x: port 'nonsense://x' cannot be"):
            await LineGauge(cells("nonsense://x", "{1}", 1), CLOCK).run()
        with pytest.raises(SetupError, match=r"must name \{1\}, \{2\}"):
            LineGauge(cells("x", "{1}"), CLOCK)

    asyncio.run(run())
