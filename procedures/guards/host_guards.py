"""Guards of the host: control loop late, disk nearly full, clock stepped.

Each is told time and disk by callables, so that a test or a simulation decides what they are.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

from drivers.ports import Disk
from fidim_lab.errors import HardwareError
from procedures.guards.guard import HOST_LOOP, Guard, Observation, Reacting
from procedures.settings import GuardSettings, Reaction

SPARE_BACK = 1.2
"""times the threshold at which a violation is forgotten"""
DISK_PERIOD = 5.0
"""s between two looks at the disk"""
STEP = 1.0
"""s by which the time of day may depart from the monotonic clock between two looks, NTP's slewing allowed"""
STEP_PERIOD = 1.0


class LoopGuard:
    """The host's control loop ran late: commands and samples are older than they should be."""

    name = HOST_LOOP
    reaction = Reaction.HOLD

    def __init__(self, allowed: float) -> None:
        self._allowed = allowed
        self._before: float | None = None

    def look(self, seen: Observation) -> str | None:
        """Whether too much time has passed since the last look."""
        before, self._before = self._before, seen.t
        late = 0.0 if before is None else seen.t - before
        if late <= self._allowed:
            return None
        return f"this computer stood still for {late:.2f} s, {self._allowed:g} s is allowed; check what else runs on it"


class DiskGuard:
    """The disk is nearly full: better held now than a window torn later."""

    name = "disk"
    reaction = Reaction.HOLD

    def __init__(self, folder: Path, spare: float, disk: Disk, free: Callable[[Path], float] | None = None) -> None:
        """disk: asks, for a share that is gone does not answer."""
        self._folder = folder
        self._spare = spare
        self._free = free or _free
        self._disk = disk
        self._next = 0.0
        self._low: float | None = None

    def look(self, seen: Observation) -> str | None:
        """Whether there is too little space."""
        if seen.t >= self._next:
            self._next = seen.t + DISK_PERIOD
            self._disk.put(self._ask)
        if self._low is None:
            return None
        return f"{self._folder} has {self._low / 1e6:.0f} MB free, {self._spare / 1e6:.0f} MB are required"

    def _ask(self) -> None:
        free = self._free(self._folder)
        self._low = free if free < self._spare * (1.0 if self._low is None else SPARE_BACK) else None


class ClockStepGuard:
    """The computer's clock was set: no control depends on it, but comparisons with other computers' logs do."""

    name = "clock step"
    reaction = Reaction.WARN

    def __init__(self, wall: Callable[[], float], allowed: float = STEP) -> None:
        """wall: s since the epoch."""
        self._wall = wall
        self._allowed = allowed
        self._offset: float | None = None
        self._next = 0.0

    def look(self, seen: Observation) -> str | None:
        """Whether it was set since the last look; told once."""
        if seen.t < self._next:
            return None
        self._next = seen.t + STEP_PERIOD
        offset = self._wall() - seen.t
        before, self._offset = self._offset, offset
        if before is None or abs(offset - before) <= self._allowed:
            return None
        return f"the computer's time of day was changed by {offset - before:+.1f} s during the run"


def require_space(
    folder: Path, seconds: float, rate: float, settings: GuardSettings, free: Callable[[Path], float] | None = None
) -> None:
    """Raise HardwareError where a run of so many s, at `rate` bytes/s, would come to use what is to be spared.

    Before anything has power: a disk that is full then would stop the robot on its way. Not where the guard only warns.
    """
    if settings.reactions.get(DiskGuard.name) is Reaction.WARN:
        return
    there = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())
    size, found = seconds * rate, (free or _free)(there)
    if found < settings.disk_spare + size:
        spare = settings.disk_spare / 1e6
        raise HardwareError(
            f"{folder} has {found / 1e6:.0f} MB free; {size / 1e6 + spare:.0f} MB are required: {size / 1e6:.0f} MB "
            f"for a run of {seconds / 60.0:.0f} min and {spare:.0f} MB to spare.",
            hint="Nothing was moved. Free some space, or write to another disk (--out).",
        )


def _free(folder: Path) -> float:
    try:
        return float(shutil.disk_usage(folder).free)
    except OSError:
        return float("inf")  # the recorder says better what is wrong with it


def host_guards(folder: Path, settings: GuardSettings, wall: Callable[[], float], disk: Disk) -> tuple[Guard, ...]:
    """A fresh set for one run into a folder, reacting as the settings say."""
    guards = (LoopGuard(settings.loop_late), DiskGuard(folder, settings.disk_spare, disk), ClockStepGuard(wall))
    return tuple(Reacting.by(settings, guard) for guard in guards)
