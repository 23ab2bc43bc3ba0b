"""The result of a run, as a frozen value: for the command line's table, its exit code, and the HTML report."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.records import Role
from procedures.outcomes import Outcome
from procedures.stopping import StoppedWinch


@dataclass(frozen=True)
class WindowRow:
    """One planned window."""

    id: str
    role: Role
    outcome: Outcome = Outcome.UNSET
    """UNSET: never reached"""
    reason: str = ""
    attempts: int = 0
    """recordings made, rejected ones included"""
    file: Path | None = None
    """where the accepted window lies"""


@dataclass(frozen=True)
class RunReport:
    """One run, ended."""

    name: str
    folder: Path
    outcome: Outcome
    reason: str
    """a sentence"""
    windows: tuple[WindowRow, ...]
    held: bool
    """whether every winch was seen to stand still at the end"""
    held_says: str
    seconds: float
    """as the run's clock counts"""
    stopped: tuple[StoppedWinch, ...] = ()
    """how each winch came to its last stop; empty where nothing was moved"""
    interrupted: bool = False
    """cancelled from outside (Ctrl-C)"""
    wrong_input: bool = False
    """ended by a mistake in a file of the user's, as in a procedure of their own"""

    @property
    def accepted(self) -> tuple[WindowRow, ...]:
        """The windows that the campaign has."""
        return tuple(row for row in self.windows if row.file is not None)

    @property
    def exit_code(self) -> int:
        """By spec/formats.md: 0 done, 1 refusal or failed check, 2 bad input, 3 hardware or guard, 130 interrupted."""
        if self.interrupted:
            return 130
        if self.wrong_input and self.held:
            return 2
        if self.outcome is Outcome.ERROR or not self.held:
            return 3
        return 0 if self.outcome.usable else 1
