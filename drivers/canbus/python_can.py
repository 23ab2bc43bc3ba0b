"""`PythonCanTransport`: the CanTransport port on any python-can interface, in real time.

python-can's receive thread dies silently of the first exception of `recv` unless a listener has `on_error`; this one
has, and sorts what goes wrong: a garbled line, an adapter's warning and a full send queue are counted, passed over and
told in `remark`; a dead bus is latched in `fault`.
"""

import asyncio
import contextlib
import errno
import re
import socket
import threading
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import can

from drivers.canbus.slcan import SlcanBus
from drivers.canbus.transport import CanFrame
from fidim_lab.errors import BusError, SetupError

T = TypeVar("T")

_POLL_S = 0.2
_CLOSE_S = 2.0
_GARBLED_IN_A_ROW = 20
_FAILED_IN_A_ROW = 3
"""reads without a frame between them, after which a bus is dead; one that only warned goes on bringing frames"""
_FAILED_PAUSE_S = 0.01
_RETRY_S = 2e-4
"""between two tries of a frame for which the queue had no room: about the time of one frame at 1 Mbit/s"""
SEND_PATIENCE_S = 4e-3
"""s for which a full queue is waited for, unless the bus's SYNC period is given: the same cycle at 250 Hz"""
_QUEUE_FULL = (errno.ENOBUFS, errno.EAGAIN)
_QUEUE_FULL_WORDS = re.compile(
    r"no buffer space|(?:transmit|tx|send|queue)[\w ]{0,12}(?:full|overflow)|QXMTFULL|TXBUFOFL", re.I
)
"""of interfaces that give no errno: socketcan's own time-out, PCAN, Kvaser, IXXAT"""
QUEUE_CURE = "make its queue longer: ip link set {channel} txqueuelen 1000"
_PAUSE = threading.Event()
"""never set: a thread's own short wait, where real time passes"""
_RECEIVE_FAILED = "reading from it failed"


@dataclass
class BusCounters:
    """Counters of frames and of faults; written by the receiving thread."""

    received: int = 0
    garbled: int = 0
    """lines or frames that the interface could not decode"""
    foreign: int = 0
    """extended identifiers, which CANopen does not use here"""
    error_frames: int = 0
    warnings: int = 0
    """what the interface raised once, and went on"""
    queue_full: int = 0
    """frames that had to wait for room in the send queue; written by the sending threads"""


class _Receiver(can.Listener):
    """Runs in python-can's thread; must not raise, or receiving ends."""

    def __init__(self, interface: str) -> None:
        self.counters = BusCounters()
        self.fault: str | None = None
        self.subscribers: tuple[Callable[[CanFrame], None], ...] = ()
        self.observers: tuple[Callable[[CanFrame], None], ...] = ()
        self.notifier: can.Notifier | None = None
        self.tolerated: Exception | None = None
        self.warned = ""
        """the newest warning, in the interface's words"""
        self._interface = interface
        self._garbled_in_a_row = 0
        self._failed_in_a_row = 0
        self._ended = False

    def latch(self, reason: str) -> None:
        """Keep the first reason."""
        if self.fault is None:
            self.fault = f"{self._interface}: {reason}"

    def on_message_received(self, msg: can.Message) -> None:
        """One frame from the bus."""
        if self._ended:
            return
        counters = self.counters
        self._failed_in_a_row = 0
        if not msg.is_rx:  # our own, from an interface that is told to echo
            return
        if msg.is_error_frame:
            counters.error_frames += 1
            return
        if msg.is_extended_id:
            counters.foreign += 1
            return
        counters.received += 1
        self._garbled_in_a_row = 0
        remote = msg.is_remote_frame
        frame = CanFrame(msg.arbitration_id, b"" if remote else bytes(msg.data), time.monotonic(), remote)
        try:
            for call in (*self.observers, *self.subscribers):
                call(frame)
        except Exception as error:  # a receiver that raises would end all receiving
            self.latch(f"a receiver of frame 0x{frame.id:03X} failed ({type(error).__name__}: {error}), our bug")

    def on_error(self, exc: Exception) -> None:
        """`recv` raised: go on after a garbled line or a warning, end where reading fails again and again."""
        self.tolerated = exc
        if isinstance(exc, ValueError):  # what slcan raises for a line that is none
            self.counters.garbled += 1
            self._garbled_in_a_row += 1
            if self._garbled_in_a_row < _GARBLED_IN_A_ROW:
                return
            self.latch(f"{self._garbled_in_a_row} unreadable lines in a row; is the bit rate right?")
        elif self._only_warns(exc):
            _PAUSE.wait(_FAILED_PAUSE_S)  # no tight loop; the interface keeps what arrives meanwhile
            return
        self.latch(f"{_RECEIVE_FAILED} ({type(exc).__name__}: {exc}); is the adapter plugged in?")
        self._ended = True
        self.attach(self.notifier)

    def _only_warns(self, exc: Exception) -> bool:
        """Whether reading may go on: the text says so, or it has not failed again and again."""
        if "warning" in str(exc).lower():  # "error warning limit": the controller counts errors, and works
            self.counters.warnings += 1
            self.warned = str(exc)
            return True
        self._failed_in_a_row += 1
        if isinstance(exc, OSError) or self._failed_in_a_row >= _FAILED_IN_A_ROW:  # the system's own: it is gone
            return False
        self.counters.warnings += 1
        self.warned = f"{type(exc).__name__}: {exc}"
        return True

    def attach(self, notifier: can.Notifier | None) -> None:
        """Know whom to stop: receiving may have failed before the notifier was even made."""
        self.notifier = notifier
        if self._ended and notifier is not None:
            notifier.stop(timeout=-1.0)  # may be that very thread: do not join it


