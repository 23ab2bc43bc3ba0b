"""The SLCAN server, met by python-can's own client: golden lines, two clients, and a plug that is pulled."""

import socket

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.errors import SetupError
from sim_backends.slcan_server import SlcanServerBus, format_line, parse_line

LINES = {
    b"t1812AABB": (0x181, b"\xaa\xbb"),
    b"t0800": (0x080, b""),
    b"t7FF80011223344556677": (0x7FF, bytes(range(0, 0x88, 0x11))),
}


@pytest.mark.parametrize("line", LINES)
def test_golden_lines(line):
    identifier, data = LINES[line]
    message = parse_line(line)
    assert message is not None
    assert (message.arbitration_id, bytes(message.data)) == (identifier, data)
    assert format_line(message) == line + b"\r"


def test_a_remote_frame_asks_and_has_no_data():
    message = parse_line(b"r7031")
    assert message is not None
    assert (message.arbitration_id, message.is_remote_frame, message.dlc) == (0x703, True, 1)
    assert format_line(message) == b"r7031\r"


@pytest.mark.parametrize("line", [b"", b"O", b"S8", b"t18", b"t1813AABB", b"t1819", b"tFFF0", b"T000001810", b"txyz0"])
def test_what_is_no_frame(line):
    assert parse_line(line) is None


@given(st.binary(max_size=40))
def test_any_bytes_are_a_frame_or_none(line):
    message = parse_line(line)
    assert message is None or message.dlc <= 8


@pytest.fixture
def server():
    with SlcanServerBus("127.0.0.1", 0) as bus:
        yield bus


def client(server):
    return can.Bus(f"socket://127.0.0.1:{server.port}", "slcan", bitrate=1_000_000, sleep_after_open=0.0)


def test_frames_go_to_everybody_but_their_sender(server):
    with client(server) as one, client(server) as two:
        assert server.recv(0.2) is None  # both are let in, and their commands are no frames
        one.send(can.Message(arbitration_id=0x601, data=b"\x40\x00\x10\x00", is_extended_id=False))
        heard = server.recv(20.0)
        assert heard is not None
        assert (heard.arbitration_id, bytes(heard.data)) == (0x601, b"\x40\x00\x10\x00")
        assert two.recv(20.0).arbitration_id == 0x601
        server.send(can.Message(arbitration_id=0x581, data=b"\x01", is_extended_id=False))
        assert one.recv(20.0).arbitration_id == 0x581
        assert two.recv(20.0).arbitration_id == 0x581


def test_a_pulled_plug_is_noticed(server):
    bus = client(server)
    server.recv(0.2)
    server.plugged = False
    server.send(can.Message(arbitration_id=0x80, is_extended_id=False))
    with pytest.raises(can.CanOperationError):
        list(iter(lambda: bus.recv(0.1), "for ever"))
    bus.serialPortOrig.close()
    bus._is_shutdown = True  # its farewell has nobody to go to


def test_a_taken_port_is_said(server):
    with pytest.raises(SetupError, match=r"cannot listen there.*simulators running already"):
        SlcanServerBus("127.0.0.1", server.port)


def test_a_client_that_leaves_in_the_middle_of_a_line_is_forgotten(server):
    with socket.create_connection(("127.0.0.1", server.port)) as raw:
        assert server.recv(0.1) is None
        raw.sendall(b"t1812AA")
    assert server.recv(0.2) is None
    server.send(can.Message(arbitration_id=0x80, is_extended_id=False))
