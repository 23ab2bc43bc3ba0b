"""The real transport, in real time, on python-can's own virtual bus (threads of one process)."""

import asyncio
import itertools
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from drivers.canbus import python_can
from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanFrame, CanTransport
from fidim_lab.errors import BusError, SetupError

_numbers = itertools.count()
PAUSE = threading.Event()  # never set: real time passes here, on real threads


def eventually(condition: Callable[[], object], seconds: float = 30.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        PAUSE.wait(0.002)
    return bool(condition())


@pytest.fixture
def channel() -> str:
    return f"fidim-test-{next(_numbers)}"


@pytest.fixture
def transport(channel: str) -> Iterator[PythonCanTransport]:
    transport = PythonCanTransport("virtual", channel)
    yield transport
    transport.close()


@pytest.fixture
def other(channel: str, transport: PythonCanTransport) -> Iterator[can.BusABC]:
    with can.Bus(channel, "virtual") as bus:
        yield bus


def test_frames_in_both_directions(transport: PythonCanTransport, other: can.BusABC) -> None:
    port: CanTransport = transport
    received: list[CanFrame] = []
    seen: list[CanFrame] = []
    port.subscribe(received.append)
    port.tap(seen.append)
    before = time.monotonic()
    other.send(can.Message(arbitration_id=0x181, data=b"\x01\x02", is_extended_id=False))
    assert eventually(lambda: received)
    assert (received[0].id, received[0].data) == (0x181, b"\x01\x02")
    assert before <= received[0].t <= time.monotonic()
    port.send(0x203, b"\x06")
    message = other.recv(20.0)
    assert message is not None
    assert (message.arbitration_id, bytes(message.data)) == (0x203, b"\x06")
    assert [f.id for f in seen] == [0x181, 0x203]
    assert len(received) == 1
    assert port.fault is None


def test_what_is_not_for_canopen_is_counted(transport: PythonCanTransport, other: can.BusABC) -> None:
    other.send(can.Message(arbitration_id=0x18181, is_extended_id=True))
    other.send(can.Message(is_error_frame=True))
    counters = transport.counters
    assert eventually(lambda: counters.error_frames)
    assert (counters.foreign, counters.error_frames, counters.received) == (1, 1, 0)


def test_remote_frames_in_both_directions(transport: PythonCanTransport, other: can.BusABC) -> None:
    received: list[CanFrame] = []
    seen: list[CanFrame] = []
    transport.subscribe(received.append)
    transport.tap(seen.append)
    other.send(can.Message(arbitration_id=0x705, is_extended_id=False, is_remote_frame=True, dlc=1))
    assert eventually(lambda: received)
    transport.ask(0x703)
    message = other.recv(20.0)
    assert message is not None
    assert (message.arbitration_id, message.is_remote_frame, message.dlc) == (0x703, True, 1)
    assert [(frame.id, frame.data, frame.remote) for frame in seen] == [(0x705, b"", True), (0x703, b"", True)]


class FailingBus(can.BusABC):
    """A bus whose receiver gives what it is told: frames, exceptions, then silence."""

    script: "list[can.Message | Exception]" = []  # noqa: RUF012 - replaced by each test

    def __init__(self, channel: str = "", **options: object) -> None:
        super().__init__(channel=channel)
        self.channel_info = "failing"
        self._left = list(self.script)

    def _recv_internal(self, timeout: float | None) -> "tuple[can.Message | None, bool]":
        if self._left:
            item = self._left.pop(0)
            if isinstance(item, Exception):
                raise item
            return item, True
        PAUSE.wait(0.01)
        return None, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("no buffer space")


class FailingSlcan(FailingBus):
    def __init__(self, channel: str, **options: object) -> None:
        super().__init__(channel)


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., PythonCanTransport]]:
    made: list[PythonCanTransport] = []

    def make(*script: "can.Message | Exception") -> PythonCanTransport:
        monkeypatch.setattr(FailingBus, "script", list(script))
        monkeypatch.setattr(python_can, "SlcanBus", FailingSlcan)
        made.append(PythonCanTransport("slcan", "/dev/ttyX"))
        return made[-1]

    yield make
    for transport in made:
        transport.close()


FRAME = can.Message(arbitration_id=0x181, data=b"\x01", is_extended_id=False)


