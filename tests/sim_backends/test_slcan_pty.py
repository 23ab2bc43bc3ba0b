"""The simulated adapter on a pseudo terminal: its end of the line, a host that does not read, taking it away."""

import os
import tty

import can
import pytest

from fidim_lab.errors import SetupError
from sim_backends.slcan_pty import SlcanPtyBus


@pytest.fixture
def adapter():
    with SlcanPtyBus() as bus:
        yield bus


def test_commands_are_no_frames_and_lines_may_be_cut(adapter):
    host = os.open(adapter.path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(host)
    try:
        os.write(host, b"C\rS8\rO\rt2011")
        assert adapter.recv(0.05) is None
        os.write(host, b"0F\r")
        heard = adapter.recv(20.0)
        assert heard is not None
        assert (heard.arbitration_id, bytes(heard.data)) == (0x201, b"\x0f")
        adapter.send(can.Message(arbitration_id=0x181, data=b"\xaa", is_extended_id=False))
        assert os.read(host, 100) == b"t1811AA\r"
    finally:
        os.close(host)


def test_what_a_host_does_not_read_is_lost_and_counted(adapter, monkeypatch):
    monkeypatch.setattr("sim_backends.slcan_pty._SEND_TIMEOUT", 0.01)
    message = can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=False)
    for _ in range(20_000):
        adapter.send(message)
        if adapter.lost:
            break
    assert adapter.lost == 1


def test_it_may_be_taken_away_twice(adapter):
    adapter.shutdown()
    adapter.shutdown()


def test_a_pulled_plug_takes_its_name_away_and_the_host_is_told(tmp_path):
    link = tmp_path / "usb" / "can"
    with SlcanPtyBus(link) as bus:
        host = os.open(link, os.O_RDWR | os.O_NOCTTY)
        try:
            bus.plugged = False
            assert bus.recv(0.01) is None
            bus.send(can.Message(arbitration_id=0x181, data=b"\xaa", is_extended_id=False))
            assert not link.is_symlink()
            with pytest.raises(OSError, match=r"Input/output error"):
                os.write(host, b"O\r")
        finally:
            os.close(host)
        bus.plugged = True
        assert bus.recv(0.01) is None
        host = os.open(link, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(host)
        try:
            os.write(host, b"t20110F\r")
            assert bus.recv(20.0) is not None
        finally:
            os.close(host)


def test_it_does_not_take_the_place_of_something_else(tmp_path):
    (tmp_path / "can").write_text("mine")
    with pytest.raises(SetupError, match="something else of this name"):
        SlcanPtyBus(tmp_path / "can")
    assert (tmp_path / "can").read_text() == "mine"
