"""The simulated server: what it measures (`MocapServer`) and when its packets reach the host (`ServerFeed`)."""

import heapq
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from drivers.ports import Clock
from sim_backends.mocap.encoders import Encoder
from sim_backends.mocap.faults import STRAY_COUNT, STRAY_PLACE, BytesOnTheWay, Damage, Faults

Truth = Callable[[float], Sequence[Sequence[float]] | np.ndarray]
"""True marker positions (M, 3), motion-capture frame, m, at a host time in s; asked once for each frame, in order"""

REMEMBERED = 1000
"""frames that a fault can repeat"""
_ROUNDING = 1e-9
"""s; a clock that sleeps until a due time may wake this much earlier"""


@dataclass(frozen=True)
class StreamTiming:
    """When frames are taken and when they arrive."""

    rate: float = 200.0
    """frames a second by the device's own clock, Hz"""
    drift: float = 0.0
    """the device's clock against the host's: 30e-6 is a device that is 30 ppm slow"""
    latency: float = 0.0
    """s from exposure to arrival, at least"""
    jitter: float = 0.0
    """s, mean of an exponential delay on top of it"""
    spikes: float = 0.0
    """probability of a delay ten times as long"""
    first_number: int = 1

    @property
    def period(self) -> float:
        """Host s from frame to frame."""
        return (1.0 + self.drift) / self.rate


@dataclass
class MocapServer:
    """Measures markers with noise and sends one packet a frame.

    Not simulated: cameras and their geometry (noise is white, equal in all directions, the same everywhere),
    calibration and lens errors, labels that swap markers, filters in the vendor's software, exposure time and motion
    blur, rotations (each object has a constant one), congestion other than independent delays, and a server that is
    started again: start a second one for that.
    """

    truth: Truth
    encoder: Encoder
    rng: np.random.Generator
    timing: StreamTiming = field(default_factory=StreamTiming)
    noise: float = 1e-4
    """m, one standard deviation of each coordinate"""
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        # Streams of their own: a fault or a jitter changes no noise, so that runs can be compared sample by sample.
        self._noise_rng, self._delay_rng, damage_rng = self.rng.spawn(3)
        self.damage = Damage(self.faults, damage_rng, period=self.timing.period, is_stream=self.encoder.is_stream)
        self._last_due = 0.0
        self._sent: deque[tuple[int, list[tuple[float, float, float] | None]]] = deque(maxlen=REMEMBERED)
        self._frozen: dict[int, tuple[float, float, float]] = {}

    def expose(self, index: int, start: float) -> list[BytesOnTheWay]:
        """Take frame `index` (0, 1, …) of a stream that began at host time `start`: the pieces that will arrive."""
        since = index * self.timing.period
        measured = self.measure(since, start + since)
        due = self._due(start + since)
        if any(since in silence for silence in self.faults.silences):
            return []
        number = self.timing.first_number + index
        pieces = self.damage.apply(due, self._packet(since, number, measured))
        if any(since in stray for stray in self.faults.strays):
            old = [None if place is None else (place[0] + STRAY_PLACE, *place[1:]) for place in measured]
            pieces.append(BytesOnTheWay(due, self.encoder.encode(number + STRAY_COUNT, old)))
        return pieces

    def _packet(self, since: float, number: int, measured: list[tuple[float, float, float] | None]) -> bytes:
        """The newest packet, or an older one where a fault repeats it."""
        self._sent.append((number, measured))
        repeats = [replay for replay in self.faults.replays if since in replay.during]
        behind = max((replay.frames for replay in repeats), default=0)
        old, places = self._sent[max(-1 - behind, -len(self._sent))]
        return self.encoder.encode(number if any(replay.renumbered for replay in repeats) else old, places)

    def measure(self, since: float, t: float) -> list[tuple[float, float, float] | None]:
        """What is seen of each marker (m) `since` s after the first frame, at host time t."""
        true = np.asarray(self.truth(t), dtype=np.float64)
        rows = (true + self.noise * self._noise_rng.standard_normal(true.shape)).tolist()
        seen: list[tuple[float, float, float] | None] = [(x, y, z) for x, y, z in rows]
        for jump in self.faults.jumps:
            if since in jump.during and (place := seen[jump.marker]) is not None:
                dx, dy, dz = jump.offset
                seen[jump.marker] = (place[0] + dx, place[1] + dy, place[2] + dz)
        for freeze in self.faults.freezes:
            if (place := seen[freeze.marker]) is not None:
                if since in freeze.during:
                    seen[freeze.marker] = self._frozen.setdefault(freeze.marker, place)
                elif since < freeze.during.start:
                    self._frozen[freeze.marker] = place
        for occlusion in self.faults.occlusions:
            if since in occlusion.during:
                seen[occlusion.marker] = None
        return seen

    def _due(self, exposed: float) -> float:
        timing = self.timing
        due = exposed + timing.latency
        if timing.jitter > 0.0:
            factor = 10.0 if self._delay_rng.random() < timing.spikes else 1.0
            due += factor * timing.jitter * self._delay_rng.standard_exponential()
        # A network keeps order by itself; packets that overtake are a fault of their own.
        self._last_due = max(due, self._last_due)
        return self._last_due


class ServerFeed:
    """The packets of a server, each at its due time by the clock. In process it is what a driver reads.

    On a clock that jumps, the same seed gives the same bytes at the same times.
    """

    hint = "This is a simulated server: was it told to be silent?"

    def __init__(self, server: MocapServer, clock: Clock) -> None:
        self._server = server
        self._clock = clock
        self._pending: list[tuple[float, int, bytes]] = []
        self._order = 0
        self._index = 0
        self._start = 0.0
        self.connection = 0

    @property
    def name(self) -> str:
        """As in messages."""
        return "simulated motion capture"

    async def open(self) -> None:
        """The stream begins now: the first frame is taken one period from now."""
        self._start = self._clock.now() + self._server.timing.period
        self._index = 0
        self._pending.clear()
        self.connection += 1

    async def receive(self) -> tuple[float, bytes]:
        """Host s of arrival, and the bytes, at that time."""
        while True:
            exposure = self._start + self._index * self._server.timing.period
            due = self._pending[0][0] if self._pending else exposure
            event = min(due, exposure)
            if event > (now := self._clock.now()) + _ROUNDING:
                await self._clock.sleep(event - now)
            if self._pending and due <= exposure:
                due, _, data = heapq.heappop(self._pending)
                return max(due, now), data
            for piece in self._server.expose(self._index, self._start):
                heapq.heappush(self._pending, (piece.due, self._order, piece.data))
                self._order += 1
            self._index += 1

    async def close(self) -> None:
        """The stream ends."""
        self._pending.clear()
