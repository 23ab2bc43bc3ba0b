"""Windows as `fidim design` shows them, on the terminal."""

from collections.abc import Sequence

from rich.table import Table

from fidim_lab.app.terminal import console
from fidim_lab.data.records import PlannedWindow
from fidim_lab.units import millimetres


def windows_table(
    title: str,
    names: Sequence[str],
    windows: Sequence[PlannedWindow],
    notes: Sequence[Sequence[str]],
    heads: Sequence[str],
) -> Table:
    """A row for each window: its name, lengths, displacement, marker at rest, and its notes.

    heads: over the name, then over each note.
    """
    first, *others = heads
    lengths = (f"l_{i + 1}, m" for i in range(len(windows[0].lengths)))
    rows = (
        (
            name,
            *(f"{v:.3f}" for v in window.lengths),
            ", ".join(f"{millimetres(v):.1f}" for v in window.displacement),
            ", ".join(f"{v:.3f}" for v in window.position),
            *noted,
        )
        for name, window, noted in zip(names, windows, notes, strict=True)
    )
    return console.table(title, (first, *lengths, "Δx, Δy, mm", "marker at rest, m", *others), rows, left=0)
