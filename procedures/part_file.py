"""A file while it is written: `NAME.part` until it is finished, and whole units only, even when the disk is full."""

import asyncio
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fidim_lab.errors import HardwareError
from procedures.disk import disk_error, sync

WriteBytes = Callable[[int, bytes], int]
"""as `os.write`"""
PART = ".part"


class PartFile:
    """Every method raises HardwareError, naming the file, when the disk fails."""

    def __init__(self, final: Path, write: WriteBytes = os.write, *, unit: bytes = b"") -> None:
        """`final`: the name without `.part`; `unit` ends what must be whole: a line that does not fit is taken back."""
        self.path = final.with_name(final.name + PART)
        self._write = write
        self._unit = unit
        self._waiting: list[bytes] = []
        self._size = 0
        self.failed = False
        """whether the disk has refused anything"""
        try:
            self._descriptor: int | None = os.open(self.path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o666)
        except OSError as error:
            raise disk_error(self.path, error) from error

    def add(self, data: bytes) -> None:
        """Take some bytes; they are on their way to the disk after the next flush."""
        self._waiting.append(data)

    def flush(self) -> None:
        """Hand everything to the operating system: from then on it survives this process."""
        if self._descriptor is None:
            return
        block = b"".join(self._waiting)
        self._waiting.clear()
        written = 0
        try:
            while written < len(block):
                written += self._write(self._descriptor, block[written:])
        except OSError as error:
            self.failed = True
            kept = block.rfind(self._unit, 0, written) + len(self._unit) if self._unit else written
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size + kept)
            raise disk_error(self.path, error) from error
        self._size += written

    def sync(self) -> None:
        """Flush, and bring it to the disk: from then on it survives a power cut."""
        self.flush()
        if self._descriptor is None:
            return
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            self.failed = True
            raise disk_error(self.path, error) from error

    async def sync_beside(self) -> None:
        """As `sync`, but a slow disk is waited for in a thread: who holds a robot goes on meanwhile."""
        self.flush()
        if self._descriptor is None:
            return
        own = os.dup(self._descriptor)  # closed by the thread: a run that is stopped meanwhile closes the file's
        try:
            await asyncio.get_running_loop().run_in_executor(None, _sync_and_close, own)
        except OSError as error:
            self.failed = True
            raise disk_error(self.path, error) from error

    def close(self) -> None:
        """Flush, bring to the disk, close; may be called twice."""
        descriptor = self._descriptor
        if descriptor is None:
            return
        try:
            self.sync()
        finally:
            self._descriptor = None
            os.close(descriptor)

    def move(self, to: Path) -> Path:
        """Give the closed file its last name, on the disk when this returns."""
        try:
            self.path.replace(to)
            self.path = to  # that is where it is, even if the next line fails
            sync(to.parent)
        except OSError as error:
            raise disk_error(to, error) from error
        return to


def _sync_and_close(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def keep_unfinished(folder: Path, window: str = "*") -> tuple[Path, ...]:
    """Move what a killed process or a power cut left of open windows to `rejected/`; returns where it is now.

    `windows/ID.csv.part` becomes `rejected/ID-unfinishedK.csv.part`, K the first free number: nothing is overwritten.
    Raises HardwareError when the disk fails.
    """
    kept: list[Path] = []
    for part in sorted((folder / "windows").glob(f"{window}.*{PART}")):
        name, _, kind = part.name.removesuffix(PART).rpartition(".")
        number = 1
        while (to := folder / "rejected" / f"{name}-unfinished{number}.{kind}{PART}").exists():
            number += 1
        try:
            to.parent.mkdir(exist_ok=True)
            kept.append(part.replace(to))
        except OSError as error:
            raise disk_error(part, error) from error
    return tuple(kept)


def close_quietly(file: PartFile) -> None:
    """Close what an interruption left open; what the disk did take is kept."""
    with suppress(HardwareError):
        file.close()
