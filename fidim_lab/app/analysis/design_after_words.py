"""What `fidim design --after` shows: the windows to record next, what was written and what to do with it."""

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from fidim_lab.app.terminal.windows_table import windows_table
from fidim_lab.data.records import Plan

PLAN, ANSWER = "plan.toml", "next.json"


def proposed_table(plan: Plan, notes: Sequence[tuple[str, ...]]) -> Table:
    """The windows with their notes.

    notes: for each window the effect that it is for, and the odds once it and those before it are recorded; or nothing.
    """
    heads = ("window", *(("for", "odds") if notes[0] else ()))
    return windows_table("To record next", [window.id for window in plan.windows], plan.windows, notes, heads)


def closing(plan: Plan, out: Path | None) -> list[str]:
    """What was written, and what comes next. out: the folder, where one was asked for."""
    if not plan.windows:
        why = "no window that can be recorded is likely to tell apart what is in question"
        return [f"written     {out / ANSWER}; no {PLAN}: {why}"] if out is not None else [f"plan        none: {why}"]
    if out is None:
        return [f"plan        not written: --out FOLDER makes {PLAN} of these windows, for fidim run"]
    return [f"written     {out / PLAN}, {ANSWER}", f"next        fidim run {out / PLAN} --rig RIG.toml"]
