"""`fidim identify A B C`: one body and one geometry from several campaigns, and what predicts what."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from fidim_lab.app.analysis.identified import next_command
from fidim_lab.app.report.sections.joint import closing, cross_table
from fidim_lab.app.report.sections.tables import parameter_tables, window_table
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.campaign import read_campaign
from fidim_lab.identification.joint.identify import JointResult, identify_jointly
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.model.native import compiler


def identify_jointly_command(folders: Sequence[Path], json_file: Path | None, report: Path | None) -> int:
    """What `fidim identify` does with several campaigns: identify, print, write. Returns the exit code.

    Raises FileError for a wrong folder, SetupError where the campaigns cannot be of one platform, RefusedError where
    one cannot be fitted.
    """
    campaigns = [read_campaign(folder) for folder in folders]
    with Working("identifying jointly", sum(windows_of(folder) for folder in folders)):
        found = identify_jointly(campaigns, native=compiler() is not None)
    if json_file is not None:
        write_result(json_file, found.result, joint=found.table)
    console.out.print(summary(found))
    if report is not None:
        from fidim_lab.app.report.pages.joint_page import write_joint_page

        console.out.print(f"report      {write_joint_page(found, report)}", markup=False)
    console.out.print(f"next        {next_command(folders[0], found.result, json_file)}", markup=False)
    return 0 if found.result.outcome.answers else 1


def summary(found: JointResult) -> RenderableType:
    """The whole answer for a terminal."""
    result = found.result
    return Group(
        *console.answer(f"{result.campaign}: {result.outcome.code}", result.answer.parts),
        *(table.on_screen for table in (*parameter_tables(result), *cross_table(found), window_table(result))),
        *(Text(f"warning: {warning}", style="yellow") for warning in result.warnings),
        Text(closing(found), style="bold"),
    )
