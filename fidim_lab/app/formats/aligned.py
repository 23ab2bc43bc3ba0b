"""Keeps how late motion capture is: beside the rig file when `align` has found it, and with every campaign after it."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path

from drivers.ports import Disk
from fidim_lab.data.records import Alignment
from fidim_lab.data.rigs.alignment_file import NAME, alignment_path, read_alignment, write_alignment
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import HardwareError, SetupError
from procedures.events import Event, StepFinished
from procedures.steps.align import Jog

PROCEDURE = "align"


def known_alignment(file: RigFile) -> Alignment | None:
    """What was measured with this rig; None where nothing was, and in a rehearsal.

    Raises FileError for a file that is none, SetupError where it was measured with another motion capture or rate.
    """
    if not file.keeps_homes:
        return None
    path = alignment_path(file.path)
    found = read_alignment(path)
    if found is None:
        return None
    mocap = file.motion_capture
    for what, then, now in (
        ("motion_capture.kind", found.source, mocap.kind.value),
        ("motion_capture.rate", found.rate, mocap.rate),
        ("bus.sync_rate", found.sync_rate, file.bus.sync_rate),
    ):
        if then != now:
            raise SetupError(
                f"{path}: measured with {what} {then}, {file.path} says {now}: the delay may be another.",
                hint="Measure it again (fidim run PLAN --rig RIG --procedure align), or delete that file.",
            )
    return found


class AlignmentKeeper:
    """A listener of `align`: writes what the jog has told into the run's folder and beside the rig file."""

    def __init__(
        self, file: RigFile, folder: Path, wall_time: Callable[[], str], tell: Callable[[str], None], disk: Disk
    ) -> None:
        """tell: told where the disk does not take it; a listener must not raise."""
        self._file = file
        self._tell = tell
        self._disk = disk
        self._writing: asyncio.Task[None] | None = None
        self._folder = folder
        self._wall_time = wall_time

    def __call__(self, event: Event) -> None:
        """Take one event of the run."""
        if not (isinstance(event, StepFinished) and isinstance(event.step, Jog) and event.result.outcome.usable):
            return
        lag, sd, correlation = event.result.values
        mocap = self._file.motion_capture
        found = Alignment(
            lag=round(lag, 7),
            sd=round(sd, 7),
            correlation=round(correlation, 6),
            at=self._wall_time(),
            source=mocap.kind.value,
            rate=mocap.rate,
            sync_rate=self._file.bus.sync_rate,
        )
        self._writing = asyncio.ensure_future(self._write(found))

    async def _write(self, found: Alignment) -> None:
        paths = [self._folder / NAME, *([alignment_path(self._file.path)] if self._file.keeps_homes else [])]
        for path in paths:
            try:
                await self._disk.do(partial(write_alignment, path, found))
            except HardwareError as error:
                self._tell(str(error))