class PythonCanTransport:
    """A bus opened by python-can. Frames arrive on python-can's thread, SDO exchanges run on one thread a node."""

    at_once = False

    def __init__(
        self,
        interface: str,
        channel: str,
        *,
        bitrate: int = 1_000_000,
        send_patience: float = SEND_PATIENCE_S,
        **options: Any,
    ) -> None:
        """`interface`, `channel`, `options` as python-can names them.

        send_patience: s for which a frame waits for room in the send queue, at most one SYNC period.

        Raises SetupError where they are wrong, BusError where the bus cannot be reached.
        """
        self._label = f"{interface} {channel}"
        self._queue_cure = QUEUE_CURE.format(channel=channel) if interface == "socketcan" else "lower the SYNC rate"
        self._send_patience = send_patience
        try:
            self._bus = _open(interface, channel, bitrate=bitrate, **options)
        except Exception as error:  # each interface has its own
            wrong = isinstance(error, can.CanInterfaceNotImplementedError | ImportError | TypeError | ValueError)
            raise (SetupError if wrong else BusError)(
                f"The CAN bus {self._label} cannot be opened: {error}.",
                hint="Are interface, channel and options right, and its library installed?"
                if wrong
                else "Is the adapter plugged in, the channel right, and no other program using it?",
            ) from error
        _send_small_packets_at_once(self._bus)
        self._receiver = _Receiver(self._label)
        self._workers: dict[int, ThreadPoolExecutor] = {}
        self._closed = False
        self._sending = threading.Lock()
        self._notifier = can.Notifier(self._bus, [self._receiver], timeout=_POLL_S)
        self._receiver.attach(self._notifier)

    @property
    def counters(self) -> BusCounters:
        """Of received frames."""
        return self._receiver.counters

    @property
    def fault(self) -> str | None:
        """Why the bus cannot be trusted any more (latched), or None."""
        died_of = self._notifier.exception
        if died_of is not None and died_of is not self._receiver.tolerated:
            self._receiver.latch(f"{_RECEIVE_FAILED} ({type(died_of).__name__}: {died_of})")
        return self._receiver.fault

    @property
    def remark(self) -> str:
        """Faults so far that did not stop it, in words; empty without any."""
        counts, words = self._receiver.counters, []
        if counts.garbled:
            words.append(f"{counts.garbled} unreadable lines were ignored: check the serial line")
        if counts.warnings:
            words.append(f"{counts.warnings} warnings, the last: {self._receiver.warned}: check cable and termination")
        if counts.error_frames:
            words.append(f"{counts.error_frames} error frames: check cable, termination and bit rate")
        if counts.queue_full:
            words.append(f"{counts.queue_full} frames did not fit into the send queue: {self._queue_cure}")
        return f"{self._label}: {'; '.join(words)}" if words else ""

    def send(self, frame_id: int, data: bytes) -> None:
        """Put one frame on the bus; a full send queue is waited for within the cycle.

        Raises BusError where that is impossible.
        """
        self._send(can.Message(arbitration_id=frame_id, data=data, is_extended_id=False))

    def ask(self, frame_id: int) -> None:
        """Put a remote frame on the bus, for an answer of one byte. Raises BusError as `send`."""
        self._send(can.Message(arbitration_id=frame_id, is_remote_frame=True, dlc=1, is_extended_id=False))

    def _send(self, message: can.Message) -> None:
        if self._closed:
            raise BusError(f"The CAN bus {self._label} is closed.")
        # SYNC and SDO come from different threads; slcan writes text, which must not interleave
        with self._sending:
            frame = CanFrame(message.arbitration_id, bytes(message.data), time.monotonic(), message.is_remote_frame)
            for observer in self._receiver.observers:  # first, so that no answer stands before it in the log
                observer(frame)
            try:
                self._send_when_there_is_room(message)
            except Exception as error:  # each interface has its own
                self._receiver.latch(f"sending failed ({type(error).__name__}: {error})")
                hint = f"Is any other node there to acknowledge? Then {self._queue_cure}." if _is_full(error) else ""
                raise BusError(f"The CAN bus {self._label} does not take frames: {error}.", hint=hint) from error

    def _send_when_there_is_room(self, message: can.Message) -> None:
        """Raises what the interface raises, and for a full queue only once the patience is used up."""
        patience = 0.0 if self._receiver.fault else self._send_patience  # a stop on a dead bus is tried once
        deadline, waited = time.monotonic() + patience, False
        while True:
            try:
                self._bus.send(message)
            except Exception as error:
                if not _is_full(error) or time.monotonic() >= deadline:
                    raise
                self._receiver.counters.queue_full += not waited
                waited = True
                _PAUSE.wait(_RETRY_S)
            else:
                return

    def subscribe(self, receiver: Callable[[CanFrame], None]) -> None:
        """Call `receiver` for each frame from the other nodes, on the receiving thread."""
        self._receiver.subscribers = (*self._receiver.subscribers, receiver)

    def tap(self, observer: Callable[[CanFrame], None]) -> None:
        """Call `observer` for each frame in either direction, on the thread that carries it."""
        self._receiver.observers = (*self._receiver.observers, observer)

    def call(self, key: int, exchange: Callable[[], T]) -> Awaitable[T]:
        """Run a blocking exchange on the worker thread of `key`, one at a time."""
        if key not in self._workers:
            self._workers[key] = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"sdo-{key}")
        return asyncio.wrap_future(self._workers[key].submit(exchange))

    def close(self) -> None:
        """Stop receiving and free the interface; may be called twice."""
        if self._closed:
            return
        self._closed = True
        for worker in self._workers.values():
            worker.shutdown(wait=False, cancel_futures=True)
        self._notifier.stop(timeout=_CLOSE_S)
        try:
            self._bus.shutdown()
        except Exception as error:  # each interface has its own; one that died cannot be told that it may go
            self._receiver.latch(f"closing it failed ({type(error).__name__}: {error})")
            _free_port(self._bus)


def _is_full(error: Exception) -> bool:
    """Whether an interface says that its send queue has no room now."""
    code = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return code in _QUEUE_FULL or (code is None and _QUEUE_FULL_WORDS.search(str(error)) is not None)


def _open(interface: str, channel: str, **options: Any) -> can.BusABC:
    """The bus by python-can's name, but for slcan, whose own reader is too slow for a full bus."""
    return SlcanBus(channel, **options) if interface == "slcan" else can.Bus(channel, interface, **options)


def _free_port(bus: can.BusABC) -> None:
    """Close the serial port below a bus whose own farewell failed: slcan says "C" first, also to nobody."""
    port = getattr(bus, "serialPortOrig", None)
    if port is None:
        return
    link = getattr(port, "_socket", None)  # pyserial leaves it open where the other end has gone
    with contextlib.suppress(OSError):
        port.close()
    if isinstance(link, socket.socket):
        link.close()


def _send_small_packets_at_once(bus: can.BusABC) -> None:
    """Nagle off where slcan runs over TCP: pyserial leaves it on, and frames then wait for up to 40 ms."""
    port = getattr(bus, "serialPortOrig", None)
    link = getattr(port, "_socket", None)
    if isinstance(link, socket.socket):
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
