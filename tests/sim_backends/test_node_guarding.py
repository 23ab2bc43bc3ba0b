"""Node guarding and life guarding (100C, 100D), for drives that watch no heartbeat: both ends, and others' masters."""

import asyncio
import re
import threading
from pathlib import Path

import can
import canopen
import pytest

from drivers.canbus.transport import CanFrame
from drivers.cia402.bring_up.takeover import refuse_other_master
from drivers.cia402.dictionary import GENERIC_EDS, DriveFamily, Met, WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.errors import BusError
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run
from sim_backends.served_bus import ServedBus

NODE = 3
GUARDED = """
[100C]
ParameterName=Guard time
ObjectType=0x7
DataType=0x0006
AccessType=rw
DefaultValue=0
PDOMapping=0

[100D]
ParameterName=Life time factor
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=0
PDOMapping=0
"""


@pytest.fixture
def eds(tmp_path: Path) -> Path:
    """A drive that watches no heartbeat."""
    text = GENERIC_EDS.read_text(encoding="utf-8")
    path = tmp_path / "guarded.eds"
    path.write_text(re.sub(r"\[1016\][^\[]*(\[1016sub\w+\][^\[]*)*", "", text) + GUARDED, encoding="utf-8")
    return path


class Guarded:
    """One drive by itself, a clock turned by hand."""

    def __init__(self, eds: Path) -> None:
        self.drive = SimulatedDrive(NODE, read_eds(eds, NODE), DrumShaft())
        self.t = 0.0
        self.drive.start(0.0)

    def ask(self, after: float = 0.05) -> list[str]:
        self.t += after
        asked = [*self.drive.advance(self.t), *self.drive.receive(CanFrame(0x700 + NODE, b"", self.t, remote=True))]
        return [f"{cob_id:03X}#{data.hex()}" for cob_id, data in asked]


def test_a_guarded_node_answers_with_its_state_and_a_bit_that_changes(eds):
    node = Guarded(eds)
    assert [node.ask(), node.ask(), node.ask()] == [["703#7f"], ["703#ff"], ["703#7f"]]
    node.drive.receive(CanFrame(0x000, bytes((1, NODE)), node.t))
    assert node.ask() == ["703#85"]
    node.drive.receive(CanFrame(0x000, bytes((0x82, NODE)), node.t))
    assert node.ask() == ["703#7f"], "it begins anew after a reset"


def test_a_node_that_sends_heartbeats_is_not_guarded(eds):
    node = Guarded(eds)
    node.drive.od.put(0x1017, 0, 100)
    assert node.ask() == []


def test_no_other_remote_frame_is_taken_for_a_command(eds):
    node = Guarded(eds)
    node.drive.receive(CanFrame(0x000, bytes((1, NODE)), 0.0))
    node.drive.advance(0.01)
    assert [node.drive.receive(CanFrame(i, b"", 0.01, remote=True)) for i in (0x080, 0x603, 0x203)] == [[], [], []]


class Bench:
    """A winch whose drive is guarded, and its master."""

    def __init__(self, eds: Path, family: DriveFamily | None = None) -> None:
        self.clock = LoopClock()
        self.bus = InProcessBus(self.clock.now)
        self.log: list[CanFrame] = []
        self.bus.tap(self.log.append)
        self.drive = SimulatedDrive(NODE, read_eds(eds, NODE), DrumShaft())
        self.bus.attach(self.drive)
        self.master = CanopenMaster(self.bus, self.clock)
        config = WinchConfig(
            name="winch 3",
            node_id=NODE,
            counts_per_turn=40_000.0,
            drum_radius=0.03,
            rated_current=5.0,
            current_limit=4.0,
            max_speed=0.3,
            max_acceleration=2.0,
            length_limits=(0.3, 3.0),
            home_length=1.0,
            eds=eds,
            family=family or DriveFamily(),
        )
        self.winch = Cia402Winch(config, self.master)

    async def __aenter__(self) -> "Bench":
        self.tasks = [asyncio.ensure_future(work) for work in (self.master.run(), self._world())]
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)

    async def _world(self) -> None:
        while True:
            self.bus.advance(self.clock.now())
            await self.clock.sleep(0.005)

    async def moving(self) -> None:
        await self.winch.configure()
        await self.winch.enable()
        await self.winch.move_to(2.0, 0.1, 0.5)
        await self.clock.sleep(0.5)
        assert self.look().velocity == pytest.approx(0.1, rel=0.02)

    def look(self):
        sample = self.winch.latest()
        assert sample is not None
        return sample


