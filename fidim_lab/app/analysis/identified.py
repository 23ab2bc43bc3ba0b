"""What `fidim identify` shows a person: parameters, windows, warnings, how far to trust it, and what to do next.

Warnings are in the summary because they belong to the answer. `fidim dry-run` and joint fits show the same tables.
"""

from pathlib import Path
from shlex import quote

from rich.console import Group, RenderableType
from rich.text import Text

from fidim_lab.app.report.sections.tables import parameter_tables, window_table
from fidim_lab.app.terminal import console
from fidim_lab.app.workflows.identify import closing_sentence
from fidim_lab.data.campaign import ROBOT
from fidim_lab.identification.design.task import DISPLACED
from fidim_lab.identification.mle.periods.by_periods import VARIANT as BY_PERIODS
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome


def summary(result: IdentificationResult) -> RenderableType:
    """The whole answer for a terminal: four short parts, tables, warnings, and how far to trust it."""
    parts: list[RenderableType] = [
        *console.answer(f"{result.campaign}: {result.outcome.code}", result.answer.parts),
        *(table.on_screen for table in (*parameter_tables(result), window_table(result))),
        *(Text(f"warning: {warning}", style="yellow") for warning in result.warnings),
        Text(closing_sentence(result), style="bold"),
    ]
    return Group(*parts)


def next_command(folder: Path, result: IdentificationResult, json_file: Path | None) -> str:
    """The command that follows from this result of a campaign, as it may be typed."""
    place = quote(str(folder))
    if result.windows and all(one.variant == BY_PERIODS for one in result.windows) and not result.outcome.good:
        return f"fidim import periods TABLE --robot {quote(str(folder / ROBOT))} --out again"
    if not result.outcome.answers or result.fallback:
        return f"fidim explain {place}"
    if json_file is None:  # what all that follows takes
        return f"fidim identify {place} --json {quote(str(folder / 'result.json'))}"
    kept = quote(str(json_file))
    if result.outcome is ResultOutcome.DOUBTFUL and result.freedoms > DISPLACED:  # more windows, at places at random
        return f"fidim dry-run --robot {quote(str(folder / ROBOT))} --out rehearsal"
    if result.outcome is ResultOutcome.DOUBTFUL:
        return f"fidim design --after {kept} --campaign {place} --out next"
    return f"fidim export {kept} --to python --campaign {place} --out robot.py"
