"""Lines that pull plugs of simulated devices and put them back: what is said, and what may not be."""

import asyncio

import can
import pytest

from fidim_lab.app.compose.simulators import SimulatedDevices
from fidim_lab.errors import SetupError
from sim_backends.served_bus import ServedBus


class Quiet:
    """A motion capture that says what was done with it."""

    def __init__(self):
        self.done = []

    async def start(self):
        self.done.append("start")

    async def close(self):
        self.done.append("close")


@pytest.fixture
def devices():

    bus = can.Bus(interface="virtual", channel="fidim-test-plugs")
    served = ServedBus(bus, ())
    yield SimulatedDevices(None, None, bus, served, (), Quiet())
    served.close()


def test_a_plug_is_pulled_once_and_put_back_once(devices):
    async def main():
        said = [
            await devices.pull(line) for line in ("mocap", "mocap again", "mocap", "bus", "mocap again", "bus again")
        ]
        assert said[:2] == ["pulled: mocap", "put back: mocap"]
        assert devices.motion_capture.done == ["close", "start", "close", "start"]
        assert not devices.out

    asyncio.run(main())


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["mocap again"], "mocap is not pulled"),
        (["bus", "bus"], "bus is pulled already"),
        (["fault 1 again"], "no such plug"),
        (["drive 9"], "no such plug"),
        (["again"], "no such plug"),
        ([""], "no such plug"),
    ],
)
def test_what_is_no_plug(devices, lines, says):
    async def main():
        for line in lines[:-1]:
            await devices.pull(line)
        with pytest.raises(SetupError, match=says):
            await devices.pull(lines[-1])

    asyncio.run(main())