def test_a_guarded_drive_is_configured_without_a_trial(eds):
    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.winch.configure()
            grades = {line.requirement.key: line for line in bench.winch.grades}
            lost, heard = grades["reaction to a lost host"], grades["heartbeat of the drive"]
            assert (lost.met, lost.found) == (Met.CONFIGURED, "100C:0 + 100D:0 + 6007:0")
            assert (heard.met, heard.found) == (Met.CONFIGURED, "100C:0")
            od = bench.drive.od
            assert (od.number(0x100C), od.number(0x100D), od.number(0x1017)) == (83, 3, 0), (
                "of a host_timeout of 0.25 s"
            )
            asked = [frame for frame in bench.log if frame.remote]
            assert {frame.id for frame in asked} == {0x703}

    run(script())


def test_a_family_that_lacks_1016_is_guarded_whatever_its_file_says(eds, tmp_path):
    both = tmp_path / "both.eds"
    both.write_text(GENERIC_EDS.read_text(encoding="utf-8") + GUARDED, encoding="utf-8")

    async def script(family: DriveFamily) -> int:
        async with Bench(both, family) as bench:
            await bench.winch.configure()
            return bench.drive.od.number(0x100D)

    assert run(script(DriveFamily())) == 0, "heartbeats first"
    assert run(script(DriveFamily(absent={"1016:1": "the manual"}))) == 3


@pytest.mark.parametrize("withheld", ["the whole host", "guarding alone"])
def test_a_guarded_drive_stops_by_itself_when_its_host_is_gone(eds, withheld):
    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.moving()
            if withheld == "the whole host":
                bench.master.silent = True
            else:
                bench.master.without_heartbeat = True
            await bench.clock.sleep(0.4)  # host_timeout, and the ramp of 0.05 s
            stopped = await bench.winch.ask_length()
            assert bench.drive.state.name == "QUICK_STOP_ACTIVE"
            await bench.clock.sleep(1.0)
            assert await bench.winch.ask_length() == stopped

    run(script())


def test_it_goes_on_for_as_long_as_it_is_asked(eds):
    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.moving()
            await bench.clock.sleep(5.0)
            assert bench.look().fault == ""
            assert bench.look().heartbeat_age < 0.06

    run(script())


def test_a_drive_whose_answers_to_guarding_do_not_come_is_told(eds):
    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.moving()
            bench.bus.rules.append(FrameRule(frozenset({0x700 + NODE}), drop=True))
            await bench.clock.sleep(0.4)
            assert "no answer to node guarding for 0." in bench.look().fault

    run(script())


def test_a_drive_that_restarts_unheard_is_told_by_its_state(eds):
    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.moving()
            bench.drive.receive(CanFrame(0x000, bytes((0x81, NODE)), bench.clock.now()))
            await bench.clock.sleep(0.1)
            assert "PRE-OPERATIONAL" in bench.look().fault
            assert bench.look().state is not DriveState.OPERATION_ENABLED

    run(script())


def test_another_master_that_guards_our_drive_is_heard(eds):
    """It keeps the drive from missing us."""

    async def script() -> None:
        async with Bench(eds) as bench:
            await bench.winch.configure()
            bench.bus.inject(0x700 + NODE, b"", remote=True)
            assert "1 remote frame (node guarding) to node 3" in bench.master.strangers
        clock = LoopClock()
        bus = InProcessBus(clock.now)
        asking = asyncio.get_running_loop().call_later(0.1, lambda: bus.inject(0x703, b"", remote=True))
        with pytest.raises(BusError, match=r"another master.*remote frames \(node guarding\) to node 3|node guarding"):
            await refuse_other_master(bus, clock, 127, 0.3, [NODE])
        asking.cancel()

    run(script())


def test_the_master_of_pypis_canopen_guards_our_drive(eds):
    """Its remote frames, over python-can, to the drive that we simulate."""
    states: list[int] = []
    heard = threading.Event()

    def hear(_can_id: int, data: bytearray, _stamp: float) -> None:
        states.append(data[0])
        if len(states) >= 5:  # the boot-up, and four answers
            heard.set()

    drive = SimulatedDrive(NODE, read_eds(eds, NODE), DrumShaft())
    network = canopen.Network(can.Bus("guarding", "virtual"))
    network.connect()
    try:
        network.subscribe(0x700 + NODE, hear)
        with ServedBus(can.Bus("guarding", "virtual"), [drive]):
            node = network.add_node(canopen.RemoteNode(NODE, canopen.ObjectDictionary()))
            node.nmt.start_node_guarding(0.01)
            assert heard.wait(20.0)
            node.nmt.stop_node_guarding()
    finally:
        network.disconnect()
    assert states[:5] == [0x00, 0x7F, 0xFF, 0x7F, 0xFF]
