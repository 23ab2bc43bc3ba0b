"""A second master for the simulated drives: the `canopen` package with its own CiA 402 node, nothing of our driver.

Our driver and our drives read the standard alike; somebody else's master shows where both are wrong together.
"""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402  # noqa: TID251  banned in the product: here it is the other opinion

from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.served_bus import ServedBus

EDS = Path(__file__).parents[2] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
NODE = 5
PATIENCE = 10.0
"""s: both ends are threads of one busy process"""


@dataclass
class Second:
    network: Any
    node: Any
    drive: SimulatedDrive
    served: ServedBus


@pytest.fixture
def second(request: pytest.FixtureRequest) -> Iterator[Second]:
    channel = request.node.name
    drive = SimulatedDrive(NODE, read_eds(EDS, NODE), DrumShaft())
    network = canopen.Network(can.Bus(channel, "virtual"))
    network.connect()
    node = BaseNode402(NODE, str(EDS))
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = PATIENCE
    node.TIMEOUT_SWITCH_STATE_SINGLE = node.TIMEOUT_SWITCH_STATE_FINAL = PATIENCE
    with ServedBus(can.Bus(channel, "virtual"), [drive]) as served:
        yield Second(network, node, drive, served)
        network.sync.stop()
        network.disconnect()
    assert served.failure is None


def until(fulfilled: Callable[[], bool], what: str) -> None:
    pause = threading.Event()
    for _ in range(int(PATIENCE / 0.01)):
        if fulfilled():
            return
        pause.wait(0.01)
    pytest.fail(f"never: {what}")


def test_objects_of_all_types_long_ones_and_refusals(second):
    sdo = second.node.sdo
    assert sdo[0x1000].raw & 0xFFFF == 402
    assert len(sdo[0x1008].raw) > 4, "a text, in segments"
    sdo[0x607D][1].raw = -123_456
    assert sdo[0x607D][1].raw == -123_456
    sdo[0x605A].raw = 6
    assert sdo[0x605A].raw == 6
    refusals = {(0x1018, 1): 0x06010002, (0x6041, 0): 0x06010002, (0x5FFF, 0): 0x06020000, (0x1018, 9): 0x06090011}
    for (index, sub), code in refusals.items():
        with pytest.raises(canopen.SdoAbortedError) as refused:
            sdo.download(index, sub, b"\1\0\0\0")
        assert refused.value.code == code, hex(index)


def test_network_management_heartbeat_and_emergencies(second):
    node = second.node
    node.sdo[0x1017].raw = 20
    for state, says in {"OPERATIONAL": 5, "STOPPED": 4, "PRE-OPERATIONAL": 127}.items():
        node.nmt.state = state
        heard = [node.nmt.wait_for_heartbeat(PATIENCE) for _ in range(2)]  # the first may have been under way
        assert heard[-1] == node.nmt.state == state, says
    with second.served.paused():
        second.drive.faults.raise_fault(0x2310)
    until(lambda: bool(node.emcy.active), "an emergency")
    assert [(error.code, error.register & 0x03) for error in node.emcy.active] == [(0x2310, 0x03)]


def map_its_way(node: Any) -> None:
    """Statusword, mode and position on every SYNC, the controlword at once: as this package writes PDOs."""
    node.pdo.read()
    for pdo, names in ((node.tpdo[1], (0x6041, 0x6061, 0x6064)), (node.rpdo[1], (0x6040,))):
        pdo.clear()
        for name in names:
            pdo.add_variable(name)
        pdo.enabled = True
    node.tpdo[1].trans_type, node.rpdo[1].trans_type = 1, 255
    node.pdo.save()


def test_its_own_profile_node_enables_moves_and_stops(second):
    node = second.node
    node.nmt.state = "PRE-OPERATIONAL"
    map_its_way(node)
    node.setup_402_state_machine()  # reads all PDOs back, and finds controlword and statusword in them
    assert [entry.index for entry in node.tpdo[1].map] == [0x6041, 0x6061, 0x6064]
    second.network.sync.start(0.01)
    node.nmt.state = "OPERATIONAL"
    until(lambda: node.tpdo[1].is_received, "a TPDO on SYNC")
    assert node.is_op_mode_supported("PROFILED POSITION")
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION"
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
        assert node.state == state
    before = node.sdo[0x6064].raw
    for index, value in {0x6081: 50_000, 0x6083: 500_000, 0x6084: 500_000, 0x607A: before + 4_000}.items():
        node.sdo[index].raw = value
    node.controlword = 0x1F
    until(lambda: bool(node.statusword & 0x1000), "the set-point acknowledged")
    node.controlword = 0x0F
    until(lambda: node.sdo[0x6064].raw == before + 4_000 and bool(node.statusword & 0x400), "the target reached")
    node.state = "SWITCH ON DISABLED"
    assert node.state == "SWITCH ON DISABLED"
