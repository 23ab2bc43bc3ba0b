"""During a session: after every accepted window, does the model hold so far, and what is suspected?

    check = ModelCheck(folder, planned=12, tell=...)   # a listener of the run
    ...
    await check.close()

`mismatch.online_monitor` answers, in a niced process of its own (`model_worker`): the loop that holds the robot only
writes a line to it and reads one, and a robot that waits to be taken over does not wait until all that is imported
(over a second). Windows that come while it computes are taken in at its next look. Where it fails the run goes on
without it, and that is told.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fidim_lab.app.terminal.worker_pipe import LineWorker
from fidim_lab.mismatch.thresholds import SHARED
from procedures.events import Event, WindowFinished
from procedures.outcomes import Outcome

LINE = 1 << 20
"""bytes of an answer at most"""
LAST = 10.0
"""s at the end of a run that the last answer is waited for"""
NO_MORE = "Later windows are not checked during the run; fidim explain uses all windows."
COMMAND = "import sys; from fidim_lab.app.judging.model_worker import main; main(sys.argv[1])"


@dataclass(frozen=True)
class Looked:
    """What one look says."""

    window: str
    """the last that was taken in"""
    holds: bool | None
    """None: it could not be checked, or not yet"""
    suspected: tuple[str, ...]
    """ids of effects, the most evident first"""
    says: str
    seconds: float
    """that the look took"""


class ModelCheck:
    """Has the worker look after every accepted window; a listener of the run, quick, and it never raises."""

    def __init__(self, folder: Path, planned: int, tell: Callable[[Looked], None]) -> None:
        """folder: the run's. planned: windows; with fewer than can be checked nothing is started."""
        self._folder = folder
        self._tell = tell
        self._useful = planned >= SHARED.fewest
        self._worker = LineWorker("-c", COMMAND, str(folder), longest=LINE)
        self._working: asyncio.Task[None] | None = None
        self._waiting = ""
        """the newest window that has not been looked at"""

    def __call__(self, event: Event) -> None:
        """Take one event of the run."""
        if not (self._useful and isinstance(event, WindowFinished)):
            return
        if event.outcome not in (Outcome.PASS, Outcome.MARGINAL):
            return
        if not (self._folder / "windows" / f"{event.window}.csv").exists():
            return  # nothing was recorded: a tension check, or clocks that were compared
        self._waiting = event.window
        if self._working is None or self._working.done():
            self._working = asyncio.ensure_future(self._work())

    async def close(self, patience: float = LAST) -> None:
        """Wait so long (s) for the last answer, then end the worker; may be called again."""
        if self._working is not None:
            await asyncio.wait({self._working}, timeout=patience)
            self._working.cancel()
            await asyncio.gather(self._working, return_exceptions=True)
        await self._worker.end()

    async def _work(self) -> None:
        """Look until there is no window left that has not been looked at."""
        while self._waiting:
            window, self._waiting = self._waiting, ""
            try:
                answer = await self._worker.answer(window)
                if "failed" in answer:
                    self._tell(Looked(window, None, (), f"The model could not be checked: {answer['failed']}", 0.0))
                    continue
                self._tell(_checked(window, answer))
                if answer.get("full"):
                    self._useful, self._waiting = False, ""
                    await self._worker.end()
            except (OSError, ValueError) as error:
                self._useful = False
                self._tell(Looked(window, None, (), f"The model is no longer checked: {error}.", 0.0))
                return


def _checked(window: str, answer: dict[str, Any]) -> Looked:
    ids = tuple(dict.fromkeys(str(one["id"]) for one in answer["suspected"]))
    early = answer["holds"] and answer["chi2_per_dof"] is None
    says = f"{answer['says']} {NO_MORE}" if answer.get("full") else answer["says"]
    return Looked(window, None if early else answer["holds"], ids, says, answer["took"])
