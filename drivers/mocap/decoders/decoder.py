"""The interface of all stream decoders of motion capture: bytes in, events out, no I/O and no clock.

`vicon_udp` reads Vicon Tracker's UDP object stream, `marker_text` plain lines of numbers. A decoder never raises on any
bytes: what it cannot read becomes a `Malformed` event, with the reason, and is counted by whoever asked.
"""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

K = TypeVar("K", bound=Hashable)

Position = tuple[float, float, float]
"""m, motion-capture frame"""

HIGHEST = 2**63 - 1
"""frame number: what follows counts in 64 bits, and a million years at 1 kHz need no more than 45"""
FARTHEST = 1000.0
"""m; a marker beyond a kilometre is a damaged number, not a marker"""
UNLABELLED = "unlabelled"
"""a rig file's word for the one marker that no label belongs to"""


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
        """A hint where frames arrive without markers; may be empty."""
        ...


def is_place(position: Position) -> bool:
    """Whether three coordinates are a measurement: NaN, or the origin to the last bit, is what makers send for none."""
    x, y, z = position
    return x == x and y == y and z == z and not x == y == z == 0.0


def frame_of(
    number: int,
    names: Sequence[str],
    wanted: Sequence[K | None],
    sightings: Iterable[tuple[K, Position]],
    *,
    alone: K | None = None,
) -> "DecodedFrame | Malformed":
    """The frame of what was seen, by key; main marker first. Positions in m.

    `wanted`: the key of each of `names`, None for one that the device does not know. `alone`: a key that many may
    have, which tells nothing then. Malformed where a wanted marker is beyond a kilometre, or in two places at once.
    """
    seen: dict[K, Position] = {}
    several: set[K] = set()
    for key, place in sightings:
        if is_place(place) and seen.setdefault(key, place) != place:
            several.add(key)
    if alone is not None and alone in several:
        del seen[alone]
        several.discard(alone)
    for name, key in zip(names, wanted, strict=True):
        if key in several:
            return Malformed(f"frame {number}: marker {name} is in two places: does another one have its name?")
        if key in seen and not plausible(seen[key]):
            return Malformed(f"frame {number}: marker {name} is more than a kilometre away")
    return DecodedFrame(number, tuple([None if key is None else seen.get(key) for key in wanted]))


def plausible(position: Position) -> bool:
    """Whether all three coordinates (m) are finite and within a kilometre."""
    x, y, z = position
    return -FARTHEST <= x <= FARTHEST and -FARTHEST <= y <= FARTHEST and -FARTHEST <= z <= FARTHEST
