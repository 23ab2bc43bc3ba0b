"""The page of `fidim compare --report`: two sessions side by side, in tables and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.figures import WIDTH, legend, plain_ticks, sd_levels
from fidim_lab.app.report.drawings.svg import COLOURS, sheet, styled, to_svg
from fidim_lab.app.report.pages.html import render
from fidim_lab.app.report.pages.write import write_page
from fidim_lab.app.report.sections.comparison import Comparison, Shift, WindowPair, comparison_tables, limit
from fidim_lab.app.report.sections.tables import ReportTable


@dataclass(frozen=True)
class ComparePage:
    """Everything that the template sets, in words."""

    title: str
    badges: tuple[str, ...]
    summary: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    tables: tuple[ReportTable, ...]
    drawings: tuple[Drawing, ...]
    kind: str = "Two sessions compared"


def write_compare_page(found: Comparison, out: Path) -> Path:
    """Write the page; returns its path. Raises FileError where it cannot be written."""
    badge = "✓ the sessions agree" if found.agree else "✗ the sessions differ, or cannot be judged"
    page = ComparePage(
        title=f"{found.a.name}, twice" if found.a.name == found.b.name else f"{found.a.name} and {found.b.name}",
        badges=(badge,),
        summary=(("A", found.a.says), ("B", found.b.says), ("Found", found.message)),
        warnings=found.warnings,
        tables=comparison_tables(found),
        drawings=_drawings(found),
    )
    return write_page(render("compare.html.jinja", page), out, None)


def _drawings(found: Comparison) -> tuple[Drawing, ...]:
    drawings: list[Drawing] = []
    if any(shift.z is not None for shift in found.shifts):
        caption = f"B − A in standard deviations; dotted: ±{limit():.1f}, the limit of chance."
        drawings.append(Drawing(_differences(found.shifts), caption, "differences"))
    if any(one is not None and one.chi2_per_dof is not None for w in found.windows for one in (w.a, w.b)):
        drawings.append(Drawing(_chi2(found.windows), "χ²/dof of each window; 1: only noise.", "windows"))
    return tuple(drawings)


@styled
def _differences(shifts: Sequence[Shift]) -> str:
    figure, (axis,) = sheet(WIDTH, 2.4)
    bars = [shift.z or 0.0 for shift in shifts]
    axis.bar(range(len(shifts)), bars, color=COLOURS[0], width=0.6)
    for level in (-limit(), limit()):
        axis.axhline(level, color="black", lw=0.8, ls=":")
    axis.axhline(0.0, color="black", lw=0.6)
    axis.set_yscale("symlog", linthresh=5.0)
    axis.set_yticks(sd_levels(min(*bars, -limit()), max(*bars, limit())))
    plain_ticks(axis.yaxis)
    axis.set_xticks(range(len(shifts)), [shift.name for shift in shifts])
    axis.grid(visible=False, axis="x")
    axis.set_ylabel("(B − A) / sd")
    return to_svg(figure)


@styled
def _chi2(windows: Sequence[WindowPair]) -> str:
    figure, (axis,) = sheet(WIDTH, 2.4)
    for k, (label, ones) in enumerate((("A", [w.a for w in windows]), ("B", [w.b for w in windows]))):
        known = [(x, one.chi2_per_dof) for x, one in enumerate(ones) if one is not None and one.chi2_per_dof]
        if known:
            axis.plot(*np.array(known).T, "os"[k], color=COLOURS[k], mfc="none" if k else COLOURS[k], label=label)
    axis.axhline(1.0, color="black", lw=0.8, ls=":")
    axis.set_yscale("log")
    plain_ticks(axis.yaxis)
    axis.set_xticks(range(len(windows)), [w.id[:12] for w in windows], rotation=90 if len(windows) > 12 else 0)
    axis.set_ylabel("χ²/dof")
    legend(axis, 2)
    return to_svg(figure)
