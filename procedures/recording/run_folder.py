"""The folder of one run: a valid campaign from the first accepted window on, with journal and rejected windows."""

import errno
import fcntl
import os
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from fidim_lab.data.campaign import INDEX, ROBOT, IndexEntry, write_index
from fidim_lab.data.plan_file import wrong_id
from fidim_lab.data.records import Robot, Role
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import SetupError
from procedures.recording.disk import disk_error, sync
from procedures.recording.journal import NAME as JOURNAL

WITHOUT_LOCKS = (errno.EBADF, errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""NFS takes locks on files opened for writing only"""
DISK_FAULTS = (errno.ENOSPC, errno.EDQUOT, errno.EIO)


class RunFolder:
    """Where a run writes. Making and adding are jobs for the disk.

    Raises SetupError where the folder holds something already, HardwareError for a full disk.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        robot: Robot,
        sample_rate: float,
        kept: Sequence[IndexEntry] | None = None,
    ) -> None:
        """kept: the folder is there, with these windows, and goes on."""
        self.path = path
        self._name = name
        self._rate = sample_rate
        self._entries: list[IndexEntry] = list(kept or ())
        if kept is not None:
            return
        require_new(path)
        try:
            for folder in ("windows", "rejected"):
                (path / folder).mkdir(parents=True)
            write_robot(path / ROBOT, robot)
            write_index(path, name, sample_rate, ())
            for made in (path / ROBOT, path / INDEX, path, path.parent):  # a run that cannot be read cannot go on
                sync(made)
        except OSError as error:
            if error.errno in DISK_FAULTS:
                raise disk_error(path, error) from error
            raise _not_made(path, error) from error

    @property
    def journal(self) -> Path:
        """The journal's file."""
        return self.path / JOURNAL

    def add(self, window: str, role: Role, equilibrium: Sequence[float]) -> None:
        """List an accepted window in campaign.toml, on the disk when this returns."""
        place = np.array(equilibrium) if len(equilibrium) == 3 else None
        entries = [*self._entries, IndexEntry(window, role, place)]
        try:
            write_index(self.path, self._name, self._rate, entries)
            sync(self.path / INDEX)
            sync(self.path)
        except OSError as error:
            raise disk_error(self.path / INDEX, error) from error
        self._entries = entries


@contextmanager
def one_writer(path: Path) -> Generator[None]:
    """Hold a run's folder, which is made where there is none, from the first look at it until all is written.

    The lock is the operating system's, on the folder itself: it leaves no file, and ends with the process. Network file
    systems that lock no folders have none. Raises SetupError while another process writes there.
    """
    made = not path.exists()
    try:
        path.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise _not_made(path, error) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            what = f"{path}: another process writes this run."
            raise SetupError(what, hint="One run folder has one writer; wait for it, or stop it.") from None
        except OSError as error:
            if error.errno not in WITHOUT_LOCKS:
                raise
        yield
    finally:
        os.close(descriptor)
        if made:
            with suppress(OSError):  # no run has begun in it
                path.rmdir()


def _not_made(path: Path, error: OSError) -> SetupError:
    what = f"{path}: the run folder cannot be made: {error.strerror or error}."
    return SetupError(what, hint="Nothing was moved. Give another folder.")


def free_folder(name: str) -> Path:
    """runs/NAME, or the first numbered one that does not exist."""
    folder, number = Path("runs") / name, 1
    while folder.exists():
        number += 1
        folder = Path("runs") / f"{name}-{number}"
    return folder


def require_new(path: Path) -> None:
    """Raises SetupError where something is there already; an empty folder may be."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise SetupError(f"{path}: the folder is not empty.", hint="Give a new folder; a run never overwrites.")


def check_window_ids(ids: Sequence[str]) -> None:
    """Windows become file names. Raises SetupError for an id that cannot, or is there twice."""
    wrong = wrong_id(ids)
    if wrong is not None:
        number, problem = wrong
        raise SetupError(f"Window {number}: the id {problem.removesuffix('.')}.")
