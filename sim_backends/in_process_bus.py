"""A CAN bus inside one process: what is sent has been delivered and answered when `send` returns.

The default bus of the dry run. Nodes are pure (`CanNode`); the world calls `advance` so that they live.
For the same nodes on a real python-can bus see `served_bus`.
"""

import heapq
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import count
from typing import TypeVar

from drivers.canbus.transport import CanFrame
from fidim_lab.errors import BusError, OurBugError
from sim_backends.bus_faults import FrameRule
from sim_backends.can_node import CanNode, Outgoing

T = TypeVar("T")

_MASTER, _STRANGER = "master", "stranger"
_Sender = CanNode | str


class InProcessBus:
    """`CanTransport` of a master, with simulated nodes on the other end.

    Frames that are sent at the same time pass in the order of their identifiers, each to everybody but its sender. A
    subscriber may send from within its callback; that frame joins the queue and has passed when the outermost `send`
    returns. Not simulated: transmission times and bus load, error frames and counters. One thread only.
    """

    at_once = True

    def __init__(self, clock_now: Callable[[], float]) -> None:
        """`clock_now`: monotonic s, the time stamp of frames."""
        self._now = clock_now
        self._nodes: list[CanNode] = []
        self._receivers: list[Callable[[CanFrame], None]] = []
        self._observers: list[Callable[[CanFrame], None]] = []
        self._queue: list[tuple[int, int, bytes, _Sender, bool]] = []
        self._late: list[tuple[float, int, CanFrame, _Sender]] = []
        self._order = count()
        self._passing = False
        self.fault: str | None = None
        """why the master's adapter is out of order; a rehearsal sets it ("bus-off", "adapter unplugged")"""
        self.remark = ""
        """what a rehearsal's adapter warns of"""
        self.cut = False
        """the cable to the master is cut: silence both ways, which its adapter does not notice"""
        self.rules: list[FrameRule] = []
        """what happens to single frames; the first rule that applies counts"""

    def attach(self, node: CanNode) -> None:
        """Connect a node and give it power; it boots at once."""
        self._nodes.append(node)
        self._push(node, node.start(self._now()))
        self._run()

    def send(self, frame_id: int, data: bytes) -> None:
        """Deliver one frame of the master, and all that it leads to.

        Raises BusError while `fault` is set, OurBugError for what is no classic CAN frame.
        """
        self._require_adapter(frame_id)
        _check(frame_id, data)
        self._push(_MASTER, [(frame_id, data)])
        self._run()

    def ask(self, frame_id: int) -> None:
        """Deliver a remote frame of the master, and the answer. Raises BusError while `fault` is set."""
        self._require_adapter(frame_id)
        self._push(_MASTER, [(frame_id, b"")], remote=True)
        self._run()

    def inject(self, frame_id: int, data: bytes, *, remote: bool = False) -> None:
        """Deliver a frame of somebody else to the master and to all nodes."""
        _check(frame_id, data)
        self._push(_STRANGER, [(frame_id, data)], remote=remote)
        self._run()

    def subscribe(self, receiver: Callable[[CanFrame], None]) -> None:
        """Call `receiver` for each frame that reaches the master."""
        self._receivers.append(receiver)

    def tap(self, observer: Callable[[CanFrame], None]) -> None:
        """Call `observer` for each frame that the master sends or receives."""
        self._observers.append(observer)

    async def call(self, key: int, exchange: Callable[[], T]) -> T:
        """Run `exchange` when awaited, at once: its answers are there when its `send` returns."""
        return exchange()

    def close(self) -> None:
        """The master leaves: nothing is delivered to it any more, and it can send nothing."""
        self._receivers.clear()
        self._observers.clear()
        self.fault = self.fault or "the bus has been closed"

    @property
    def due(self) -> float:
        """When something will next happen by itself, s; infinity: never."""
        due = min([node.due for node in self._nodes], default=math.inf)
        return min(due, self._late[0][0]) if self._late else due

    def advance(self, t: float) -> None:
        """Let all nodes live until t, in the order in which things happen, and late frames arrive."""
        while (due := self.due) < t:
            self._live(due)
        self._live(t)

    def _live(self, t: float) -> None:
        while self._late and self._late[0][0] <= t:
            _, _, frame, sender = heapq.heappop(self._late)
            self._deliver(replace(frame, t=self._now()), sender)
        for node in self._nodes:
            self._push(node, node.advance(t))
        self._run()

    def _require_adapter(self, frame_id: int) -> None:
        if self.fault is not None:
            raise BusError(f"cannot send frame {frame_id:#05x}: {self.fault}", hint="Check adapter and cable.")

    def _push(self, sender: _Sender, frames: Iterable[Outgoing], *, remote: bool = False) -> None:
        for frame_id, data in frames:
            heapq.heappush(self._queue, (frame_id, next(self._order), data, sender, remote))

    def _run(self) -> None:
        """Let all frames that contend for the bus pass, unless that is going on already."""
        if self._passing:
            return
        self._passing = True
        try:
            while self._queue:
                frame_id, _, data, sender, remote = heapq.heappop(self._queue)
                self._pass(CanFrame(frame_id, data, self._now(), remote), sender)
        finally:
            self._passing = False

    def _pass(self, frame: CanFrame, sender: _Sender) -> None:
        if sender is _MASTER:
            for observer in self._observers:
                observer(frame)
        rule = next((rule for rule in self.rules if rule.applies(frame)), None) if self.rules else None
        if rule is None:
            self._deliver(frame, sender)
        elif not rule.drop:
            changed = replace(frame, data=rule.change(frame.data)[:8] if rule.change else frame.data)
            for _ in range(rule.copies):
                if rule.delay > 0.0:
                    heapq.heappush(self._late, (frame.t + rule.delay, next(self._order), changed, sender))
                else:
                    self._deliver(changed, sender)

    def _deliver(self, frame: CanFrame, sender: _Sender) -> None:
        connected = not self.cut and self.fault is None
        if sender is not _MASTER and connected:
            for observer in self._observers:
                observer(frame)
            for receiver in self._receivers:
                receiver(frame)
        if sender is _MASTER and not connected:
            return
        for node in self._nodes:
            if node is not sender and frame.id in node.listens:
                self._push(node, node.receive(frame))


def _check(frame_id: int, data: bytes) -> None:
    if not 0 <= frame_id <= 0x7FF or len(data) > 8:
        raise OurBugError(f"no classic CAN frame: identifier {frame_id:#x}, {len(data)} bytes")
