"""Where a service of a rig is found: its lock, its socket, its log, all under the user's own runtime folder.

The lock is the operating system's (flock): it ends with the process that holds it, however that ended, so a lock left
by a killed service is no obstacle. The file tells who holds it.
"""

import fcntl
import hashlib
import json
import os
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.rig import RigFile
from fidim_lab.errors import SetupError


@dataclass(frozen=True)
class Place:
    """Files of the service of one rig."""

    folder: Path
    key: str

    @property
    def socket(self) -> Path:
        """Clients connect here."""
        return self.folder / f"{self.key}.sock"

    @property
    def lock(self) -> Path:
        """Held by the service while it lives."""
        return self.folder / f"{self.key}.lock"

    @property
    def log(self) -> Path:
        """What the service's process printed."""
        return self.folder / f"{self.key}.log"

    @property
    def token(self) -> Path:
        """What clients on TCP must know."""
        return self.folder / f"{self.key}.token"


@dataclass(frozen=True)
class Holder:
    """Who has a rig."""

    pid: int
    folder: str
    """of its run"""
    port: int = 0
    """on TCP; 0: none"""


def place_of(file: RigFile, *, embedded: bool) -> Place:
    """By the bus, which only one service may have; an embedded rig by its file."""
    name = f"embedded {file.path.resolve()}" if embedded else file.bus.name
    return Place(runtime_folder(), hashlib.sha256(name.encode()).hexdigest()[:12])


def runtime_folder() -> Path:
    """The user's own folder for sockets (mode 0700). Raises SetupError where it belongs to somebody else."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(base) / "fidim" if base else Path(tempfile.gettempdir()) / f"fidim-{os.getuid()}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.stat()
    if found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise SetupError(f"{folder}: must belong to you alone (mode 0700); somebody else made it, or opened it.")
    return folder


def holder(place: Place) -> Holder | None:
    """Who has the rig now; None where nobody does, whatever a killed service has left."""
    return _read(place.lock) if _is_held(place) else None


def left_behind(place: Place) -> Holder | None:
    """Whose service was killed while it had this rig; None where somebody has it, or the last one ended by itself."""
    told = _read(place.lock)
    return told if _is_held(place) is False and told.pid else None


def _is_held(place: Place) -> bool | None:
    """Whether a service has the rig; None where none ever had."""
    try:
        descriptor = os.open(place.lock, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


@contextmanager
def held(place: Place, folder: Path) -> Generator["Lock"]:
    """Hold the rig. Raises SetupError naming who else does."""
    descriptor = os.open(place.lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SetupError(in_use(_read(place.lock))) from None
        lock = Lock(descriptor, Holder(os.getpid(), str(folder)))
        lock.tell()
        yield lock
        os.ftruncate(descriptor, 0)
        place.socket.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


class Lock:
    """A rig that is held by this process."""

    def __init__(self, descriptor: int, who: Holder) -> None:
        self._descriptor = descriptor
        self._who = who

    def tell(self, port: int = 0) -> None:
        """Write down who holds it."""
        who = Holder(self._who.pid, self._who.folder, port)
        os.ftruncate(self._descriptor, 0)
        os.pwrite(self._descriptor, json.dumps(vars(who)).encode(), 0)


def in_use(who: Holder) -> str:
    """A sentence."""
    return (
        f"Another service has this rig: process {who.pid}, run {who.folder}. "
        "Stop it (fidim stop), or attach another client to it."
    )


def _read(path: Path) -> Holder:
    try:
        return Holder(**json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError):
        return Holder(0, "(not told yet)")
