"""Other masters on the bus, and two nodes of one id: what shows them, and what does not."""

import copy
from typing import Any

import pytest

from drivers.canbus.transport import CanFrame
from drivers.cia402.wire import Strangers
from drivers.cia402.wire.strangers import TwinWatch
from fidim_lab.errors import DeviceError

MASTERS = [
    (0x000, "NMT command"),
    (0x080, "SYNC"),
    (0x203, "command (RPDO) to node 3"),
    (0x503, "command (RPDO) to node 3"),
    (0x603, "SDO request to node 3"),
    (0x77F, "heartbeat of node 127, the host's"),
    (0x7E5, "LSS command"),
]


@pytest.mark.parametrize(("frame_id", "name"), MASTERS)
def test_frames_that_only_a_master_sends(frame_id: int, name: str) -> None:
    strangers = Strangers(127, (3,))
    strangers.hear(CanFrame(frame_id, b"", 0.0))
    assert strangers.says == f"1 {name}"
    strangers.hear(CanFrame(frame_id, b"", 0.0))
    assert strangers.says == f"2 {strangers.heard.most_common()[0][0]}"


@pytest.mark.parametrize("frame_id", [0x083, 0x183, 0x283, 0x383, 0x483, 0x583, 0x703, 0x100, 0x205, 0x605, 0x7E4])
def test_frames_of_drives_and_between_other_nodes_are_no_master(frame_id: int) -> None:
    strangers = Strangers(127, (3,))
    strangers.hear(CanFrame(frame_id, bytes(8), 0.0))
    assert strangers.says == ""


def test_a_stranger_is_counted_while_the_master_runs_and_our_own_frames_are_not(on_bench: Any) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        await bench.winch.move_to(1.2, 0.1, 0.5)
        await bench.cycles(50)
        assert bench.master.strangers == ""
        bench.bus.deliver(0x203, bytes(7))
        bench.bus.deliver(0x603, bytes(8))
        says = "another master is on this bus: 1 command (RPDO) to node 3, 1 SDO request to node 3"
        assert bench.master.strangers == says

    on_bench(script)


def test_a_second_node_of_one_id_never_gets_power(on_bench: Any, plain_drive: Any) -> None:
    async def script(bench: Any) -> None:
        bench.bus.drives.append(twin := plain_drive(3))
        twin.put(0x6064, 300)
        with pytest.raises(DeviceError, match="two nodes answer with id 3 "):
            await bench.winch.configure()
        assert 0x0F not in [word & 0xF for drive in bench.bus.drives for word in drive.controlwords]

    on_bench(script)


def test_a_second_node_that_comes_later_is_a_fault(on_bench: Any) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        bench.bus.drives.append(twin := copy.deepcopy(bench.drive))
        twin.put(0x6064, 300)
        await bench.cycles(8)
        assert "two nodes answer with id 3: a TPDO comes twice in a cycle" in bench.winch.latest().fault
        assert "two nodes answer with id 3" in bench.master.strangers

    on_bench(script)


def test_a_second_sync_is_no_second_node(on_bench: Any) -> None:
    async def script(bench: Any) -> None:
        await bench.enabled()
        await bench.winch.move_to(1.2, 0.1, 0.5)
        for _ in range(20):
            await bench.cycles(1)
            bench.bus.deliver(0x080, b"")
            for answer in bench.drive.receive(0x080, b"", bench.master.clock.now()):
                bench.bus.deliver(*answer)
        assert bench.winch.latest().fault == ""
        assert bench.master.strangers == "another master is on this bus: 20 SYNC"

    on_bench(script)


def test_doubled_and_late_frames_are_no_second_node() -> None:
    watch = TwinWatch()
    for cycle in range(200):
        watch.sampled(float(cycle), contradicted=cycle // 4 * 3)
    for number in range(100):
        watch.asked()
        watch.answered(bytes((number,)))
        watch.answered(bytes((number,)))
    assert watch.says == ""
    for number in range(3):
        watch.asked()
        watch.answered(bytes((number,)))
        watch.answered(bytes((number, 1)))
    assert watch.says == "3 SDO questions had two answers that differ"
