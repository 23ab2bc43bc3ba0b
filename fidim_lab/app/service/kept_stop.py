"""Where the emergency stop of a rig outlives its service: beside the rig file, else in the user's runtime folder.

A full disk, or a share that has gone read-only, must not undo a stop as the service ends. The second file stays until
somebody undoes the stop, or the computer restarts.
"""

import hashlib
from contextlib import suppress
from pathlib import Path

from fidim_lab.app.service.place import runtime_folder
from fidim_lab.data.rigs.stop_file import Stopped, keep_stop, read_stop
from fidim_lab.errors import HardwareError, SetupError


def kept(path: Path) -> Stopped | None:
    """The stop of the rig whose file (`stop_path`) this is; None without one. Raises SetupError (`runtime_folder`)."""
    return read_stop(path) or read_stop(_second(path))


def keep(path: Path, stopped: Stopped) -> str:
    """Keep it; returns what a person must know, empty where it is beside the rig file. Raises HardwareError."""
    try:
        keep_stop(path, stopped)
    except HardwareError as error:
        with suppress(HardwareError, SetupError):
            second = _second(path)
            keep_stop(second, stopped)
            return f"the emergency stop is kept in {second} until this computer restarts: {error.message}"
        raise
    return ""


def forget(path: Path) -> None:
    """Keep none any more. Raises SetupError where a file stays."""
    for one in (_second(path), path):
        try:
            one.unlink(missing_ok=True)
        except OSError as error:
            raise SetupError(
                f"{one}: cannot be removed, so the stop remains latched: {error.strerror or error}."
            ) from error


def _second(path: Path) -> Path:
    name = hashlib.sha256(str(path.absolute()).encode()).hexdigest()[:12]
    return runtime_folder() / f"{name}.stopped.toml"
