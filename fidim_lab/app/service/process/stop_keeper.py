"""The emergency stop of a service beyond its end: a file, written beside the control loop."""

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fidim_lab.app.service.kept_stop import forget, keep, kept
from fidim_lab.data.rigs.stop_file import Stopped
from fidim_lab.errors import HardwareError, SetupError


class StopKeeper:
    """`Keeper` in a file. The drives have been stopped when it is told; a slow disk keeps nothing waiting."""

    def __init__(self, path: Path, says: Callable[[str], object]) -> None:
        """says: told, from another thread, that the file could not be written, and where the stop is instead."""
        self._path = path
        self._says = says
        self._writing: threading.Thread | None = None

    def kept(self) -> Stopped | None:
        """The stop that is kept."""
        return kept(self._path)

    def keep(self, stopped: Stopped) -> None:
        """Begin to write it; the process does not end before that has ended."""
        self._writing = threading.Thread(target=self._write, args=(stopped,), name="emergency stop")
        self._writing.start()

    def forget(self) -> str:
        """Remove the file; the robot stands, so the disk may be waited for."""
        if self._writing is not None:
            self._writing.join()
        try:
            forget(self._path)
        except SetupError as error:
            return error.message
        return ""

    def _write(self, stopped: Stopped) -> None:
        try:
            says = keep(self._path, stopped)
        except HardwareError as error:
            says = f"the emergency stop is latched in this service only: {error.message}"
        if says:
            with suppress(RuntimeError):  # the loop is closed
                self._says(says)
