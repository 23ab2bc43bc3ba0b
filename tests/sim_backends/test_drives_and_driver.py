"""Two readings of the standard against each other: drivers.cia402 drives the simulated nodes, in process and live."""

import asyncio
from pathlib import Path

import can
import pytest

from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster, acknowledge_fault
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run
from sim_backends.served_bus import ServedBus

EDS = Path(__file__).parents[2] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
clock = LoopClock()


def make_winch(node, master):
    return Cia402Winch(
        WinchConfig(
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
        ),
        master,
    )


def make_drive(node, current=-1.5):
    shaft = DrumShaft()
    shaft.set_load(current)
    return SimulatedDrive(node, read_eds(EDS, node), shaft)


class Rig:
    """Drives on an in-process bus, the world's task and the master's running."""

    def __init__(self, nodes):
        self.bus = InProcessBus(clock.now)
        self.log = []
        self.bus.tap(lambda frame: self.log.append((frame.t, frame.id, frame.data)))
        self.master = CanopenMaster(self.bus, clock)
        self.drives = [make_drive(node) for node in nodes]
        self.winches = [make_winch(node, self.master) for node in nodes]
        for drive in self.drives:
            self.bus.attach(drive)

    async def world(self):
        while True:
            self.bus.advance(clock.now())
            await clock.sleep(0.005)

    async def __aenter__(self):
        self.tasks = [asyncio.create_task(self.master.run()), asyncio.create_task(self.world())]
        return self

    async def __aexit__(self, *_):
        for task in self.tasks:
            task.cancel()


async def bring_up(winch):
    await winch.configure()
    await winch.enable()


async def arrive(winch):
    while not winch.latest().target_reached:
        await clock.sleep(0.01)


async def experiment():
    async with Rig(range(1, 5)) as rig:
        await asyncio.gather(*(bring_up(winch) for winch in rig.winches))
        await asyncio.gather(*(winch.move_to(1.2, 0.2, 0.5) for winch in rig.winches))
        await asyncio.gather(*(arrive(winch) for winch in rig.winches))
        await clock.sleep(10.0)
        return rig.log, [winch.latest() for winch in rig.winches]


def test_four_winches_move_and_hold_and_twice_the_same():
    log, samples = run(experiment())
    for sample in samples:
        assert sample.state is DriveState.OPERATION_ENABLED
        assert sample.length == pytest.approx(1.2, abs=1e-5)
        assert sample.current == pytest.approx(1.5)
    assert len(log) > 10 * 250 * 9
    assert run(experiment())[0] == log


def test_the_drives_stop_by_themselves_when_the_master_dies():
    async def main():
        async with Rig([1]) as rig:
            await bring_up(rig.winches[0])
            await rig.winches[0].move_to(2.5, 0.2, 0.5)
            await clock.sleep(1.0)
            rig.tasks[0].cancel()
            await clock.sleep(0.5)
            assert rig.drives[0].state.name == "QUICK_STOP_ACTIVE"
            return rig.drives[0].od.read(0x606C, 0)

    assert run(main()) == bytes(4)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda drive: drive.faults.claim_identity(product=7), "1018"),
        (lambda drive: drive.faults.reject_mode(1), "6061"),
        (lambda drive: drive.od.fix(0x6075, 0, 9000), "6075"),
    ],
)
def test_the_driver_refuses_a_wrong_drive(damage, says):
    async def main():
        async with Rig([1]) as rig:
            damage(rig.drives[0])
            if says == "1018":  # the EDS allows any, a rig file names one
                with pytest.raises(DeviceError, match=says):
                    await make_picky(rig).configure()
            else:
                with pytest.raises(DeviceError, match=says):
                    await rig.winches[0].configure()

    run(main())


def make_picky(rig):
    winch = rig.winches[0]
    winch.config = winch.config.changed(product_code=8)
    return winch


def test_a_fault_is_seen_and_reset_by_hand_only():
    async def main():
        async with Rig([1]) as rig:
            winch = rig.winches[0]
            await bring_up(winch)
            rig.drives[0].faults.raise_fault(0x2310)
            await clock.sleep(0.1)
            assert winch.latest().state is DriveState.FAULT
            assert "2310" in winch.latest().fault
            with pytest.raises(DeviceError):
                await winch.enable()
            await acknowledge_fault(winch.link, clock, winch.config.device, "the tester")
            await winch.configure()
            await winch.enable()
            await clock.sleep(0.05)
            return winch.latest().state

    assert run(main()) is DriveState.OPERATION_ENABLED


def test_the_same_nodes_in_real_time_on_python_can():
    async def main():
        transport = PythonCanTransport("virtual", "drives-and-driver")
        with ServedBus(can.Bus("drives-and-driver", "virtual"), [make_drive(1)]):
            master = CanopenMaster(transport, clock, sync_rate=100.0)
            winch = make_winch(1, master)
            task = asyncio.create_task(master.run())
            try:
                await bring_up(winch)
                await winch.move_to(1.01, 0.2, 2.0)
                await asyncio.wait_for(arrive(winch), 5.0)
                return winch.latest()
            finally:
                task.cancel()
                transport.close()

    sample = asyncio.run(main())
    assert sample.length == pytest.approx(1.01, abs=1e-4)
    assert sample.state is DriveState.OPERATION_ENABLED
