"""Somebody else on the bus: refused before there is power, a quick stop afterwards, whatever it sends."""

import asyncio
import struct

import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.axis.machine import State
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds

READ_STATUS = struct.pack("<BHB4x", 0x40, 0x6041, 0)
COMMAND = struct.pack("<Hbi", 0x0F, 1, 1000)
FOREIGN = {
    "SYNC": (0x080, b""),
    "NMT commands": (0x000, b"\x01\x00"),
    "SDO requests to node 2": (0x602, READ_STATUS),
    "commands .RPDO. to node 2": (0x202, COMMAND),
    "commands .RPDO. to node 1": (0x501, bytes(4)),
    "heartbeats of node 127": (0x77F, b"\x05"),
}


@pytest.mark.parametrize("says", FOREIGN)
@pytest.mark.sampled(1)
def test_another_master_in_a_run_is_a_quick_stop(rehearsal, says):
    frame = FOREIGN[says]
    rehearsal.at("Settle", lambda stage: stage.bus.inject(*frame), after=0.1)
    ended = rehearsal.run()
    report = ended.check()
    assert ended.trip is not None
    assert ended.trip.guard == "other master"
    assert ended.trip.t - ended.planted[0] <= 0.02
    assert {word & 0xF for _, _, word in ended.controlwords(ended.planted[0]) if word != 0x0F} == {0x02}
    assert says.replace(".", "")[:7] in report.reason.replace("(", "").replace(")", "")


def test_another_master_before_there_is_power_is_refused(rehearsal):
    def poll(stage):
        async def ask():
            while True:
                await stage.rig.rig.clock.sleep(0.02)
                stage.bus.inject(*FOREIGN["SDO requests to node 2"])

        stage.tasks.append(asyncio.ensure_future(ask()))

    rehearsal.at("", poll)
    rehearsal.at("Enable", lambda stage: None)
    ended = rehearsal.run()
    assert "must not be switched on: another master is on this bus" in ended.report.reason
    assert ended.report.exit_code == 3
    assert 0x0F not in {word & 0xF for _, _, word in ended.controlwords()}


def spare(stage):
    """A fifth drive, from the shelf, with node id 2."""
    od = read_eds(GENERIC_EDS, 2)
    od.fix(0x6075, 0, stage.drive(2).od.read(0x6075, 0))
    shaft = DrumShaft()
    drive = SimulatedDrive(2, od, shaft, position=50_300.0)
    stage.bus.attach(drive)
    return drive


def test_two_nodes_of_one_id_never_get_power(rehearsal):
    spares = []
    rehearsal.at("", lambda stage: spares.append(spare(stage)))
    ended = rehearsal.run()
    assert "two nodes answer with id 2" in ended.report.reason
    assert [drive.state for drive in (*ended.drives, *spares)] == [State.SWITCH_ON_DISABLED] * 5


def test_a_second_node_that_is_plugged_in_later_stops_the_run(rehearsal):
    rehearsal.at("Settle", spare, after=0.1)
    ended = rehearsal.run()
    report = ended.check()
    assert ended.trip is not None
    assert ended.trip.t - ended.planted[0] <= 1.0
    assert report.held


def test_what_an_adapter_warns_of_is_told_and_the_run_goes_on(rehearsal):
    rehearsal.at("Settle", lambda stage: setattr(stage.bus, "remark", "can0: 3 warnings"), after=0.1)
    ended = rehearsal.run()
    report = ended.check()
    assert report.exit_code == 0
    told = [entry for entry in ended.journal if entry.text == "bus remark"]
    assert [entry.reason for entry in told] == ["can0: 3 warnings"]
