"""What can go wrong between the cameras and the host, as data; `Damage` does it to packets, repeatably."""

from collections import Counter
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class During:
    """A stretch of stream time: start ≤ t < stop, s after the first frame."""

    start: float
    stop: float

    def __contains__(self, t: object) -> bool:
        return isinstance(t, float) and self.start <= t < self.stop


@dataclass(frozen=True)
class Occlusion:
    """A marker is hidden from the cameras."""

    during: During
    marker: int = 0
    """0 is the main marker"""


@dataclass(frozen=True)
class Jump:
    """A marker is seen in a wrong place: mislabelled, or knocked off."""

    during: During
    offset: tuple[float, float, float]
    """m"""
    marker: int = 0


@dataclass(frozen=True)
class Freeze:
    """The server repeats the marker's last position."""

    during: During
    marker: int = 0


@dataclass(frozen=True)
class Replay:
    """The server repeats what it sent before, numbers and all."""

    during: During
    frames: int
    """by how many it is behind"""
    renumbered: bool = False
    """the places are old, the numbers are not"""


STRAY_COUNT = 500_000
"""frames by which another session's count is off"""
STRAY_PLACE = 0.3
"""m by which the marker was elsewhere then, in x"""


@dataclass(frozen=True)
class Faults:
    """Everything that shall go wrong. Probabilities are for each packet, independent of one another."""

    occlusions: tuple[Occlusion, ...] = ()
    jumps: tuple[Jump, ...] = ()
    freezes: tuple[Freeze, ...] = ()
    silences: tuple[During, ...] = ()
    """the server counts on, but sends nothing"""
    replays: tuple[Replay, ...] = ()
    strays: tuple[During, ...] = ()
    """a server left over from an earlier session sends as well: its own count, the marker where it was then"""
    lost: float = 0.0
    doubled: float = 0.0
    reordered: float = 0.0
    """overtaken by the next one or two"""
    torn: float = 0.0
    """a datagram loses its tail; a stream's packet arrives in two pieces, whole"""
    garbled: float = 0.0
    """a few bytes are damaged"""


@dataclass(frozen=True, slots=True)
class BytesOnTheWay:
    """Bytes on their way to the host."""

    due: float
    """s by the host's clock"""
    data: bytes


class Damage:
    """Does to each packet what `Faults` says. It counts what it did, so that a test can compare."""

    def __init__(self, faults: Faults, rng: np.random.Generator, *, period: float, is_stream: bool) -> None:
        # A byte stream keeps its order, whatever happens.
        overtaken = 0.0 if is_stream else faults.reordered
        self._chances = np.array([faults.lost, faults.doubled, overtaken, faults.torn, faults.garbled])
        self._rng = rng
        self._period = period
        self._is_stream = is_stream
        self.done: Counter[str] = Counter()

    def apply(self, due: float, packet: bytes) -> list[BytesOnTheWay]:
        """What arrives of a packet that would arrive at `due` (host s)."""
        if not self._chances.any():
            return [BytesOnTheWay(due, packet)]
        lost, doubled, overtaken, torn, garbled = (self._rng.random(5) < self._chances).tolist()
        if lost:
            self.done["lost"] += 1
            return []
        if garbled:
            self.done["garbled"] += 1
            packet = self._garble(packet)
        if overtaken:
            self.done["reordered"] += 1
            due += self._period * float(self._rng.uniform(1.1, 2.4))
        if torn:
            self.done["torn"] += 1
            cut = int(self._rng.integers(1, len(packet)))
            head, tail = BytesOnTheWay(due, packet[:cut]), BytesOnTheWay(due, packet[cut:])
            return [head, tail] if self._is_stream else [head]
        if doubled:
            self.done["doubled"] += 1
            return [BytesOnTheWay(due, packet), BytesOnTheWay(due + 0.1 * self._period, packet)]
        return [BytesOnTheWay(due, packet)]

    def _garble(self, packet: bytes) -> bytes:
        damaged = bytearray(packet)
        for at in self._rng.integers(0, len(packet), 3):
            damaged[int(at)] ^= int(self._rng.integers(1, 256))
        return bytes(damaged)
