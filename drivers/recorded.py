"""Devices that replay recorded bytes: a bus with logged frames, a feed of logged packets, and their clock.

The drivers above cannot tell them from real ones, except that nothing they send arrives anywhere.
"""

import asyncio
import heapq
from collections.abc import Awaitable, Callable
from itertools import count
from typing import TypeVar

from drivers.canbus.transport import CanFrame
from drivers.mocap.mailbox import Mailbox, MailboxClosedError
from drivers.mocap.packet_log import Packet
from fidim_lab.errors import DeviceError

T = TypeVar("T")

_QUEUE = 4096


class RecordedClock:
    """`Clock` port that stands still until `advance` tells it the time of the next recorded byte."""

    def __init__(self, start: float) -> None:
        """`start`: monotonic s of the recording."""
        self._now = start
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = count()

    def now(self) -> float:
        """Monotonic s of the recording."""
        return self._now

    async def sleep(self, seconds: float) -> None:
        """Until the recording is so much further."""
        future = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self._now + max(seconds, 0.0), next(self._numbers), future))
        if seconds <= 0.0:
            asyncio.get_running_loop().call_soon(self._wake)
        await future

    def advance(self, t: float) -> None:
        """It is `t` now; time never goes back."""
        self._now = max(self._now, t)
        self._wake()

    def _wake(self) -> None:
        while self._sleepers and self._sleepers[0][0] <= self._now:
            _, _, future = heapq.heappop(self._sleepers)
            if not future.done():
                future.set_result(None)


class RecordedBus:
    """`CanTransport` port: `deliver` hands a logged frame to the subscribers; what is sent goes nowhere."""

    at_once = True
    fault: str | None = None
    remark: str = ""

    def __init__(self) -> None:
        self._subscribers: list[Callable[[CanFrame], None]] = []

    def deliver(self, frame: CanFrame) -> None:
        """A frame of the log passes."""
        for receiver in self._subscribers:
            receiver(frame)

    def send(self, frame_id: int, data: bytes) -> None:
        """Goes nowhere."""

    def ask(self, frame_id: int) -> None:
        """Goes nowhere."""

    def subscribe(self, receiver: Callable[[CanFrame], None]) -> None:
        """Call `receiver` for each delivered frame."""
        self._subscribers.append(receiver)

    def tap(self, observer: Callable[[CanFrame], None]) -> None:
        """Call `observer` for each delivered frame."""
        self._subscribers.append(observer)

    def call(self, key: int, exchange: Callable[[], T]) -> Awaitable[T]:
        """Nobody answers a recording. Raises DeviceError."""
        raise DeviceError(f"node {key}", "is a recording and answers no request.")

    def close(self) -> None:
        """Nothing to free."""


class RecordedFeed:
    """`ByteFeed` port: packets put in come out with their own time of arrival."""

    name = "recorded motion capture"
    hint = "The log has ended."

    def __init__(self) -> None:
        self._mailbox: Mailbox[Packet] = Mailbox(_QUEUE)
        self.connection = 0

    def put(self, packet: Packet) -> None:
        """The next packet of the log."""
        self._mailbox.put(packet)

    async def open(self) -> None:
        """Nothing to open."""

    async def receive(self) -> tuple[float, bytes]:
        """The next packet. Raises DeviceError once closed."""
        try:
            packet = await self._mailbox.get()
        except MailboxClosedError:
            await asyncio.get_running_loop().create_future()  # until whoever reads is cancelled
            raise DeviceError(self.name, "was closed") from None
        self.connection = packet.connection
        return packet.t, packet.data

    async def close(self) -> None:
        """No more packets."""
        self._mailbox.close()
