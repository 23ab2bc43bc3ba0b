"""Recording windows: rows by frame number, on the disk ten times a second, whatever happens.

A window is written to `windows/ID.csv.part`, and with all else that was seen to `windows/ID.mcap.part`; accepted, they
lose the `.part`; rejected, they become `rejected/ID-attemptK.csv` and `.mcap`; broken off, the MCAP file keeps its
`.part` there: it has no end. Rows are t = (frame − first)/rate; a lost frame is a blank row, so nothing is spliced.
"""

import asyncio
import math
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drivers.disk import InlineDisk
from drivers.ports import Clock, Disk, Gauge, MarkerFrame, MarkerSource, Winch, WinchSample
from fidim_lab.data.window_csv import header, row
from fidim_lab.errors import HardwareError, OurBugError
from procedures.events import Event
from procedures.recording.disk import disk_error
from procedures.recording.part_file import PART, PartFile, WriteBytes, close_quietly, keep_unfinished
from procedures.recording.rows import Rows
from procedures.recording.window_log import WindowLog
from procedures.timing import POLL

FLUSH_PERIOD = 0.08
"""s between two flushes: with the time of a look (POLL) less than a tenth of a second"""
GRACE = 0.5
"""s that a recording waits for its last frames"""
MOVES = 0.01
"""m/s; what a drive tells of a motor at rest is less"""
AHEAD = 0.05
"""s; older samples are not carried on any farther"""


@dataclass(frozen=True, eq=False)
class _Open:
    """The files of the window at hand."""

    window: str
    attempt: int
    csv: PartFile
    log: WindowLog