def test_one_garbled_line_is_survived(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing(FRAME, ValueError("invalid literal"), FRAME, ValueError("again"), FRAME)
    assert eventually(lambda: transport.counters.received == 3)
    assert transport.counters.garbled == 2
    assert transport.fault is None


def test_many_garbled_lines_are_a_fault(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing(*[ValueError("invalid literal")] * 30)
    assert eventually(lambda: transport.fault)
    assert "20 unreadable lines in a row; is the bit rate right?" in str(transport.fault)


def test_an_unplugged_adapter_is_a_latched_fault(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing(FRAME, OSError("device disconnected"), FRAME)
    assert eventually(lambda: transport.fault)
    fault = "slcan /dev/ttyX: reading from it failed (OSError: device disconnected); is the adapter plugged in?"
    assert transport.fault == fault
    assert not eventually(lambda: transport.counters.received > 1, 0.1), "nothing is read any more"
    assert transport.fault == fault


def test_an_adapters_warning_is_a_warning(failing: Callable[..., PythonCanTransport]) -> None:
    warning, odd = can.CanOperationError("Error warning limit"), can.CanOperationError("an overrun")
    transport = failing(FRAME, warning, warning, warning, warning, FRAME, odd, odd, FRAME)
    assert eventually(lambda: transport.counters.received == 3)
    assert transport.fault is None
    assert "6 warnings, the last: CanOperationError: an overrun" in transport.remark


def test_a_bus_that_fails_again_and_again_is_dead(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing(FRAME, *[can.CanOperationError("bus off")] * 3, FRAME)
    assert eventually(lambda: transport.fault)
    assert "reading from it failed (CanOperationError: bus off)" in str(transport.fault)


class FullBus(FailingBus):
    """A bus whose send queue is full for some tries."""

    full: "list[Exception]" = []  # noqa: RUF012 - replaced by each test

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.full:
            raise self.full.pop(0)


FULL = [
    can.CanOperationError("Failed to transmit: No buffer space available", 105),
    can.CanOperationError("Transmit buffer full"),
    can.CanOperationError("The transmit queue is full"),
]


@pytest.mark.parametrize("error", FULL, ids=str)
def test_a_full_send_queue_is_waited_for_within_the_cycle(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    monkeypatch.setattr(python_can, "_open", lambda *_, **__: FullBus())
    transport = PythonCanTransport("socketcan", "can1", send_patience=0.5)
    monkeypatch.setattr(FullBus, "full", [error] * 3)
    transport.send(0x80, b"")
    transport.send(0x80, b"")
    assert transport.fault is None
    assert transport.counters.queue_full == 1
    assert (
        "1 frames did not fit into the send queue: make its queue longer: ip link set can1 txqueuelen"
        in transport.remark
    )
    monkeypatch.setattr(FullBus, "full", [error] * 100_000)
    begin = time.monotonic()
    with pytest.raises(BusError, match="txqueuelen 1000"):
        transport.send(0x80, b"")
    assert 0.5 <= time.monotonic() - begin < 20.0
    assert "sending failed" in str(transport.fault)
    transport.close()


def test_a_send_that_fails_is_a_fault(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing()
    with pytest.raises(BusError, match=r"slcan /dev/ttyX does not take frames: no buffer space"):
        transport.send(0x80, b"")
    assert "sending failed" in str(transport.fault)


def test_a_receiver_that_raises_is_a_fault_not_the_end(failing: Callable[..., PythonCanTransport]) -> None:
    transport = failing()
    transport.subscribe(lambda frame: 1 // 0)  # type: ignore[arg-type]
    transport._receiver.on_message_received(FRAME)  # pyright: ignore[reportPrivateUsage]
    assert "a receiver of frame 0x181 failed (ZeroDivisionError" in str(transport.fault)


def test_exchanges_of_one_node_queue_and_those_of_two_do_not(transport: PythonCanTransport) -> None:
    running: list[int] = []
    together = threading.Barrier(2, timeout=30.0)

    def alone(value: int) -> int:
        running.append(value)
        assert len(running) == 1
        PAUSE.wait(0.01)
        running.remove(value)
        return value

    def in_parallel() -> int:
        return together.wait()

    async def main() -> None:
        assert await asyncio.gather(*(transport.call(1, lambda v=v: alone(v)) for v in range(3))) == [0, 1, 2]
        await asyncio.gather(transport.call(1, in_parallel), transport.call(2, in_parallel))

    asyncio.run(main())


def test_closing_twice(channel: str) -> None:
    transport = PythonCanTransport("virtual", channel)
    transport.close()
    transport.close()
    with pytest.raises(BusError, match="is closed"):
        transport.send(0x80, b"")


def test_an_interface_that_is_not_there() -> None:
    with pytest.raises(SetupError, match="The CAN bus nosuch x cannot be opened"):  # whoever wrote the name can mend it
        PythonCanTransport("nosuch", "x")


def test_a_bus_that_is_not_there_is_hardware(tmp_path: Path) -> None:
    for channel in (str(tmp_path / "ttyACM0"), "socket://127.0.0.1:1"):
        with pytest.raises(BusError, match=f"The CAN bus slcan {channel} cannot be opened: .*") as caught:
            PythonCanTransport("slcan", channel)
        assert "Is the adapter plugged in" in caught.value.hint


def test_slcan_over_tcp_sends_at_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        accepted: list[socket.socket] = []
        hub = threading.Thread(target=lambda: accepted.append(server.accept()[0]))
        hub.start()
        transport = PythonCanTransport("slcan", f"socket://127.0.0.1:{server.getsockname()[1]}", sleep_after_open=0.0)
        hub.join(30.0)
        with accepted[0]:
            link = transport._bus.serialPortOrig._socket  # pyright: ignore
            assert link.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            transport.send(0x181, b"\x01")
            accepted[0].settimeout(30.0)
            text = b""
            while b"t181101\r" not in text:
                text += accepted[0].recv(100)
            accepted[0].sendall(b"t18220102\rnonsense\rt1831FF\r")
            assert eventually(lambda: transport.counters.received == 2)
            assert transport.fault is None
            transport.close()
