"""`MarkerSource` over any feed and decoder: one task reads, decodes, sorts, and hands each frame to all readers.

    source = StreamMarkerSource(UdpFeed(clock, 51001), ViconUdpDecoder(MarkerObjects(("platform",))), clock, rate=200.0)
    await source.start()
    await source.ready(within=5.0)          # or a DeviceError that says what is missing
    async for frame in source.frames(): ...

`latest` is for guards (judge its age by `frame.t`), `frames` for recording. A silent stream, a lost connection, and a
reader that is too slow reach the readers as a DeviceError in its place among the frames; the source itself goes on, and
a reader may go on reading after it (only one that was too slow has to subscribe again).
"""

import asyncio
from collections.abc import AsyncIterator, Callable

from drivers.mocap.decoders.decoder import Decoder, Malformed
from drivers.mocap.feeds import ByteFeed
from drivers.mocap.sequence import Sequencer
from drivers.mocap.subscription import FrameBroadcast
from drivers.ports import Clock, MarkerFrame
from fidim_lab.errors import DeviceError, FidimError, HardwareError, OurBugError

QUEUE = 8192
"""frames a reader may lag behind (40 s at 200 Hz)"""
SILENCE = 1.0
"""s without a byte after which the stream is reported as silent"""


class StreamMarkerSource:
    """Marker frames from a byte feed. Frames are stamped with their arrival."""

    def __init__(
        self,
        feed: ByteFeed,
        decoder: Decoder,
        clock: Clock,
        *,
        rate: float,
        silence: float = SILENCE,
        queue: int = QUEUE,
        window: int = 4,
    ) -> None:
        """`rate` in Hz as configured at the device; `silence` in s; `queue` and reorder `window` in frames."""
        self.rate = rate
        """Frames a second, as configured, Hz."""
        self.problem = ""
        """The last thing that went wrong, in words; empty while nothing has."""
        self.decoder = decoder
        """What reads the bytes."""
        self._feed = feed
        self._taps: tuple[Callable[[float, int, bytes], None], ...] = ()
        self._clock = clock
        self._silence = silence
        self._sequencer = Sequencer(window=window, modulus=decoder.modulus)
        self._readers = FrameBroadcast(queue)
        self._tasks: tuple[asyncio.Task[None], ...] = ()
        self._latest: MarkerFrame | None = None
        self._last_arrival = 0.0
        self._malformed = self._repeated = 0

    async def start(self) -> None:
        """Open the feed and begin to read. Raises SetupError or DeviceError where it cannot be opened."""
        await self._feed.open()
        self._last_arrival = self._clock.now()
        self._tasks = (asyncio.ensure_future(self._read()), asyncio.ensure_future(self._watch()))

    async def ready(self, within: float) -> MarkerFrame:
        """The first frame from now on with the main marker. Raises DeviceError after `within` s: what is amiss."""
        start = self._clock.now()
        while True:
            frame = self._latest if self._latest is not None and self._latest.t >= start else None
            if frame is not None and frame.main is not None:
                return frame
            if self._clock.now() - start >= within:
                if frame is not None:
                    problem = f"frames arrive, but the main marker was not seen for {within:g} s."
                    raise DeviceError(self._feed.name, problem, hint=self.decoder.advice())
                if self._malformed:
                    problem = (
                        f"{self._malformed} packets arrived, none of them a frame. The last problem: {self.problem}"
                    )
                    raise DeviceError(self._feed.name, problem)
                hint = f"{_of_others(self._feed)} {self._feed.hint}".strip()
                raise DeviceError(self._feed.name, f"nothing received for {within:.1f} s.", hint=hint)
            await self._clock.sleep(1.0 / self.rate)

    async def close(self) -> None:
        """Stop reading; readers get what is left and then end. May be called twice."""
        tasks, self._tasks = self._tasks, ()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._feed.close()
        self._pass_on(self._sequencer.flush())
        self._readers.close()

    def latest(self) -> MarkerFrame | None:
        """The newest frame, None before the first; while a missing one is waited for, at most a reorder window old."""
        return self._latest

    def frames(self) -> AsyncIterator[MarkerFrame]:
        """Every frame from now on, in order of frame number; see `Subscription`."""
        return self._readers.subscribe(self._feed.name)

    def tap(self, observer: Callable[[float, int, bytes], None]) -> None:
        """Call `observer` with arrival (monotonic s), connection and bytes of all that is received (the raw log).

        It must be quick and must not raise.
        """
        self._taps = (*self._taps, observer)

    def counters(self) -> dict[str, int]:
        """How many frames were received, lost, late, doubled, malformed so far; and four more.

        resets: the device's counter began anew; repeated: the main marker is bit for bit where it was in the frame
        before, as a frozen stream has it; overflow: frames that a slow reader did not get; foreign: datagrams of
        somebody else, which were left out.
        """
        counts = self._sequencer.counts
        return {
            "received": counts.received,
            "lost": counts.lost,
            "late": counts.late,
            "doubled": counts.doubled,
            "malformed": self._malformed + counts.misnumbered,
            "resets": counts.resets,
            "repeated": self._repeated,
            "overflow": self._readers.overflow,
            "foreign": getattr(self._feed, "foreign", 0),
        }

    async def _read(self) -> None:
        connection = self._feed.connection
        try:
            while True:
                try:
                    t, data = await self._feed.receive()
                except HardwareError as error:
                    self._report(error)
                    continue
                if self._feed.connection != connection:
                    connection = self._feed.connection
                    self.decoder.restart()
                    self._pass_on(self._sequencer.restart())
                for observer in self._taps:
                    observer(t, connection, data)
                self._accept(t, data)
        except Exception as error:  # a reader that dies in silence would leave an old value standing
            self._report(OurBugError(f"{self._feed.name}: its reader stopped: {error!r}", hint="Please report this."))
            raise

    async def _watch(self) -> None:
        """Report a stream that has gone silent, again each `silence` seconds, for readers that came later."""
        wait = self._silence
        while True:
            await self._clock.sleep(wait)
            idle = self._clock.now() - self._last_arrival
            wait = self._silence - idle
            if wait <= 1e-9:  # s; the clock's own rounding
                self._pass_on(self._sequencer.flush())
                self._report(DeviceError(self._feed.name, f"nothing received for {idle:.1f} s.", hint=self._feed.hint))
                wait = self._silence

    def _accept(self, t: float, data: bytes) -> None:
        self._last_arrival = t
        for event in self.decoder.receive(data):
            if isinstance(event, Malformed):
                self._malformed += 1
                self.problem = event.problem
            else:
                self._pass_on(self._sequencer.push(MarkerFrame(t, event.number, event.positions)))

    def _pass_on(self, frames: list[MarkerFrame]) -> None:
        for frame in frames:
            previous, self._latest = self._latest, frame
            if previous is not None and frame.main is not None and frame.main == previous.main:
                self._repeated += 1
            self._readers.deliver(frame)

    def _report(self, error: FidimError) -> None:
        self.problem = str(error)
        self._readers.fail(error)


def _of_others(feed: ByteFeed) -> str:
    """What came and was left out, for whoever wonders why nothing comes."""
    count, where = getattr(feed, "foreign", 0), getattr(feed, "left_out", "")
    if not count:
        return ""
    return f"{count} datagrams of another sender were ignored, the newest from {where}: see sender in the rig file."
