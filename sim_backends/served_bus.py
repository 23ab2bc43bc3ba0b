"""The simulated nodes on a real python-can bus, in real time, from a thread of their own.

For `--real-time` and for tests of the python-can side: the same nodes as on an `InProcessBus`.
"""

import logging
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from types import TracebackType

import can

from drivers.canbus.transport import CanFrame
from sim_backends.can_node import CanNode, Outgoing

_TICK = 0.005
"""s after which the nodes are looked at even if no frame comes"""
_JOIN = 2.0
"""s to wait for the thread to end"""


class ServedBus:
    """Serves nodes on a `can.BusABC`, as context manager: from `with` on they live, after it they are gone.

    Nodes hear the master and each other. Everything of theirs happens in one thread; whoever touches them, or the
    shafts' world, from another thread does so within `paused()`; `step(t)` is called in that thread every 5 ms.
    A bus that fails ends the thread; `failure` then says why.
    Not simulated: hard real time. Answers come as late as Python's scheduling has it (some ms on a busy machine).
    """

    def __init__(
        self,
        bus: can.BusABC,
        nodes: Sequence[CanNode],
        *,
        step: Callable[[float], None] | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Takes over `bus`, and shuts it down in the end."""
        self._bus = bus
        self._nodes = tuple(nodes)
        self._step = step
        self._now = now
        self._lock = threading.RLock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="simulated nodes", daemon=True)
        self.failure: Exception | None = None

    def __enter__(self) -> "ServedBus":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Take the nodes off the bus; may be called twice."""
        self._ending.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_JOIN)
        self._bus.shutdown()

    @contextmanager
    def paused(self) -> Generator[None]:
        """The nodes stand still meanwhile: for injecting faults, reading states, setting loads."""
        with self._lock:
            yield

    def _serve(self) -> None:
        try:
            with self._lock:
                for node in self._nodes:
                    self._send(node, node.start(self._now()))
            while not self._ending.is_set():
                message = self._bus.recv(_TICK)
                with self._lock:
                    self._live(message)
        except (can.CanError, OSError, ValueError) as problem:
            logging.getLogger(__name__).warning("the simulated nodes have lost their bus: %s", problem)
            self.failure = problem

    def _live(self, message: can.Message | None) -> None:
        t = self._now()
        if message is not None and not (message.is_error_frame or message.is_extended_id):
            remote = message.is_remote_frame
            data = b"" if remote else bytes(message.data)
            self._deliver(CanFrame(message.arbitration_id, data, t, remote), None)
        for node in self._nodes:
            self._send(node, node.advance(t))
        if self._step is not None:
            self._step(t)

    def _deliver(self, frame: CanFrame, sender: CanNode | None) -> None:
        for node in self._nodes:
            if node is not sender and frame.id in node.listens:
                self._send(node, node.receive(frame))

    def _send(self, sender: CanNode, frames: Sequence[Outgoing]) -> None:
        for frame_id, data in frames:
            self._bus.send(can.Message(arbitration_id=frame_id, data=data, is_extended_id=False))
            self._deliver(CanFrame(frame_id, data, self._now()), sender)
