"""That a rig was stopped, by whom, why and when: RIG.stopped.toml beside the rig file ("fidim-stopped/1").

It outlives the service: while it is there, nothing moves before a person has undone the stop. A rehearsal of the same
rig file has one of its own, so that undoing its stop undoes no real one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tomli_w

from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.files.whole_file import write_whole
from fidim_lab.errors import FileError
from fidim_lab.say import printable

FORMAT = "fidim-stopped/1"
HEAD = "# Written by fidim: the emergency stop is latched. fidim reset undoes it, fidim resume does on its way.\n"


@dataclass(frozen=True)
class Stopped:
    """One emergency stop."""

    by: str
    """a client of the service"""
    why: str
    at: str
    """UTC, ISO 8601; empty where it is not known"""

    @property
    def sentence(self) -> str:
        """Without its full stop."""
        why = f": {self.why}" if self.why else ""
        at = f" ({self.at[:10]} {self.at[11:19]} UTC)" if self.at else ""
        return printable(f"emergency stop by {self.by}{why}{at}")


class _StoppedTable(Table):
    format: Literal["fidim-stopped/1"]
    by: str
    why: str
    at: str


def stop_path(rig: Path, *, embedded: bool) -> Path:
    """Beside the rig file, wherever links to it are."""
    return rig.resolve().with_suffix(".rehearsal-stopped.toml" if embedded else ".stopped.toml")


def read_stop(path: Path) -> Stopped | None:
    """The stop that is kept there, None without one. What cannot be read is a stop as well: only a person undoes it."""
    if not path.is_symlink() and not path.exists():
        return None
    try:
        table = read_toml(path, _StoppedTable, FORMAT)
    except FileError as error:
        return Stopped("somebody", f"{error.message} Delete it by hand where you know why", "")
    return Stopped(table.by, table.why, table.at)


def keep_stop(path: Path, stopped: Stopped) -> None:
    """Whole or not at all, on the disk when this returns. Raises HardwareError."""
    table = {"format": FORMAT, "by": stopped.by, "why": stopped.why, "at": stopped.at}
    write_whole(path, HEAD + tomli_w.dumps(table))
