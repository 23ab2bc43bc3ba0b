"""The port below the CANopen master: something that carries CAN frames.

`drivers.canbus.python_can` implements it on any python-can interface; a simulation implements it in process.
Frames are observed at the moment they pass, by whatever thread carries them: subscribers must be quick, must not block,
and must not raise.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class CanFrame:
    """One classic CAN frame with an 11-bit identifier."""

    id: int
    data: bytes
    t: float
    """monotonic s at which it passed; for sent frames the time of sending"""
    remote: bool = False
    """a remote frame (RTR), which asks for the data frame of this identifier and has no data"""


class CanTransport(Protocol):
    """A bus that carries frames in both directions."""

    at_once: bool
    """whether an answer is there when `send` returns: whoever has none by then waits for it in vain"""

    @property
    def fault(self) -> str | None:
        """Why the bus cannot be trusted any more (latched), or None."""
        ...

    @property
    def remark(self) -> str:
        """Faults so far that did not stop it, with their remedy, in words; empty without any."""
        ...

    def send(self, frame_id: int, data: bytes) -> None:
        """Put one frame on the bus. Raises BusError where that is impossible."""
        ...

    def ask(self, frame_id: int) -> None:
        """Put a remote frame on the bus: whoever owns the identifier answers with its data frame. Raises BusError."""
        ...

    def subscribe(self, receiver: Callable[[CanFrame], None]) -> None:
        """Call `receiver` for each frame that arrives from the other nodes, remote ones as well."""
        ...

    def tap(self, observer: Callable[[CanFrame], None]) -> None:
        """Call `observer` for each frame in either direction (the raw log)."""
        ...

    def call(self, key: int, exchange: Callable[[], T]) -> Awaitable[T]:
        """Run a blocking request/response exchange (SDO), one at a time for each `key` (node id).

        On a real bus this happens on a worker thread, so that the event loop goes on; in process, where the answer is
        there when `send` returns, it happens at once.
        """
        ...

    def close(self) -> None:
        """Stop receiving and free the interface; may be called twice."""
        ...
