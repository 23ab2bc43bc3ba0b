"""The same drive nodes on a real python-can bus, in real time: bytes through python-can, nothing of our drivers."""

import struct
import threading
import time
from pathlib import Path

import can
import pytest

from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.served_bus import ServedBus

EDS = Path(__file__).parents[2] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"


@pytest.fixture
def master(request):
    """A python-can bus that nobody else uses, and two drives on it."""
    channel = request.node.name
    with can.Bus(channel, "virtual") as ours:
        shafts = [DrumShaft(), DrumShaft()]
        drives = [SimulatedDrive(node, read_eds(EDS, node), shaft) for node, shaft in enumerate(shafts, 1)]
        with ServedBus(can.Bus(channel, "virtual"), drives) as served:
            yield ours, drives, served, shafts


def receive(bus, count, timeout=30.0):
    """The next `count` frames."""
    frames = []
    until = time.monotonic() + timeout
    while len(frames) < count and (left := until - time.monotonic()) > 0.0:
        message = bus.recv(left)
        if message is not None:
            frames.append((message.arbitration_id, bytes(message.data)))
    return frames


def write(bus, node, index, sub, code, value):
    data = struct.pack("<" + code, value)
    request = struct.pack("<BHB4s", 0x23 | (4 - len(data)) << 2, index, sub, data)
    bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
    until = time.monotonic() + 30.0
    while time.monotonic() < until:
        message = bus.recv(0.5)
        if message is not None and message.arbitration_id == 0x580 + node:
            assert message.data[0] == 0x60
            return
    pytest.fail("no answer")


def test_boots_and_answers(master):
    bus, *_ = master
    assert sorted(receive(bus, 2)) == [(0x701, b"\x00"), (0x702, b"\x00")]
    bus.send(can.Message(arbitration_id=0x602, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
    assert receive(bus, 1) == [(0x582, bytes.fromhex("4300100092010200"))]


def test_foreign_frames_are_ignored(master):
    bus, *_ = master
    receive(bus, 2)
    bus.send(can.Message(arbitration_id=0x602, data=bytes(8), is_extended_id=True))
    bus.send(can.Message(arbitration_id=0x602, is_remote_frame=True, dlc=8, is_extended_id=False))
    assert receive(bus, 1, timeout=0.05) == []


def test_heartbeats_come_in_real_time(master):
    bus, *_ = master
    receive(bus, 2)
    begin = time.monotonic()
    write(bus, 1, 0x1017, 0, "H", 20)
    frames = receive(bus, 10)
    assert frames == [(0x701, b"\x7f")] * 10
    assert 0.15 < time.monotonic() - begin < 20.0  # a busy machine may be late, and nothing comes early


def test_it_moves_and_stops_when_the_host_falls_silent(master):
    bus, drives, served, shafts = master
    receive(bus, 3, timeout=0.05)  # both boot up, and become ready 5 ms later
    write(bus, 1, 0x1016, 1, "I", 127 << 16 | 600)
    write(bus, 1, 0x6007, 0, "h", 3)
    write(bus, 1, 0x6060, 0, "b", 1)
    write(bus, 1, 0x6081, 0, "I", 10_000)
    for word in (0x06, 0x07, 0x0F):
        write(bus, 1, 0x6040, 0, "H", word)
    write(bus, 1, 0x607A, 0, "i", 1_000_000)
    bus.send(can.Message(arbitration_id=0x77F, data=b"\x05", is_extended_id=False))
    write(bus, 1, 0x6040, 0, "H", 0x1F)
    assert receive(bus, 1) == [(0x081, bytes.fromhex("3081110000000000"))]
    with served.paused():
        moved = shafts[0].motion(time.monotonic()).position
        assert drives[1].state.name == "SWITCH_ON_DISABLED"
    assert 100.0 < moved < 20_000.0


def test_the_world_is_stepped_in_the_same_thread():
    times, enough = [], threading.Event()

    def step(t):
        times.append(t)
        if len(times) == 10:
            enough.set()

    with ServedBus(can.Bus("stepped", "virtual"), [], step=step):
        assert enough.wait(30.0)
    assert times == sorted(times)


def test_a_bus_that_fails_ends_it_with_a_reason():
    class Broken(can.BusABC):
        channel_info = "broken"

        def __init__(self):
            super().__init__("broken")

        def _recv_internal(self, timeout):
            raise can.CanOperationError("unplugged")

        def send(self, msg, timeout=None):
            pass

    served = ServedBus(Broken(), [])
    with served:
        served._thread.join(30.0)
    assert "unplugged" in str(served.failure)
    served.close()
