"""Checks of `fidim doctor`: what one is, and how they are shown to a person and to a program."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rich.table import Table


class CheckVerdict(StrEnum):
    """How a check ended."""

    OK = "ok"
    WRITTEN = "written at start"
    """another value, which is written and read back whenever the drive is brought up"""
    WARNING = "warning"
    """works without it, or only part of the tool needs it"""
    FAILED = "failed"
    UNREACHABLE = "unreachable"
    """hardware that does not answer"""

    @property
    def wrong(self) -> bool:
        """Whether it keeps an experiment from starting."""
        return self in (CheckVerdict.FAILED, CheckVerdict.UNREACHABLE)


BY_TRIAL = "prove it at low speed and without load: fidim commission RIG"
"""what to do about a stop that is neither configured nor proven"""
MARKS = {
    CheckVerdict.OK: "✓",
    CheckVerdict.WRITTEN: "→",
    CheckVerdict.WARNING: "!",
    CheckVerdict.FAILED: "✗",
    CheckVerdict.UNREACHABLE: "✗",
}


@dataclass(frozen=True)
class Check:
    """One line of the doctor's table."""

    name: str
    verdict: CheckVerdict
    found: str
    advice: str = ""
    wanted: str = ""
    device: str = ""
    """of a rig: which of its devices"""


def make_table(checks: Sequence[Check]) -> Table:
    """One row a check; devices of which the same is to be said share one."""
    with_wanted = any(check.wanted for check in checks)
    table = Table(box=None, pad_edge=False)
    for column in ("", "check", *(["wanted"] if with_wanted else []), "found", "what to do"):
        table.add_column(column, overflow="fold")
    rows: dict[tuple[str, ...], list[str]] = {}
    for check in checks:
        key = (MARKS[check.verdict], check.name, check.wanted, check.found, check.advice)
        rows.setdefault(key, []).append(check.device)
    for (mark, name, wanted, found, advice), devices in rows.items():
        whose = _together(devices, sum(check.name == name for check in checks))
        shown = f"{whose}: {name}" if whose else name
        table.add_row(mark, shown, *([wanted] if with_wanted else []), found, advice)
    return table


def _together(devices: Sequence[str], count: int) -> str:
    """Several devices in few words; `count` have this check."""
    named = [device for device in devices if device]
    return f"all {count}" if len(named) == count > 1 else ", ".join(named)


def summary(checks: Sequence[Check], wrong: Sequence[Check], unproven: int = 0) -> str:
    """The last line. unproven: checks that ask for a trial before a run."""
    if not wrong:
        well = "Nothing is wrong" if unproven else "All well"
        written = sum(check.verdict is CheckVerdict.WRITTEN for check in checks)
        if written:
            well += f"; {written} values are written and read back at each start (→)"
        trial = f" Before a run, prove by trial what {unproven} of the checks ask for: fidim commission RIG"
        return f"{well}.{trial if unproven else ''}"
    names = [f"{check.device}: {check.name}" if check.device else check.name for check in wrong]
    return f"{len(wrong)} of {len(checks)} checks failed: {', '.join(names)}"
