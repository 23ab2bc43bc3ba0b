"""Disk errors as sentences, and fsync."""

import os
from pathlib import Path

from drivers.ports import Disk
from fidim_lab.errors import HardwareError


def disk_error(path: Path, error: OSError) -> HardwareError:
    """The sentence for a disk that does not take what is written."""
    return HardwareError(
        f"{path}: cannot be written: {error.strerror or error}.",
        hint="What was recorded so far is kept. Free some space (or check the permissions) and run again.",
    )


def sync(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


async def settled(disk: Disk) -> None:
    """Wait until all that was given to the disk is there. Raises HardwareError where any of it is not."""
    await disk.do(lambda: None)
    if disk.error is not None:
        raise HardwareError(disk.error)
