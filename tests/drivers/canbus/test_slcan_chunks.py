"""Our SLCAN reader against python-can's own: the same frames, however the bytes are cut; and what it costs."""

import os
import re
import socket
import threading
import time
import tty
from collections import deque
from collections.abc import Iterator

import can
import pytest
from can.interfaces.slcan import slcanBus
from hypothesis import given
from hypothesis import strategies as st

from drivers.canbus.slcan import SlcanBus
from sim_backends.slcan_pty import SlcanPtyBus

LINES = b"t1812AABB\r\rz\rt0800\rT000001812AABB\rr1812\r\at7FF80011223344556677\r"
WANTED = [(0x181, "aabb"), (0x080, ""), (0x181, "aabb"), (0x181, ""), (0x7FF, "0011223344556677")]


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """A pseudo terminal: the adapter's end, and what a host opens."""
    end, host = os.openpty()
    tty.setraw(host)
    yield end, os.ttyname(host)
    os.close(host)
    os.close(end)


def heard(bus: can.BusABC, wanted: int, within: float = 30.0) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    until = time.monotonic() + within
    while len(found) < wanted and time.monotonic() < until:
        if (message := bus.recv(0.05)) is not None:
            found.append((message.arbitration_id, bytes(message.data).hex()))
    return found


@pytest.mark.parametrize("kind", [slcanBus, SlcanBus])
@pytest.mark.parametrize("step", [1, 7, 1000])
def test_lines_may_be_cut_anywhere(line: tuple[int, str], kind: type[slcanBus], step: int) -> None:
    end, path = line
    with kind(path, bitrate=1_000_000, sleep_after_open=0.0) as bus:
        for begin in range(0, len(LINES), step):
            os.write(end, LINES[begin : begin + step])
        assert heard(bus, len(WANTED)) == WANTED
        assert bus.recv(0.0) is None


def unopened() -> SlcanBus:
    bus = SlcanBus.__new__(SlcanBus)
    bus._is_shutdown = True  # nothing to close
    bus._lines, bus._buffer = deque(), bytearray()
    return bus


@given(st.binary(max_size=300), st.integers(1, 40))
def test_any_bytes_become_lines_or_a_value_error(data: bytes, step: int) -> None:
    whole, pieces = unopened(), unopened()
    try:
        whole._cut(data)
        for begin in range(0, len(data), step):
            pieces._cut(data[begin : begin + step])
    except ValueError:
        assert max(map(len, re.split(rb"[\r\a]", data))) > 256
        return
    assert whole._lines == pieces._lines
    assert all(text[-1] in "\r\a" and not set(text[:-1]) & set("\r\a") for text in whole._lines)


def test_a_line_that_is_no_text_is_a_value_error_and_the_next_is_read(line: tuple[int, str]) -> None:
    end, path = line
    with SlcanBus(path, sleep_after_open=0.0) as bus:
        os.write(end, b"t18\xff1AA\rt1811BB\r")
        with pytest.raises(ValueError, match="not a frame"):
            bus.recv(20.0)
        assert heard(bus, 1) == [(0x181, "bb")]


SPOILT = [
    "tZZZ2AABB",
    "t181",
    "t18",
    "t",
    "r18",
    "T0000018",
    "d181",
    "t-122AABB",
    "t1812AA",
    "t1819AABB",
    "t18\xff2AABB",
]


@pytest.mark.parametrize("spoilt", [*SPOILT, "t1812AABBC", "tF812AABB", "t1812AABBt1812AABB"])
def test_a_line_that_lost_characters_is_a_value_error_and_nothing_else(line: tuple[int, str], spoilt: str) -> None:
    end, path = line
    with SlcanBus(path, sleep_after_open=0.0) as bus:
        os.write(end, spoilt.encode("latin1") + b"\rt1812CCDD\r")
        with pytest.raises(ValueError, match=r"frame|literal"):
            bus.recv(20.0)
        assert heard(bus, 1) == [(0x181, "ccdd")]


def test_answers_of_the_adapter_and_time_stamps_pass(line: tuple[int, str]) -> None:
    end, path = line
    with SlcanBus(path, sleep_after_open=0.0) as bus:
        os.write(end, b"z\r\r\aF00\rV1013\rNA123\rt1812AABB1234\rt1811CC00C0FFEE\r")
        assert heard(bus, 2) == [(0x181, "aabb"), (0x181, "cc")]


def test_a_server_that_hangs_up_is_an_error_not_silence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        bus = SlcanBus(f"socket://127.0.0.1:{server.getsockname()[1]}", sleep_after_open=0.0)
        link, _ = server.accept()
        link.close()
        with pytest.raises(can.CanOperationError, match="Could not read"):
            list(iter(lambda: bus.recv(0.2), "for ever"))
        bus.serialPortOrig._socket.close()
        bus._is_shutdown = True


def test_sending_does_not_wait_for_the_port(monkeypatch: pytest.MonkeyPatch) -> None:
    """tcdrain returns at once on a pseudo terminal; on a wire, when the last bit is out."""
    with SlcanPtyBus() as adapter, SlcanBus(adapter.path, bitrate=1_000_000, sleep_after_open=0.0) as bus:
        monkeypatch.setattr(bus.serialPortOrig, "flush", lambda: pytest.fail("waited"))
        for number in range(50):
            bus.send(can.Message(arbitration_id=0x300 + number, data=b"\x01", is_extended_id=False))
        assert [found for found, _ in heard(adapter, 50)] == [*range(0x300, 0x332)]


def test_waiting_costs_nothing(line: tuple[int, str]) -> None:
    """python-can's own asks the port a thousand times a second."""
    _, path = line
    with SlcanBus(path, sleep_after_open=0.0) as bus:
        before, begun = time.thread_time(), time.monotonic()
        assert bus.recv(0.3) is None
        assert time.monotonic() - begun > 0.25
        assert time.thread_time() - before < 0.01


def test_a_full_bus_is_read_in_a_fraction_of_its_time() -> None:
    """A second of a full bus of 1 Mbit/s is 7407 frames; python-can's own reader takes about a second of CPU."""
    with SlcanPtyBus() as adapter, SlcanBus(adapter.path, bitrate=1_000_000, sleep_after_open=0.0) as bus:
        adapter.recv(0.0)

        def flood() -> None:
            for number in range(2000):
                data = number.to_bytes(8, "little")
                adapter.send(can.Message(arbitration_id=0x181, data=data, is_extended_id=False))

        sender = threading.Thread(target=flood)
        sender.start()
        spent = time.thread_time()
        found = [bus.recv(20.0) for _ in range(2000)]
        spent = time.thread_time() - spent
        sender.join()
        assert [int.from_bytes(message.data, "little") for message in found if message is not None] == [*range(2000)]
        assert adapter.lost == 0
        assert spent / 2000 < 80e-6, f"{1e6 * spent / 2000:.0f} µs of CPU a frame"
