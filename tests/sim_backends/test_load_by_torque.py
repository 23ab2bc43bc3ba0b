"""A drive that tells torque (6077) and no current (6078): what is mapped, and what the port makes of it."""

import asyncio
import math
from pathlib import Path

import pytest

from drivers.cia402.dictionary import Load, WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from fidim_lab.errors import SetupError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

EDS = Path(__file__).parents[2] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
clock = LoopClock()


def config(**change):
    usual = {
        "name": "winch 1",
        "node_id": 1,
        "counts_per_turn": 40_000,
        "drum_radius": 0.03,
        "rated_current": 5.0,
        "current_limit": 4.0,
        "max_speed": 0.3,
        "max_acceleration": 2.0,
        "length_limits": (0.3, 3.0),
        "home_length": 1.0,
        "load": Load.TORQUE,
        "rated_torque": 1.0,
        "torque_constant": 0.1,
    }
    return WinchConfig(**(usual | change))


async def current_of(winch_config, load):
    """What the port says, and what the second TPDO is mapped to, with so many A in the motor."""
    bus = InProcessBus(clock.now)
    shaft = DrumShaft()
    shaft.set_load(load)
    od = read_eds(EDS, 1)
    od.fix(0x6076, 0, 1000)
    drive = SimulatedDrive(1, od, shaft)
    bus.attach(drive)
    master = CanopenMaster(bus, clock)
    winch = Cia402Winch(winch_config, master)

    async def world():
        while True:
            bus.advance(clock.now())
            await clock.sleep(0.005)

    tasks = [asyncio.create_task(master.run()), asyncio.create_task(world())]
    try:
        await winch.configure()
        await winch.enable()
        await clock.sleep(0.1)
        return winch.latest().current, od.number(0x1A01, 2)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("direction", [1, -1])
def test_torque_is_turned_into_the_current_that_it_stands_for(direction):
    """The simulated motor's torque goes with its current: 1.5 A of 5 A are 30 % of 1 N m, which is 3 A at 0.1 N m/A."""
    told, mapped = run(current_of(config(direction=direction), -direction * 1.5))
    assert mapped == 0x60770010
    assert told == pytest.approx(3.0)


def test_current_as_ever():
    told, mapped = run(current_of(config(load=Load.CURRENT), -1.5))
    assert mapped == 0x60780010
    assert told == pytest.approx(1.5)


@pytest.mark.parametrize("lacking", ["rated_torque", "torque_constant"])
def test_a_torque_needs_its_rated_value_and_the_motors_constant(lacking):
    with pytest.raises(SetupError, match="reports torque as a fraction"):
        config(**{lacking: None})
    assert math.isfinite(config(**{lacking: None, "load": Load.CURRENT}).ampere_per_mille)
