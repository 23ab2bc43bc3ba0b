"""Who has a rig: a lock of the operating system (flock), which ends with the process that holds it, however that ended.

So a lock left by a killed service is no obstacle. The file tells who holds it; the kernel confirms it.
"""

import fcntl
import os
import stat
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from fidim_lab.app.service.place import CHOSEN, ServicePlace
from fidim_lab.errors import SetupError
from fidim_lab.say import printable

LOCKS = Path("/proc/locks")
"""the kernel's list, on Linux"""
TRIES = 1000
"""for a lock that somebody may only be looking at, which takes microseconds"""
MOST = 1 << 16
"""bytes of what a lock tells"""


@dataclass(frozen=True)
class Holder:
    """Who has a rig."""

    pid: Annotated[int, Field(ge=0)]
    """0: the kernel does not confirm it"""
    folder: str
    """of its run"""
    port: int = 0
    """on TCP; 0: none"""
    stopped: str = ""
    """the file that keeps its emergency stop"""


_HOLDER = TypeAdapter(Holder)


def holder(place: ServicePlace) -> Holder | None:
    """Who has the rig now; None where nobody does, whatever a killed service has left."""
    with _opened(place) as descriptor:
        if descriptor is None or not _is_held(descriptor):
            return None
        told = _read(descriptor)
        return replace(told, pid=_confirmed(descriptor, told.pid))


def running(places: Iterable[ServicePlace]) -> list[tuple[ServicePlace, Holder]]:
    """Those of the places at which a service holds its rig now."""
    return [(place, who) for place in places if (who := holder(place)) is not None]


def left_behind(place: ServicePlace) -> Holder | None:
    """Whose service was killed while it had this rig; None where somebody has it, or the last one ended by itself."""
    with _opened(place) as descriptor:
        if descriptor is None or _is_held(descriptor):
            return None
        told = _read(descriptor)
    return told if told.pid else None


@contextmanager
def held(place: ServicePlace, folder: Path, stopped: Path | None = None) -> Generator["Lock"]:
    """Hold the rig. Raises SetupError naming who else does. stopped: the file that keeps its emergency stop."""
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
    # Whoever cleans temporary files leaves a folder alone that is locked (systemd-tmpfiles does).
    descriptor, kept = os.open(place.lock, flags, 0o600), os.open(place.folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(kept, fcntl.LOCK_SH)
        _link_in_session(place.folder)
        if not _locked(descriptor):
            raise SetupError(in_use(_read(descriptor)))
        lock = Lock(descriptor, Holder(os.getpid(), str(folder), stopped="" if stopped is None else str(stopped)))
        lock.tell()
        yield lock
        os.ftruncate(descriptor, 0)
        place.socket.unlink(missing_ok=True)
    finally:
        os.close(descriptor)
        os.close(kept)


def _link_in_session(folder: Path) -> None:
    """Where desktops keep sockets, and scripts look for them, a link tells where these are."""
    session = os.environ.get("XDG_RUNTIME_DIR")
    if session and CHOSEN not in os.environ:
        with suppress(OSError):
            (Path(session) / "fidim").symlink_to(folder)


class Lock:
    """A rig that is held by this process."""

    def __init__(self, descriptor: int, who: Holder) -> None:
        self._descriptor = descriptor
        self._who = who

    def tell(self, port: int = 0) -> None:
        """Write down who holds it."""
        os.ftruncate(self._descriptor, 0)
        os.pwrite(self._descriptor, _HOLDER.dump_json(replace(self._who, port=port)), 0)


def in_use(who: Holder) -> str:
    """A sentence."""
    return (
        f"Another service has this rig: process {who.pid or '(not known)'}, run {printable(who.folder)}. "
        "Attach another client to it, stop it (fidim stop), or end it where its run has ended (fidim shutdown)."
    )


@contextmanager
def _opened(place: ServicePlace) -> Generator[int | None]:
    """The lock file, where there is one that its folder's user has made."""
    descriptor = None
    with suppress(FileNotFoundError, OSError):
        descriptor = os.open(place.lock, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    if descriptor is None:
        yield None
        return
    try:
        found = os.fstat(descriptor)
        ours = stat.S_ISREG(found.st_mode) and found.st_uid == place.folder.stat().st_uid
        yield descriptor if ours else None
    finally:
        os.close(descriptor)


def _is_held(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return False


def _locked(descriptor: int) -> bool:
    """Whether the lock is ours now; who only looks (`_is_held`) is waited for."""
    for _ in range(TRIES):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.sched_yield()
        else:
            return True
    return False


def _confirmed(descriptor: int, told: int) -> int:
    """The process that holds the lock, by the kernel's own list; 0 where that is not known.

    What the file tells is believed only where there is no such list. Process 0 would be the caller's own group, 1 init.
    """
    try:
        lines = LOCKS.read_text(encoding="ascii").splitlines()
    except OSError:
        return told if told > 1 else 0
    inode = str(os.fstat(descriptor).st_ino)
    rows = [line.split() for line in lines]
    holders = {int(r[4]) for r in rows if r[1] == "FLOCK" and r[3] == "WRITE" and r[5].rpartition(":")[2] == inode}
    holders = {pid for pid in holders if pid > 1}
    if told in holders:
        return told
    return holders.pop() if len(holders) == 1 else 0


def _read(descriptor: int) -> Holder:
    try:
        return _HOLDER.validate_json(os.pread(descriptor, MOST, 0))
    except (OSError, ValidationError):
        return Holder(0, "(not known yet)")