@dataclass(frozen=True, eq=False)
class WindowRecording:
    """One window as it was recorded; NaN where nothing was there."""

    window: str
    attempt: int
    rate: float
    """Hz"""
    markers: np.ndarray
    """(N, M, 3) m"""
    lengths: np.ndarray
    """(N, n) m"""
    currents: np.ndarray
    """(N, n) A"""
    counters: dict[str, int]
    """what motion capture counted meanwhile: frames received, lost, late, doubled, malformed"""
    arrivals: np.ndarray
    """(N,) monotonic s at which the frame of each row came"""
    further: dict[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    """(N,) of each column of the gauges"""


class Recorder:
    """Records one window at a time into a run folder.

    What the disk does not take meanwhile is `Disk.error`, which a guard looks at; what ends a window raises
    HardwareError.
    """

    def __init__(
        self,
        folder: Path,
        clock: Clock,
        source: MarkerSource,
        winches: Sequence[Winch],
        markers: int,
        sample_age: float,
        write: WriteBytes = os.write,
        newton_per_ampere: Sequence[float] | None = None,
        gauges: Sequence[Gauge] = (),
        disk: Disk | None = None,
    ) -> None:
        """`gauges`: their columns follow those that the format names."""
        self._disk = InlineDisk() if disk is None else disk
        self._gauges = tuple(gauges)
        self._further = [column for gauge in self._gauges for column in gauge.columns]
        self._folder = folder
        self._clock = clock
        self._source = source
        self._winches = winches
        self._markers = markers
        self._sample_age = sample_age
        self._write = write
        self._factors = tuple(newton_per_ampere or [math.nan] * len(winches))
        self._open: _Open | None = None
        self._last: WindowRecording | None = None
        self._arrivals: dict[int, float] = {}
        """of the frames of the window at hand, by row"""

    async def record(
        self, window: str, attempt: int, duration: float, progress: Callable[[float], None]
    ) -> WindowRecording:
        """Record `duration` seconds (N = duration · rate + 1 rows). The file stays open to accept, reject, abandon.

        What an earlier process left of this window is moved to `rejected/` first.
        """
        names = header(len(self._winches), self._markers, further=self._further)
        rows = Rows(self._source.rate, round(duration * self._source.rate) + 1, len(names))
        before = self._source.counters()
        self._arrivals = {}
        self._disk.put(lambda: keep_unfinished(self._folder, window))
        files = self._open_files(window, attempt, duration)
        files.csv.add(f"{','.join(names)}\n".encode())
        reader = asyncio.ensure_future(self._read(rows, files, names))
        try:
            await self._until_complete(rows, files, reader, duration, progress)
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)
        self._add(files, names, rows, rows.rest(), None)
        files.csv.flush()
        files.log.flush()
        await self._disk.do(lambda: _finish(files))  # 50 ms and more, of ten seconds
        after = self._source.counters()
        counted = {name: count - before.get(name, 0) for name, count in after.items()}
        self._last = self._recording(window, attempt, rows.array(), counted)
        return self._last

    def last(self, window: str, attempt: int) -> WindowRecording:
        """The recording just made. Raises OurBugError when it is another."""
        if self._last is None or (self._last.window, self._last.attempt) != (window, attempt):
            raise OurBugError(f"Recorder: attempt {attempt} of window {window} is not the one recorded last.")
        return self._last

    async def accept(self, window: str) -> Path:
        """Make the window just recorded a part of the campaign; returns its CSV file."""
        return await self._seal(self._folder / "windows" / f"{window}.csv")

    async def put_beside(self, window: str, folder: str) -> Path:
        """Keep what was recorded last in a folder of its own (made here): it is no free motion. Returns the file."""
        return await self._seal(self._folder / folder / f"{window}.csv")

    async def reject(self, window: str, attempt: int) -> Path:
        """Keep the window just recorded aside; returns its CSV file."""
        return await self._seal(self._folder / "rejected" / f"{window}-attempt{attempt}.csv")

    async def abandon(self) -> Path | None:
        """Keep what an interrupted recording has written; returns its file, None where there is none. Never raises."""
        files, self._open = self._open, None
        if files is None:
            return None
        files.csv.flush()
        files.log.flush()
        to = self._folder / "rejected" / f"{files.window}-attempt{files.attempt}.csv"

        def keep() -> None:  # what the disk did take
            for file, name in ((files.log.file, to.with_suffix(f".mcap{PART}")), (files.csv, to)):
                close_quietly(file)
                with suppress(HardwareError):
                    file.seal(name)

        with suppress(HardwareError):
            await self._disk.do(keep)
        return files.csv.path

    def on_event(self, event: Event) -> None:
        """A listener of the run: what is told while a window is open goes into its file."""
        if self._open is not None:
            self._open.log.event(event)

    def _open_files(self, window: str, attempt: int, duration: float) -> _Open:
        csv = self._folder / "windows" / f"{window}.csv"
        about = {
            "window": window,
            "attempt": str(attempt),
            "sample_rate": f"{self._source.rate:g}",
            "duration": f"{duration:g}",
            "winches": ", ".join(winch.name for winch in self._winches),
        }
        file = PartFile(csv, self._disk, self._write, unit=b"\n")
        log = WindowLog(
            csv.with_suffix(".mcap"), about, self._factors, self._source.rate, self._disk, self._write, self._further
        )
        self._open = _Open(window, attempt, file, log)
        return self._open

    async def _until_complete(
        self,
        rows: Rows,
        files: _Open,
        reader: "asyncio.Future[None]",
        duration: float,
        progress: Callable[[float], None],
    ) -> None:
        begin = flushed = self._clock.now()
        while not rows.complete:
            now = self._clock.now()
            if now - begin > duration + GRACE:
                return
            if reader.done():
                reader.result()
                return
            if now - flushed >= FLUSH_PERIOD:
                files.csv.flush()
                files.log.flush()
                flushed = now
            files.log.winches(now, self._samples())
            progress((now - begin) / duration)
            await self._clock.sleep(POLL)

    async def _read(self, rows: Rows, files: _Open, names: Sequence[str]) -> None:
        frames = self._source.frames()
        try:
            async for frame in frames:
                samples = self._samples()
                files.log.winches(self._clock.now(), samples)
                new = rows.take(frame, self._values(frame, samples))
                if rows.index(frame) in new:
                    self._arrivals[rows.index(frame)] = frame.t
                self._add(files, names, rows, new, frame)
                if rows.complete:
                    return
        finally:
            close = getattr(frames, "aclose", None)
            if close is not None:
                await close()

    def _add(self, files: _Open, names: Sequence[str], rows: Rows, which: range, frame: MarkerFrame | None) -> None:
        """Write rows to both files; at most the last of them is the frame's, the others are blank."""
        now = self._clock.now()
        own = -1 if frame is None else rows.index(frame)
        for index in which:
            values = rows.row(index).tolist()
            files.csv.add(f"{row(names, values)}\n".encode())
            files.log.row(now, index, values, frame if index == own else None, self._markers)

    def _samples(self) -> list[WinchSample | None]:
        return [winch.latest() for winch in self._winches]

    def _values(self, frame: MarkerFrame, samples: Sequence[WinchSample | None]) -> list[float]:
        """Positions, then lengths and currents as the winches hold them; NaN where unknown."""
        places = [*frame.positions, *[None] * self._markers][: self._markers]
        values = [v for place in places for v in (place or (np.nan, np.nan, np.nan))]
        now = self._clock.now()
        fresh = [s if s is not None and now - s.t <= self._sample_age else None for s in samples]
        values += [np.nan if s is None else length_at(s, frame.t) for s in fresh]
        values += [np.nan if s is None else s.current for s in fresh]
        return values + [value for gauge in self._gauges for value in _told(gauge, now)]

    def _recording(self, window: str, attempt: int, table: np.ndarray, counters: dict[str, int]) -> WindowRecording:
        n, coordinates = len(self._winches), 3 * self._markers
        return WindowRecording(
            window=window,
            attempt=attempt,
            rate=self._source.rate,
            markers=table[:, 1 : 1 + coordinates].reshape(len(table), self._markers, 3),
            lengths=table[:, 1 + coordinates : 1 + coordinates + n],
            currents=table[:, 1 + coordinates + n : 1 + coordinates + 2 * n],
            counters=counters,
            arrivals=np.array([self._arrivals.get(row, math.nan) for row in range(len(table))]),
            further=dict(zip(self._further, table[:, 1 + coordinates + 2 * n :].T, strict=True)),
        )

    async def _seal(self, to: Path) -> Path:
        """The log first: a window counts as recorded once its CSV file is in place."""
        files = self._open
        if files is None:
            raise OurBugError(f"Recorder: there is no recording to become {to.name}.")
        files.csv.flush()  # still open where a pause broke the recording off
        files.log.finish()

        def seal() -> Path:
            try:
                to.parent.mkdir(exist_ok=True)
            except OSError as error:
                raise disk_error(to.parent, error) from error
            _finish(files)
            files.log.file.seal(to.with_suffix(".mcap"))
            return files.csv.seal(to)

        await self._disk.do(seal)
        self._open = None
        return to


def _finish(files: _Open) -> None:
    """A job: all rows are on the disk, or this raises."""
    files.csv.require_whole()
    files.log.file.require_whole()
    files.csv.close()


def length_at(sample: WinchSample, t: float) -> float:
    """The cable length (m) at t (monotonic s), by the newest sample before.

    That is up to a bus cycle old, and by how much is another in every session. So a moving winch is carried on with its
    velocity: off by a dt²/2 while it gets faster, by as much the other way while it slows down.
    """
    if sample.target_reached or abs(sample.velocity) < MOVES:
        return sample.length
    return sample.length + sample.velocity * min(max(t - sample.t, -AHEAD), AHEAD)


def _told(gauge: Gauge, now: float) -> list[float]:
    """What a gauge told, NaN where that is too old."""
    reading = gauge.latest()
    if reading is None or now - reading.t > gauge.age:
        return [math.nan] * len(gauge.columns)
    return list(reading.values)
