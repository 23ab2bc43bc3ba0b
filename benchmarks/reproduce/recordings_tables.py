"""The tables of `fidim reproduce --recordings`: the paper's columns first, then its data by us."""

import numpy as np
from rich import box
from rich.table import Table

from benchmarks.reproduce import paper
from benchmarks.reproduce.recordings_found import FromRecordings
from benchmarks.reproduce.takes import TakesIdentified
from fidim_lab.app.terminal import console
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.units import millimetres


def everything(found: FromRecordings) -> tuple[Table, ...]:
    """All tables in the order of the paper."""
    return (
        _equation("Eq. 46, x and y of P", paper.FREE, found.free, found.free.solution.percent),
        _equation("Eq. 47, full pose", paper.FULL, found.full, found.full.printed_percent),
        _difference(found),
        _figure_3(found),
        *([_bodies(found)] if found.bodies else []),
    )


def _table(title: str, *names: str) -> Table:
    table = console.table(title, (*names,), (), box=box.SIMPLE)
    return table


def _equation(title: str, printed: paper.Published, ours: TakesIdentified, percent: np.ndarray) -> Table:
    table = _table(f"{title}: s in mm, I in 1e-3 m² per unit mass", "", "paper", "its data", "σ% paper", "σ% its data")
    solution = ours.solution
    for k, name in enumerate(PARAMETER_NAMES):
        table.add_row(
            name,
            f"{millimetres(printed.values[k]):.3f}",
            f"{millimetres(solution.values[k]):.3f}",
            f"{printed.percent[k]:.4g}",
            f"{percent[k]:.4g}",
        )
    table.add_row("σ_W", f"{printed.sigma_W:.3f}", f"{solution.sigma_W:.3f}", "", "")
    table.add_row("C", f"{printed.C:.2f}", f"{solution.C:.2f}", "", "")
    table.add_row("windows", "12", str(len(ours.takes)), "", "")
    table.add_row("equations", "2400", str(solution.rows), "", "")
    return table


def _difference(found: FromRecordings) -> Table:
    table = _table("Eq. 49: |full − free| over |free|, %", "", "paper", "its data")
    for name, printed, ours in zip(PARAMETER_NAMES, paper.ESSENTIAL_DIFFERENCE, found.difference, strict=False):
        table.add_row(name, f"{printed:.2f}", f"{ours:.2f}")
    return table


def _figure_3(found: FromRecordings) -> Table:
    title = f"Fig. 3: takes with Eq. 46's body (σ_W = {paper.FREE.sigma_W})"
    table = _table(title, "take", "σ⊥ (Eq. 50)", "mean of ε²")
    for one in found.checked:
        table.add_row(str(one.number), f"{one.sigma:.3f}", f"{one.mean_square:.3f}")
    printed, mean = found.above(printed=True), found.above(printed=False)
    table.add_row("above σ_W", f"{printed} of {len(found.checked)}", f"{mean} of {len(found.checked)}")
    return table


def _bodies(found: FromRecordings) -> Table:
    laboratory = list(found.laboratory.items())
    ours = [f"ML, {' + '.join(map(str, one.cables))}" for one in found.bodies]
    table = _table(
        "Bodies by the number of cables (ML: maximum likelihood, geometry and friction open; ±: of all cables)",
        "",
        "Eq. 47",
        *(f"lab, {n}" for n, _ in laboratory),
        *ours,
        "±",
    )
    for k, name in enumerate(PARAMETER_NAMES):
        values = [body.vector[k] for _, body in laboratory] + [one.body.vector[k] for one in found.bodies]
        cells = [f"{millimetres(value):.2f}" for value in (paper.FULL.values[k], *values, found.bodies[-1].sd[k])]
        table.add_row(name, *cells)
    blanks = [""] * len(laboratory)
    table.add_row("rms, mm", "", *blanks, *(f"{millimetres(one.rms):.2f}" for one in found.bodies), "")
    table.add_row("windows", "", *blanks, *(str(one.takes) for one in found.bodies), "")
    return table
