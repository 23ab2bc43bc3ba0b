"""The tables of `fidim reproduce`: the paper's columns first, ours beside them, row by row."""

from collections.abc import Callable

import numpy as np
from rich import box
from rich.table import Table

from benchmarks.reproduce import paper
from benchmarks.reproduce.simulated import (
    ESSENTIAL,
    HOPELESS,
    IdentifiedRun,
    OptimisedWindow,
    Reproduction,
    essential_difference,
)
from fidim_lab.app.terminal import console
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.units import millimetres, plain

BAR = 20
"""characters of a bar of Fig. 3 at σ_W"""
LONGEST = 44


def everything(found: Reproduction) -> tuple[Table, ...]:
    """All tables in the order of the paper."""
    return (
        optimised_table(found.optimised, found.cost),
        value_table("Eq. 46, x, y of one marker", paper.FREE, found.columns(46)),
        percent_table("Eq. 46", paper.FREE, found.columns(46)),
        value_table("Eq. 47, full pose", paper.FULL, found.columns(47)),
        percent_table("Eq. 47", paper.FULL, found.columns(47)),
        difference_table(found),
        cross_validation_table(found),
    )


def optimised_table(windows: tuple[OptimisedWindow, ...], cost: float) -> Table:
    """Tables 2 and 3 with what they are like on the nominal robot."""
    table = console.table(
        f"Tables 2, 3: optimised windows (CAD body). C without noise: {cost:.1f}, the paper's {paper.OPTIMUM_C}",
        (
            "k",
            "l, m",
            "Δx, Δy, mm",
            "tension, N",
            "condition at rest",
            "in motion",
            "x, y are",
        ),
        (),
        box=box.SIMPLE,
    )
    for window in windows:
        planned = window.planned
        table.add_row(
            planned.id,
            " ".join(f"{v:.2f}" for v in planned.lengths),
            ", ".join(f"{millimetres(v):.1f}" for v in planned.displacement),
            f"{window.tension[0]:.0f}–{window.tension[1]:.0f}",
            f"{window.conditioning:.0f}",
            plain(window.worst_conditioning, 2),
            "hopeless" if window.conditioning > HOPELESS else "good",
        )
    return table


def value_table(title: str, published: paper.Published, ours: dict[str, IdentifiedRun | str]) -> Table:
    """Nine parameters, σ_W and C: the paper's values, ours with the error against the truth in percent."""
    table = console.table(
        f"{title}: s in mm, I in 1e-3 m² per unit mass (error in %; truth: the paper's Eq. 46)",
        (
            "",
            "paper",
            *ours,
        ),
        (),
        box=box.SIMPLE,
    )
    for k, name in enumerate(PARAMETER_NAMES):
        cells = [_value(reading, k) for reading in ours.values()]
        table.add_row(name, f"{millimetres(published.values[k]):.2f}", *cells)
    table.add_row("σ_W", f"{published.sigma_W:.3g}", *_footer(ours, lambda r: f"{r.sigma_W:.3g}"))
    table.add_row("C", f"{published.C:.3g}", *_footer(ours, lambda r: plain(r.C)))
    table.add_row("windows", "12", *_footer(ours, lambda r: str(len(r.used))))
    return table


def percent_table(title: str, published: paper.Published, ours: dict[str, IdentifiedRun | str]) -> Table:
    """σ% of the nine parameters, as the paper prints them."""
    table = console.table(
        f"{title}: σ% (Eq. 34)",
        (
            "",
            "paper",
            *ours,
        ),
        (),
        box=box.SIMPLE,
    )
    for k, name in enumerate(PARAMETER_NAMES):
        cells = ["–" if isinstance(r, str) else _percent(r.percent[k]) for r in ours.values()]
        table.add_row(name, _percent(published.percent[k]), *cells)
    return table


def difference_table(found: Reproduction) -> Table:
    """Eq. 49: how far full pose and free coordinates are apart, %."""
    table = console.table(
        "Eq. 49: |full − free| over |free|, %",
        (
            "",
            "paper",
            "its σ% (Eq. 46)",
            "Table 2",
            "random",
        ),
        (),
        box=box.SIMPLE,
    )
    rows = [essential_difference(places) for places in (found.table2, found.random)]
    for k, name in enumerate(PARAMETER_NAMES[:ESSENTIAL]):
        shown = ["–" if row is None else f"{row[k]:.2f}" for row in rows]
        table.add_row(name, f"{paper.ESSENTIAL_DIFFERENCE[k]:.2f}", f"{paper.FREE.percent[k]:.2f}", *shown)
    return table


def cross_validation_table(found: Reproduction) -> Table:
    """Fig. 3: σ⊥ of each held-out window, a bar each; the mark is σ_W."""
    free = found.random.free
    sigma_W = free.sigma_W if isinstance(free, IdentifiedRun) else np.inf
    expected = "" if found.expected is None else f", σ⊥ ≈ {found.expected:.3g} where the model holds"
    table = console.table(
        f"Fig. 3: σ⊥ of held-out windows, full pose (mark: σ_W = {sigma_W:.3g}{expected})",
        (
            "window",
            "σ⊥",
            "σ⊥/σ_W",
        ),
        (),
        box=box.SIMPLE,
    )
    table.add_column("")
    for name, sigma in found.sigma_perps.items():
        full = "█" * min(LONGEST, round(BAR * sigma / sigma_W))
        bar = full.ljust(BAR) + "│" if len(full) <= BAR else full[:BAR] + "│" + full[BAR:]
        table.add_row(name, f"{sigma:.3g}", f"{sigma / sigma_W:.2f}", bar)
    return table


def _value(reading: IdentifiedRun | str, k: int) -> str:
    if isinstance(reading, str):
        return "refused" if k == 0 else ""
    return f"{millimetres(reading.values[k]):.2f} ({_percent(reading.error_percent(paper.FREE.body)[k], '+')})"


def _percent(value: float, sign: str = "") -> str:
    digits = 0 if abs(value) >= 10 else 1 if abs(value) >= 1 else 2
    return f"{value:{sign}.{digits}f}"


def _footer(ours: dict[str, IdentifiedRun | str], figure: Callable[[IdentifiedRun], str]) -> list[str]:
    return ["–" if isinstance(r, str) else figure(r) for r in ours.values()]
