"""Leaving a run alone: when it must end or wait, what is written at its end, and whom it tells.

`PatienceGuard` ends a run that takes too long, `quiet` says whether windows may begin now, `write_summary` and
`run_hook` are for whoever reads the morning after.
"""

import os
import subprocess
from collections.abc import Callable
from datetime import datetime, time
from pathlib import Path
from typing import Any

from drivers.ports import Clock
from fidim_lab.app.formats.run_spec import HOOK_TIMEOUT, SUMMARY, RunSpec
from fidim_lab.data.files.json_file import as_json, write_json
from procedures.guards.guard import Observation
from procedures.handlers.motion import move_to
from procedures.report import RunReport
from procedures.settings import Reaction
from procedures.stand import Stand
from procedures.steps import MoveTo, Result

FORMAT = "fidim-summary/1"
LOOK = 10.0
"""s between two looks at the time of day"""


class PatienceGuard:
    """The run has taken longer than it may: it ends, held."""

    name = "duration"
    reaction = Reaction.HOLD

    def __init__(self, hours: float) -> None:
        self._hours = hours
        self._since: float | None = None

    def look(self, seen: Observation) -> str | None:
        """Whether the time is up."""
        self._since = seen.t if self._since is None else self._since
        passed = (seen.t - self._since) / 3600.0
        return f"the run has lasted {passed:.2f} h, {self._hours:g} h are allowed" if passed > self._hours else None


def quiet(span: tuple[str, str], now: time) -> bool:
    """Whether the time of day lies in a span that may go over midnight."""
    begin, end = (time.fromisoformat(text) for text in span)
    return begin <= now < end if begin <= end else now >= begin or now < end


class QuietMove:
    """Handler of `MoveTo` that waits for the end of quiet hours; a window that has begun is finished in them."""

    def __init__(self, span: tuple[str, str], local_time: Callable[[], time], says: Callable[[str], None]) -> None:
        self._span = span
        self._local_time = local_time
        self._says = says

    async def __call__(self, stand: Stand, step: MoveTo) -> Result:
        """Wait, held, then move."""
        clock: Clock = stand.rig.clock
        if quiet(self._span, self._local_time()):
            self._says(f"quiet hours until {self._span[1]}: waiting, held")
            while quiet(self._span, self._local_time()):
                await clock.sleep(LOOK)
        return await move_to(stand, step)


def local_time() -> time:
    """The time of day here."""
    return datetime.now().astimezone().time()


IN_SUMMARY = ("id", "role", "outcome", "reason", "attempts")
"""of each window"""


def summary(report: RunReport) -> dict[str, Any]:
    """What came of a run, as JSON has it."""
    return {
        "format": FORMAT,
        "run": report.name,
        "outcome": report.outcome.value,
        "exit_code": report.exit_code,
        "reason": report.reason,
        "held": report.held,
        "held_says": report.held_says,
        "winches": [one.values for one in report.stopped],
        "interrupted": report.interrupted,
        "seconds": round(report.seconds, 3),
        "accepted": len(report.accepted),
        "windows": [as_json({name: getattr(row, name) for name in IN_SUMMARY}) for row in report.windows],
    }


def write_summary(folder: Path, report: RunReport) -> None:
    """summary.json, whole or not at all. Raises OSError."""
    write_json(folder / SUMMARY, summary(report))


def run_hook(spec: RunSpec, report: RunReport) -> str:
    """Run the hook for this end, if there is one; returns what went wrong with it, empty where nothing did."""
    command = spec.on_finish if report.exit_code == 0 else spec.on_fault
    if not command:
        return ""
    told = {
        "FIDIM_RUN": str(report.folder),
        "FIDIM_OUTCOME": report.outcome.value,
        "FIDIM_EXIT_CODE": str(report.exit_code),
        "FIDIM_REASON": report.reason,
    }
    try:
        done = subprocess.run(
            command,
            shell=True,  # the user's own command line, as in make or cron
            env={**os.environ, **told},
            timeout=HOOK_TIMEOUT,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"the hook “{command}” was not completed: {error}"
    return f"the hook “{command}” ended with exit code {done.returncode}" if done.returncode else ""
