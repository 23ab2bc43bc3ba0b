"""A file during writing: `NAME.part` until it is finished, with whole units only, even when the disk is full."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from drivers.ports import Disk
from fidim_lab.errors import HardwareError
from procedures.recording.disk import disk_error, sync

WriteBytes = Callable[[int, bytes], int]
"""as `os.write`"""
PART = ".part"


class PartFile:
    """`add` and `flush` are the control loop's and never wait; `seal` and `close` are jobs for the disk.

    The file is made by the disk's first job. Where the disk fails, the error is `Disk.error`, or the job's; it names
    the file. After a failure nothing more is written: what is there has no hole.
    """

    def __init__(self, final: Path, disk: Disk, write: WriteBytes, *, unit: bytes = b"") -> None:
        """`final`: the name without `.part`; `unit` ends what must be whole: a line that does not fit is taken back."""
        self.path = final.with_name(final.name + PART)
        self._disk = disk
        self._write_bytes = write
        self._unit = unit
        self._waiting: list[bytes] = []
        self._size = 0
        self._descriptor: int | None = None
        self._problem: HardwareError | None = None
        self._disk.put(self._make)

    def add(self, data: bytes) -> None:
        """Take some bytes; they are on their way to the disk after the next flush."""
        self._waiting.append(data)

    def flush(self) -> None:
        """Hand everything to the disk's writer, and so to the system: it then survives this process."""
        block = b"".join(self._waiting)
        self._waiting.clear()
        if block:
            self._disk.put(lambda: self._write(block), len(block))

    def require_whole(self) -> None:
        """A job. Raises HardwareError where the disk has refused anything that was flushed."""
        if self._problem is not None:
            raise self._problem

    def close(self) -> None:
        """Bring to the disk what was flushed, close; may be called twice. A job. Raises HardwareError."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is None:
            return
        try:
            os.fsync(descriptor)
        except OSError as error:
            raise disk_error(self.path, error) from error
        finally:
            os.close(descriptor)

    def seal(self, to: Path) -> Path:
        """Close, and give the file its last name, on the disk when this returns. A job. Raises HardwareError."""
        self.close()
        try:
            self.path.replace(to)
            self.path = to  # that is where it is, even if the next line fails
            sync(to.parent)
        except OSError as error:
            raise disk_error(to, error) from error
        return to

    def _make(self) -> None:
        try:
            self._descriptor = os.open(self.path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o666)
        except OSError as error:
            self._problem = disk_error(self.path, error)
            raise self._problem from error

    def _write(self, block: bytes) -> None:
        if self._descriptor is None or self._problem is not None:
            return
        written = 0
        try:
            while written < len(block):
                written += self._write_bytes(self._descriptor, block[written:])
        except OSError as error:
            self._problem = disk_error(self.path, error)
            kept = block.rfind(self._unit, 0, written) + len(self._unit) if self._unit else written
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size + kept)
            raise self._problem from error
        self._size += written


def keep_unfinished(folder: Path, window: str = "*") -> tuple[Path, ...]:
    """Move what a killed process or a power cut left of open windows to `rejected/`; returns where it is now.

    `windows/ID.csv.part` becomes `rejected/ID-unfinishedK.csv.part`, K the first free number: nothing is overwritten.
    A job for the disk. Raises HardwareError when the disk fails.
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
