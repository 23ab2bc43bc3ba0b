"""What `fidim design --after` shows: the windows to record next, what was written and what to do with it."""

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from fidim_lab.data.records import Plan
from fidim_lab.units import millimetres

PLAN, ANSWER = "plan.toml", "next.json"


def windows_table(plan: Plan, notes: Sequence[tuple[str, ...]]) -> Table:
    """The windows as `fidim design` shows them, with their notes.

    notes: for each window the effect that it is for, and the odds once it and those before it are recorded; or nothing.
    """
    table = Table(title="To record next")
    lengths = (f"l_{i + 1}, m" for i in range(len(plan.windows[0].lengths)))
    for name in ("window", *lengths, "Δx, Δy, mm", "marker at rest, m", *(("for", "odds") if notes[0] else ())):
        table.add_column(name, justify="right")
    for window, note in zip(plan.windows, notes, strict=True):
        table.add_row(
            window.id,
            *(f"{v:.3f}" for v in window.lengths),
            ", ".join(f"{millimetres(v):.1f}" for v in window.displacement),
            ", ".join(f"{v:.3f}" for v in window.position),
            *note,
        )
    return table


def closing(plan: Plan, out: Path | None) -> list[str]:
    """What was written, and what comes next. out: the folder, where one was asked for."""
    if not plan.windows:
        why = "no window that can be recorded is likely to tell apart what is in question"
        return [f"written     {out / ANSWER}; no {PLAN}: {why}"] if out is not None else [f"plan        none: {why}"]
    if out is None:
        return [f"plan        not written: --out FOLDER makes {PLAN} of these windows, for fidim run"]
    return [f"written     {out / PLAN}, {ANSWER}", f"next        fidim run {out / PLAN} --rig RIG.toml"]
