"""What a bus must know of a simulated CAN node: frames and the time in, frames to send out. No I/O in it."""

from collections.abc import Container, Sequence
from typing import Protocol

from drivers.canbus.transport import CanFrame

Outgoing = tuple[int, bytes]
"""identifier and data of a frame to send"""


class CanNode(Protocol):
    """A device on a simulated bus."""

    @property
    def listens(self) -> Container[int]:
        """Identifiers it wants to receive; may change with any frame."""
        ...

    @property
    def due(self) -> float:
        """When it will next do something by itself, s; infinity: never."""
        ...

    def start(self, t: float) -> Sequence[Outgoing]:
        """Power comes at time t."""
        ...

    def receive(self, frame: CanFrame) -> Sequence[Outgoing]:
        """A frame has come, at `frame.t`."""
        ...

    def advance(self, t: float) -> Sequence[Outgoing]:
        """Live until time t."""
        ...
