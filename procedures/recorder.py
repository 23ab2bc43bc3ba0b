"""Recording windows: rows by frame number, on the disk ten times a second, kept whatever happens.

A window is written to `windows/ID.csv.part`; accepted, it becomes `windows/ID.csv`, and rejected or broken off,
`rejected/ID-attemptK.csv`. Rows are t = (frame − first)/rate; a lost frame is a blank row, so nothing is ever spliced.
"""

import asyncio
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.ports import Clock, MarkerFrame, MarkerSource, Winch
from fidim_lab.data.window_csv import header, row
from fidim_lab.errors import HardwareError, OurBugError
from procedures.disk import disk_error, sync
from procedures.timing import POLL

FLUSH_PERIOD = 0.09
"""s between two flushes: ten times a second and a little more"""
GRACE = 0.5
"""s that a recording waits for its last frames"""

WriteBytes = Callable[[int, bytes], int]
"""as `os.write`"""


@dataclass(frozen=True, eq=False)
class Recording:
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


class Recorder:
    """Records one window at a time into a run folder. Every method raises HardwareError when the disk fails."""

    def __init__(
        self,
        folder: Path,
        clock: Clock,
        source: MarkerSource,
        winches: Sequence[Winch],
        markers: int,
        sample_age: float,
        write: WriteBytes = os.write,
    ) -> None:
        self._folder = folder
        self._clock = clock
        self._source = source
        self._winches = winches
        self._markers = markers
        self._sample_age = sample_age
        self._write = write
        self._file: _PartFile | None = None
        self._last: Recording | None = None

    async def record(self, window: str, attempt: int, duration: float, progress: Callable[[float], None]) -> Recording:
        """Record `duration` seconds (N = duration · rate + 1 rows). The file stays open to accept, reject, abandon."""
        names = header(len(self._winches), self._markers)
        rows = _Rows(self._source.rate, round(duration * self._source.rate) + 1, len(names))
        before = self._source.counters()
        self._file = file = _PartFile(self._folder, window, attempt, self._write)
        file.add(",".join(names))
        reader = asyncio.ensure_future(self._read(rows, file, names))
        try:
            await self._until_complete(rows, file, reader, duration, progress)
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)
        for values in rows.rest():
            file.add(row(names, values))
        file.close()
        after = self._source.counters()
        counted = {name: count - before.get(name, 0) for name, count in after.items()}
        self._last = self._recording(window, attempt, rows.array(), counted)
        return self._last

    def last(self, window: str, attempt: int) -> Recording:
        """The recording just made. Raises OurBugError when it is another."""
        if self._last is None or (self._last.window, self._last.attempt) != (window, attempt):
            raise OurBugError(f"Recorder: attempt {attempt} of window {window} is not the one recorded last.")
        return self._last

    def accept(self, window: str) -> Path:
        """Make the window just recorded a part of the campaign; returns its file."""
        return self._move(self._folder / "windows" / f"{window}.csv")

    def reject(self, window: str, attempt: int) -> Path:
        """Keep the window just recorded aside; returns its file."""
        return self._move(self._folder / "rejected" / f"{window}-attempt{attempt}.csv")

    def abandon(self) -> Path | None:
        """Keep what an interrupted recording has written; returns its file, None where there is none. Never raises."""
        file = self._file
        if file is None:
            return None
        with suppress(HardwareError):  # what the disk did take is kept
            file.close()
        try:
            return self.reject(file.window, file.attempt)
        except HardwareError:
            return file.path

    async def _until_complete(
        self,
        rows: "_Rows",
        file: "_PartFile",
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
                file.flush()
                flushed = now
            progress((now - begin) / duration)
            await self._clock.sleep(POLL)

    async def _read(self, rows: "_Rows", file: "_PartFile", names: Sequence[str]) -> None:
        frames = self._source.frames()
        try:
            async for frame in frames:
                for values in rows.take(frame, self._values(frame)):
                    file.add(row(names, values))
                if rows.complete:
                    return
        finally:
            close = getattr(frames, "aclose", None)
            if close is not None:
                await close()

    def _values(self, frame: MarkerFrame) -> list[float]:
        """Positions, then lengths and currents as the winches hold them; NaN where unknown."""
        places = [*frame.positions, *[None] * self._markers][: self._markers]
        values = [v for place in places for v in (place or (np.nan, np.nan, np.nan))]
        samples = [winch.latest() for winch in self._winches]
        now = self._clock.now()
        fresh = [s if s is not None and now - s.t <= self._sample_age else None for s in samples]
        values += [np.nan if s is None else s.length for s in fresh]
        return values + [np.nan if s is None else s.current for s in fresh]

    def _recording(self, window: str, attempt: int, table: np.ndarray, counters: dict[str, int]) -> Recording:
        n, coordinates = len(self._winches), 3 * self._markers
        return Recording(
            window=window,
            attempt=attempt,
            rate=self._source.rate,
            markers=table[:, 1 : 1 + coordinates].reshape(len(table), self._markers, 3),
            lengths=table[:, 1 + coordinates : 1 + coordinates + n],
            currents=table[:, 1 + coordinates + n :],
            counters=counters,
        )

    def _move(self, to: Path) -> Path:
        if self._file is None:
            raise OurBugError(f"Recorder: there is no recording to become {to.name}.")
        try:
            self._file.path.replace(to)
            self._file.path = to  # that is where it is, even if the next line fails
            sync(to.parent)
        except OSError as error:
            raise disk_error(to, error) from error
        self._file = None
        return to


class _Rows:
    """Rows of one window, by frame number: blank ones for lost frames, none for late or doubled ones."""

    def __init__(self, rate: float, count: int, columns: int) -> None:
        self._rate = rate
        self._table = np.full((count, columns), np.nan)
        self._table[:, 0] = np.arange(count) / rate
        self._first: int | None = None
        self._next = 0

    @property
    def complete(self) -> bool:
        """Whether every row is there, blank or not."""
        return self._next >= len(self._table)

    def take(self, frame: MarkerFrame, values: Sequence[float]) -> np.ndarray:
        """The new rows that this frame brings, itself the last; none when it is late, doubled, or past the end."""
        if self._first is None:
            self._first = frame.number
        index = frame.number - self._first
        begin = self._next
        if index < begin or self.complete:
            return self._table[:0]
        if index < len(self._table):
            self._table[index, 1:] = values
        self._next = min(index + 1, len(self._table))
        return self._table[begin : self._next]

    def rest(self) -> np.ndarray:
        """Blank rows up to the window's end."""
        begin, self._next = self._next, len(self._table)
        return self._table[begin:]

    def array(self) -> np.ndarray:
        """All rows, (N, columns)."""
        return self._table


class _PartFile:
    """`windows/ID.csv.part`: whole lines only, even when the disk is full."""

    def __init__(self, folder: Path, window: str, attempt: int, write: WriteBytes) -> None:
        self.path = folder / "windows" / f"{window}.csv.part"
        self.window = window
        self.attempt = attempt
        self._write = write
        self._lines: list[str] = []
        self._size = 0
        try:
            self._descriptor: int | None = os.open(self.path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o644)
        except OSError as error:
            raise disk_error(self.path, error) from error

    def add(self, line: str) -> None:
        """Take one line; it is on its way to the disk after the next flush."""
        self._lines.append(line)

    def flush(self) -> None:
        """Hand all lines to the operating system. A line that a full disk takes only in part is taken back."""
        if self._descriptor is None:
            return
        block = "".join(f"{line}\n" for line in self._lines).encode()
        self._lines.clear()
        written = 0
        try:
            while written < len(block):
                written += self._write(self._descriptor, block[written:])
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size + block.rfind(b"\n", 0, written) + 1)
            raise disk_error(self.path, error) from error
        self._size += written

    def close(self) -> None:
        """Flush, bring to the disk, close; may be called twice."""
        descriptor = self._descriptor
        if descriptor is None:
            return
        try:
            self.flush()
            os.fsync(descriptor)
        except OSError as error:
            raise disk_error(self.path, error) from error
        finally:
            self._descriptor = None
            os.close(descriptor)
