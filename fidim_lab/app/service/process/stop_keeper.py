"""The emergency stop of a service beyond its end: a file, written beside the control loop."""

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fidim_lab.data.rigs.stop_file import Stopped, keep_stop, read_stop
from fidim_lab.errors import HardwareError


class StopKeeper:
    """`Keeper` in a file. The drives have been stopped when it is told; a slow disk keeps nothing waiting."""

    def __init__(self, path: Path, says: Callable[[str], None]) -> None:
        """says: told, from another thread, that the file could not be written."""
        self._path = path
        self._says = says
        self._writing: threading.Thread | None = None

    def kept(self) -> Stopped | None:
        """The stop that is kept."""
        return read_stop(self._path)

    def keep(self, stopped: Stopped) -> None:
        """Begin to write it; the process does not end before that has ended."""
        self._writing = threading.Thread(target=self._write, args=(stopped,), name="emergency stop")
        self._writing.start()

    def forget(self) -> str:
        """Remove the file; the robot stands, so the disk may be waited for."""
        if self._writing is not None:
            self._writing.join()
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            return f"{self._path} cannot be removed, so the stop remains latched: {error.strerror or error}."
        return ""

    def _write(self, stopped: Stopped) -> None:
        try:
            keep_stop(self._path, stopped)
        except HardwareError as error:
            with suppress(RuntimeError):  # the loop is closed
                self._says(f"the emergency stop is latched in this service only: {error.message}")
