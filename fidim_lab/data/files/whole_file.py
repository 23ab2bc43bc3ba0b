"""Small files that are written whole or not at all: what a rig was told is never half there after a power cut."""

import contextlib
import os
from pathlib import Path

from fidim_lab.errors import HardwareError


def put_whole(path: Path, text: str) -> None:
    """Write the text beside, bring it to the disk, then put it in its place.

    Raises OSError where the disk does not take it; the file is then as it was.
    """
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def write_whole(path: Path, text: str) -> Path:
    """As `put_whole`, of what a rig was told. Raises HardwareError where the disk does not take it."""
    try:
        put_whole(path, text)
    except OSError as error:
        raise HardwareError(f"{path}: cannot be written: {error.strerror or error}.") from error
    return path
