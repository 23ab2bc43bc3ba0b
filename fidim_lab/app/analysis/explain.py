"""`fidim explain`: what physics the model leaves out of a campaign, and how that is known.

Progress goes to standard error, the answer to standard output. An answer is exit code 0, whatever it says.
"""

from collections.abc import Mapping
from pathlib import Path

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.campaign import read_campaign
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, write_explanation
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.explain import explain
from fidim_lab.units import millimetres, plain, signed


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
    answer = explanation.answer
    shown: list[RenderableType] = [
        *console.answer(f"{explanation.campaign}: {explanation.verdict.value}", () if answer is None else answer.parts),
        *(effect_table(cause) for cause in explanation.effects),
        *(_sizes_table(f"Like {term.like}: {term.says}", term.parameters) for term in explanation.law),
        *([Text("Where it shows", style="bold")] if explanation.where else []),
        *(Text(f"  {place.says}") for place in explanation.where),
        ranking_table(explanation),
        parameter_table(explanation),
        Text(explanation.message),
    ]
    return Group(*shown)


def effect_table(cause: NamedCause) -> Table:
    """One named effect with its parameters."""
    place = "" if cause.cable is None else f" of cable {cause.cable}"
    alike = f"; cannot be separated from {', '.join(cause.equivalent_to)}" if cause.equivalent_to else ""
    return _sizes_table(f"{cause.id}{place}: {cause.says}{alike}", cause.parameters)


def _sizes_table(title: str, parameters: Mapping[str, EffectParameter]) -> Table:
    table = Table(title=escape(title))
    console.columns(table, "parameter", "value", "sd", "unit")
    for name, parameter in parameters.items():
        sd = "held" if parameter.sd is None else f"{parameter.sd:.2g}"
        table.add_row(name, plain(parameter.value, 5), sd, parameter.unit)
    return table


def ranking_table(explanation: Explanation) -> Table:
    """Every model that was fitted, then the best that were only scored."""
    table = Table(title="What was tried")
    console.columns(table, "model", "held-out χ²/dof", "possible")
    table.add_column("why")
    for ranked in explanation.ranking:
        held = "–" if ranked.held_out_chi2_per_dof is None else plain(ranked.held_out_chi2_per_dof, 4)
        table.add_row(ranked.name, held, "yes" if ranked.plausible else "no", escape(ranked.told))
    return table


def parameter_table(explanation: Explanation) -> Table:
    """The body with and without the effects, and how far it moved."""
    table = Table(title="Inertial parameters (s in mm, I in 1e-3 m² per unit mass, about P)")
    console.columns(table, "parameter", "CAD", "before", "after", "sd", "moved, sd")
    for name, after in explanation.parameters.items():
        before = explanation.parameters_before[name]
        moved = (after.value - before.value) / before.sd if before.sd > 0 else 0.0
        values = (f"{millimetres(x):.4f}" for x in (after.nominal, before.value, after.value))
        table.add_row(name, *values, f"{millimetres(after.sd):.2g}", signed(moved, 1))
    return table
