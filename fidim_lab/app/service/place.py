"""Where a service of a rig is found: its lock, its socket, its log, in one folder for each user of this computer.

The folder depends on the user alone, not on the session, the shell or TMPDIR: a stop from cron, ssh or sudo must find
what runs, and a service outlives the session that began it. It belongs to its user (0700), and what lies in it counts
only where it does, too. `lock` says who has a rig.
"""

import hashlib
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError

CHOSEN = "FIDIM_RUNTIME_DIR"
"""names another folder, for services that are to be apart from the user's others, as in tests"""
SHARED = Path("/tmp")
ROOT = 0
"""user id"""


@dataclass(frozen=True)
class ServicePlace:
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


def place_of(file: RigFile, *, embedded: bool, run: Path | None = None) -> ServicePlace:
    """By the bus, which only one service may have; an embedded rig by its file, or by its run, where it has none."""
    return ServicePlace(runtime_folder(), _key(file, embedded=embedded, run=run))


def places_of(file: RigFile) -> list[ServicePlace]:
    """All places where a service of this rig may be, for a stop: root also reaches those of users."""
    return [ServicePlace(folder, _key(file, embedded=embedded)) for folder in _folders() for embedded in (False, True)]


def all_places() -> list[ServicePlace]:
    """All at which this user has, or had, a service; root sees everybody's."""
    return [ServicePlace(folder, path.stem) for folder in _folders() for path in sorted(folder.glob("*.lock"))]


def places_for(rig: Path | None) -> list[ServicePlace]:
    """All places where the service of this rig file may be; without a file, all of this user. Raises FileError."""
    return all_places() if rig is None else places_of(read_rig(rig, opened=False))


def runtime_folder() -> Path:
    """The user's own folder for sockets (mode 0700). Raises SetupError where it belongs to somebody else."""
    chosen = os.environ.get(CHOSEN)
    folder = Path(chosen) if chosen else SHARED / f"fidim-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise SetupError(f"{folder}: no folder for sockets: {error.strerror}.", hint=ELSEWHERE) from error
    if not _belongs_to(folder, os.getuid()):
        what = f"{folder}: must belong to you alone (mode 0700), but another user made it or has access."
        raise SetupError(what, hint=ELSEWHERE)
    return folder


ELSEWHERE = f"Have it removed, or set {CHOSEN} to a folder of your own, in every shell that is to stop your runs."


def _folders() -> list[Path]:
    """The user's own; for root, who may stop anybody's robot, those of all users."""
    own = runtime_folder()
    if os.getuid() != ROOT or CHOSEN in os.environ:
        return [own]
    users = {path: path.name.partition("-")[2] for path in sorted(SHARED.glob("fidim-*")) if path != own}
    return [own, *(path for path, user in users.items() if user.isdecimal() and _belongs_to(path, int(user)))]


def _belongs_to(folder: Path, user: int) -> bool:
    """Whether it is a folder, no link to one, that nobody else can look into."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o077


def _key(file: RigFile, *, embedded: bool, run: Path | None = None) -> str:
    name = f"embedded {(run or file.path).resolve()}" if embedded else file.bus.name
    return hashlib.sha256(name.encode()).hexdigest()[:12]
