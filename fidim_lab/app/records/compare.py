"""`fidim compare A B`: two sessions side by side. `comparison` computes, `compare_command` prints and writes."""

from pathlib import Path

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.report.sections.compared_session import read_session
from fidim_lab.app.report.sections.comparison import Comparison, compared
from fidim_lab.app.report.sections.numerals import short
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working
from fidim_lab.units import millimetres

FORMAT = "fidim-comparison/1"


def compare_command(first: Path, second: Path, json_file: Path | None, report: Path | None) -> int:
    """What `fidim compare` does; 0 where the two agree, 1 where they do not or cannot be judged.

    Raises FileError for a wrong folder or file.
    """
    with Working("identifying two sessions"):
        found = compared(read_session(first), read_session(second))
    write_answer(json_file, FORMAT, found.table)
    console.out.print(summary(found))
    if report is not None:
        from fidim_lab.app.report.pages.compare_page import write_compare_page

        console.out.print(f"report      {write_compare_page(found, report)}", markup=False)
    return 0 if found.agree else 1


def summary(found: Comparison) -> RenderableType:
    """The whole answer for a terminal."""
    parts: list[RenderableType] = [Text(f"A: {found.a.says}"), Text(f"B: {found.b.says}")]
    if found.shifts:
        parts.append(parameter_table(found))
    parts += [session_table(found), window_table(found)]
    parts += [Text(f"warning: {warning}", style="yellow") for warning in found.warnings]
    return Group(*parts, Text(found.message, style="bold"))


def parameter_table(found: Comparison) -> Table:
    """All nine, with the difference in standard deviations of the difference."""
    table = Table(title="Inertial parameters (s in mm, I in 1e-3 m² per unit mass, about P)")
    console.columns(table, "parameter", "A", "±", "B", "±", "B − A", "in sd")
    for shift in found.shifts:
        cells = (shift.a, shift.sd_a, shift.b, shift.sd_b, shift.difference)
        z = "–" if shift.z is None else f"{shift.z:+.1f}"
        table.add_row(shift.name, *(f"{millimetres(value):.4f}" for value in cells), z)
    return table


def session_table(found: Comparison) -> Table:
    """What each session is, and what came of it."""
    table = Table(title="Sessions")
    console.columns(table, "", "A", "B")
    for name, a, b in found.facts:
        table.add_row(name, escape(a), escape(b))
    return table


def window_table(found: Comparison) -> Table:
    """Windows with the same name beside one another."""
    table = Table(title="Windows")
    console.columns(table, "window", "χ²/dof A", "χ²/dof B", "rms A, mm", "rms B, mm", "σ⊥ A", "σ⊥ B")
    for row in found.windows:
        a, b = row.a, row.b
        pairs = [(getattr(a, key, None), getattr(b, key, None)) for key in ("chi2_per_dof", "rms_mm", "sigma_perp")]
        table.add_row(escape(row.id), *(short(value) for pair in pairs for value in pair))
    return table
