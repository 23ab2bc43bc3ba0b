"""`fidim compare A B`: two sessions side by side. `comparison` computes, `compare_command` prints and writes."""

from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.report.sections.compared_session import read_session
from fidim_lab.app.report.sections.comparison import Comparison, compared, comparison_tables
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working

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
    return Group(
        Text(f"A: {found.a.says}"),
        Text(f"B: {found.b.says}"),
        *(table.on_screen for table in comparison_tables(found)),
        *(Text(f"warning: {warning}", style="yellow") for warning in found.warnings),
        Text(found.message, style="bold"),
    )
