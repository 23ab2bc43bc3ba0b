"""`fidim explain`: what physics the model leaves out of a campaign, and how that is known.

Progress goes to standard error, the answer to standard output. An answer is exit code 0, whatever it says.
"""

from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from fidim_lab.app.formats.explanation_file import as_file
from fidim_lab.app.report.sections.explained import effect_tables, ranking_table, shift_table
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.campaign import read_campaign
from fidim_lab.mismatch.conclusion.explanation import Explanation, write_explanation
from fidim_lab.mismatch.explain import explain


def explain_command(
    campaign_folder: Path,
    json_file: Path | None,
    report: Path | None = None,
    pictures: Path | None = None,
    effort: float = 1.0,
    patience: float | None = None,
    without: tuple[str, ...] = (),
) -> int:
    """What `fidim explain` does: explain, print, write. Returns the exit code.

    `pictures`: a folder for the report's pictures as SVG files. `effort`, `patience`: as `explain` has them.
    `without`: effects that the catalogue is to lack.
    Raises FileError for a wrong campaign, RefusedError where no window can be fitted.
    """
    campaign = read_campaign(campaign_folder)
    with Working("explaining", windows_of(campaign_folder)) as status:

        def say(sentence: str) -> None:
            status.update(sentence)
            if not console.err.is_terminal:
                console.err.print(sentence, markup=False)

        explanation = explain(campaign, say=say, effort=effort, patience=patience, without=without)
    if json_file is not None:
        write_explanation(json_file, explanation)
    console.out.print(summary(explanation))
    if report is not None:
        from fidim_lab.app.report.pages.explain_page import write_explain_page

        with Working("predicting held-out windows and drawing", windows_of(campaign_folder)):
            path = write_explain_page(campaign_folder, explanation, report, pictures)
        console.out.print(f"report      {path}", markup=False)
    return 0


def summary(explanation: Explanation) -> RenderableType:
    """The whole answer for a terminal: four short parts, effects, what was tried, the body, details."""
    answer, found = explanation.answer, as_file(explanation)
    where = found.where
    return Group(
        *console.answer(f"{explanation.campaign}: {explanation.verdict.value}", () if answer is None else answer.parts),
        *(table.on_screen for table in effect_tables(found)),
        *([Text("Where it shows", style="bold")] if where else []),
        *(Text(f"  {place.says}") for place in where),
        ranking_table(found).on_screen,
        shift_table(found).on_screen,
        Text(explanation.message),
    )
