"""The state of the planned windows during a run, from the steps and their results."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from fidim_lab.data.records import Role
from procedures.events import WindowFinished
from procedures.outcomes import Outcome, worst
from procedures.report import WindowRow
from procedures.steps import Accept, GiveUp, Record, Result, Step


class Ledger:
    """One row for each planned window, in order."""

    def __init__(self, folder: Path, roles: Mapping[str, Role], known: Mapping[str, WindowRow] | None = None) -> None:
        """known: windows that have their verdict from an earlier process."""
        self._folder = folder
        self._rows = {window: WindowRow(window, role) for window, role in roles.items()} | dict(known or {})

    @property
    def rows(self) -> tuple[WindowRow, ...]:
        """As they stand now."""
        return tuple(self._rows.values())

    @property
    def outcome(self) -> Outcome:
        """The outcome of a complete run: the worst of its windows; PASS for a procedure without windows."""
        return worst(row.outcome for row in self.rows) if self._rows else Outcome.PASS

    @property
    def reason(self) -> str:
        """How many windows are there, or places done where none was to be recorded, and why some are not."""
        missing: dict[str, list[str]] = {}
        for row in self.rows:
            if row.file is None:
                missing.setdefault(row.reason.rstrip(".") or "not reached", []).append(row.id)
        why = (f"{', '.join(ids)}: {reason}" for reason, ids in missing.items())
        return ". ".join([self._counted(), *why]) + "."

    def _counted(self) -> str:
        passed = [row for row in self.rows if row.outcome is Outcome.PASS]
        if passed and not any(row.attempts or row.file for row in self.rows):
            return f"{len(passed)} of {len(self._rows)} places done; nothing was to be recorded"
        accepted = sum(row.file is not None for row in self.rows)
        return f"{accepted} of {len(self._rows)} windows accepted"

    def take(self, step: Step, result: Result, t: float) -> WindowFinished | None:
        """Account for one finished step; the verdict event when it decides about a window."""
        row = self._rows.get(step.window)
        if row is None:
            row = _added(step)
        if row is None:
            return None
        match step:
            case Record():
                self._rows[row.id] = replace(row, attempts=step.attempt)
            case Accept():
                file = self._folder / "windows" / f"{row.id}.csv"
                self._rows[row.id] = replace(row, outcome=result.outcome, reason=result.reason, file=file)
            case GiveUp():
                self._rows[row.id] = replace(row, outcome=result.outcome, reason=result.reason)
            case _:
                return None
        if not isinstance(step, Accept | GiveUp):
            return None
        done = sum(known.outcome is not Outcome.UNSET for known in self.rows)
        row = self._rows[row.id]
        return WindowFinished(t, row.id, result.outcome, result.reason, done, len(self._rows), row.role, row.attempts)


def _added(step: Step) -> WindowRow | None:
    """The row of a window that the procedure has added to the plan's, where the step decides about one."""
    match step:
        case Accept():
            return WindowRow(step.window, step.role, attempts=step.attempt)
        case GiveUp():
            return WindowRow(step.window, Role.IDENTIFY)
        case _:
            return None
