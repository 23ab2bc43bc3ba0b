"""Which service to attach to: of a rig, of a run's folder, or the only one there is. Asked anew at each attempt."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.app.formats.run_spec import NAME as RUN
from fidim_lab.app.service.lock import Holder, running
from fidim_lab.app.service.place import ServicePlace, all_places, places_of
from fidim_lab.data.rigs.rig import RigFile


@dataclass(frozen=True)
class FoundService:
    """A service that listens, or why there is none."""

    socket: Path | None
    why: str = ""
    who: Holder | None = None
    """whose it is, where that was asked"""
    several: tuple[Path, ...] = ()
    """where one cannot be chosen"""


@dataclass(frozen=True)
class Finder:
    """`look` whenever a connection is wanted; at most one of the two is given, neither means the only service."""

    rig: RigFile | None = None
    folder: Path | None = None
    socket: Path | None = None
    """known already"""

    def look(self, known: Path | None = None) -> FoundService:
        """The socket to connect to now; known: chosen before, and again where several are there."""
        if self.socket is not None:
            return FoundService(self.socket)
        if self.rig is not None:
            why = f"{self.rig.path}: no service has this rig. fidim run PLAN --rig … starts one"
            return _one(places_of(self.rig), why, known)
        places = all_places()
        if self.folder is not None:
            wanted = self.folder.resolve()
            places = [place for place, who in running(places) if Path(who.folder).resolve() == wanted]
            why = f"{self.folder}: no service runs in this folder now"
            left = ". r starts it again, to continue its run" if (self.folder / RUN).is_file() else ""
            return _one(places, why + left, known)
        why = "no service is running. fidim run PLAN --rig RIG starts one; fidim ui FOLDER, then r, continues a run"
        return _one(places, why, known)


def _one(places: list[ServicePlace], otherwise: str, known: Path | None) -> FoundService:
    there = [(place.socket, who) for place, who in running(places)]
    chosen = [found for found in there if found[0] == known] or there
    if not chosen:
        return FoundService(None, otherwise)
    if len(chosen) == 1:
        return FoundService(chosen[0][0], who=chosen[0][1])
    folders = ", ".join(who.folder for _, who in chosen)
    why = f"several services are running ({folders}): start fidim ui with the folder of one"
    return FoundService(None, why, several=tuple(socket for socket, _ in chosen))
