"""What every stream decoder of motion capture has in common: bytes in, these events out, no I/O and no clock.

`vicon_udp` reads Vicon Tracker's UDP object stream, `marker_text` plain lines of numbers. A decoder never raises on any
bytes: what it cannot read becomes a `Malformed` event, with the reason, and is counted by whoever asked.
"""

from dataclasses import dataclass
from typing import Protocol

Position = tuple[float, float, float]
"""m, motion-capture frame"""

HIGHEST = 2**63 - 1
"""frame number: what follows counts in 64 bits, and a million years at 1 kHz need no more than 45"""
FARTHEST = 1000.0
"""m; a marker beyond a kilometre is a damaged number, not a marker"""


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """One frame as the device sent it."""

    number: int
    """the device's frame counter, as transmitted"""
    positions: tuple[Position | None, ...]
    """m, motion-capture frame, main marker first; None where occluded"""


@dataclass(frozen=True, slots=True)
class Malformed:
    """Bytes that are not a frame."""

    problem: str
    """what was found and what is allowed"""


Event = DecodedFrame | Malformed


class Decoder(Protocol):
    """A stream decoder without I/O."""

    @property
    def modulus(self) -> int | None:
        """The counter wraps to 0 here; None where the format sets no limit."""
        ...

    def receive(self, data: bytes) -> list[Event]:
        """The events that `data` completes; data are a datagram or any piece of a byte stream. Never raises."""
        ...

    def restart(self) -> None:
        """Forget what was left unfinished: the connection is a new one."""
        ...

    def advice(self) -> str:
        """What a person should know who sees frames but no markers; empty where there is nothing to say."""
        ...


def plausible(position: Position) -> bool:
    """Whether all three coordinates (m) are finite and within a kilometre."""
    x, y, z = position
    return -FARTHEST <= x <= FARTHEST and -FARTHEST <= y <= FARTHEST and -FARTHEST <= z <= FARTHEST
