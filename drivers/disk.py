"""The disk behind its port: `DiskThreads` for real time, `InlineDisk` where time is simulated, and in tests.

A full disk, a share that is gone and a slow fsync look the same to the control loop: it goes on, and is told.
"""

import asyncio
import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from drivers.ports import Disk
from fidim_lab.errors import FileError, HardwareError, OurBugError

T = TypeVar("T")
Job = Callable[[], object]

ROOM = 64 << 20
"""bytes that may wait: three minutes of all that a session of four winches records (350 kB/s)"""
PATIENCE = 10.0
"""s that the oldest job may take or wait. All that a killed process loses is what waits, so it is short; disks that
spin up and shares that come back take some seconds"""
_HINT = "What was recorded so far is kept. Look at the disk, or give a folder on a local one, and run again."


class InlineDisk:
    """`Disk` that does everything at once: simulated time is not spent on it, and the same run gives the same bytes."""

    def __init__(self) -> None:
        self.error: str | None = None

    def put(self, job: Job, size: int = 0) -> None:
        """Carry it out."""
        try:
            job()
        except HardwareError as error:
            self.error = self.error or str(error)

    def secure(self, job: Job) -> None:
        """Carry it out."""
        self.put(job)

    async def do(self, job: Callable[[], T], longest: float | None = None) -> T:
        """Carry it out."""
        return job()


class BlockFile:
    """A raw log's file: blocks in their order, and none after one that the disk has refused."""

    def __init__(self, path: Path, what: str, disk: Disk | None) -> None:
        """what: the log's name. disk: takes the blocks. Raises FileError where the file cannot be made."""
        self.error: str | None = None
        """why writing ended (full disk): whoever hands over blocks is never told by an exception"""
        self._wrong = f"the {what} {path} cannot be written"
        self._disk = InlineDisk() if disk is None else disk
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise FileError(path, "", f"the {what} cannot be written: {error.strerror}.") from error

    def put(self, block: bytes) -> None:
        """Append it; never waits, never raises."""
        self._disk.put(lambda: self._write(block), len(block))

    def close(self) -> None:
        """After all that was put."""
        self._disk.put(self._file.close)

    def _write(self, block: bytes) -> None:
        try:
            while block and self.error is None:
                block = block[self._file.write(block) or 0 :]
        except OSError as error:
            self.error = f"{self._wrong}: {error.strerror}"


class DiskThreads:
    """`Disk` with two threads: one writes, one brings to the disk. A context manager; in the end it waits for them.

    The threads are no obstacle to the end of the process: one that hangs in a share that is gone is left behind.
    """

    def __init__(self, room: int = ROOM, patience: float = PATIENCE) -> None:
        """room: bytes that may wait. patience: s that the oldest job may take."""
        self._room = room
        self._patience = patience
        self._failed: str | None = None
        self._writing = _Worker("disk: write", self._fail)
        self._securing = _Worker("disk: secure", self._fail)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def error(self) -> str | None:
        """As of the port. The first one stays."""
        if self._failed is None:
            late = max(self._writing.late, self._securing.late)
            if late > self._patience:
                self._fail(
                    f"The disk has not accepted data for {late:.1f} s, {self._patience:g} s are allowed. {_HINT}"
                )
        return self._failed

    def put(self, job: Job, size: int = 0) -> None:
        """As of the port. Where there is no room, nothing more is ever taken: nothing is written past a hole."""
        if self._writing.size + size > self._room:
            waits, allowed = self._writing.size / 1e6, self._room / 1e6
            self._writing.refuse()
            self._fail(f"The disk does not keep up: {waits:.0f} MB wait for it, {allowed:.0f} MB are allowed. {_HINT}")
            return
        self._writing.give(job, size)

    def secure(self, job: Job) -> None:
        """As of the port."""
        self._writing.give(lambda: self._securing.give(job))

    async def do(self, job: Callable[[], T], longest: float | None = None) -> T:
        """As of the port."""
        loop = asyncio.get_running_loop()
        waiting: asyncio.Future[T] = loop.create_future()
        patience = self._patience if longest is None else longest

        def told(answer: "Callable[[asyncio.Future[T]], None]") -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                loop.call_soon_threadsafe(lambda: None if waiting.done() else answer(waiting))

        def carry_out() -> None:
            try:
                done = job()
            except BaseException as error:  # whatever it was, the one who waits gets it
                problem = error
                told(lambda future: future.set_exception(problem))
            else:
                told(lambda future: future.set_result(done))

        if not self._writing.give(lambda: self._securing.give(carry_out)):
            raise HardwareError(self._failed or "The disk is closed.")
        await asyncio.wait({waiting}, timeout=patience)
        if not waiting.done():
            waiting.cancel()
            raise HardwareError(f"The disk has not answered for {patience:g} s.", hint=_HINT)
        return waiting.result()

    def close(self) -> None:
        """Let everything that was given be done, as long as the disk goes on; may be called twice."""
        for worker in (self._writing, self._securing):
            worker.end(self._patience)

    def _fail(self, says: str) -> None:
        self._failed = self._failed or says


class _Worker:
    """One thread and what waits for it."""

    def __init__(self, name: str, fail: Callable[[str], None]) -> None:
        self._fail = fail
        self._waiting: deque[tuple[Job, int, float]] = deque()
        self._changed = threading.Condition()
        self._open = True
        self.size = 0
        """bytes that wait"""
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    @property
    def late(self) -> float:
        """s since the oldest job that is not done was given."""
        with self._changed:
            return time.monotonic() - self._waiting[0][2] if self._waiting else 0.0

    def give(self, job: Job, size: int = 0) -> bool:
        """Whether it will be carried out."""
        with self._changed:
            if not self._open:
                return False
            self._waiting.append((job, size, time.monotonic()))
            self.size += size
            self._changed.notify()
            return True

    def refuse(self) -> None:
        """Take nothing more; what waits is still done."""
        with self._changed:
            self._open = False
            self._changed.notify()

    def end(self, patience: float) -> None:
        """Take nothing more, and wait for the last job."""
        self.refuse()
        self._thread.join(patience)

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and self._open:
                    self._changed.wait()
                if not self._waiting:
                    return
                job, size, _ = self._waiting[0]
            try:
                job()
            except HardwareError as error:
                self._fail(str(error))
            except Exception as error:  # a thread that dies in silence would leave everything unwritten
                self._fail(str(OurBugError(f"The disk's thread: {error!r}.", hint="Please report this.")))
            with self._changed:
                self._waiting.popleft()
                self.size -= size
