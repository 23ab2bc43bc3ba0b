"""The page of `fidim explain --report`: what was left out of a campaign, and the proof: `write_explain_page`."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from fidim_lab.app.formats.explanation_file import as_file
from fidim_lab.app.report.contents.folder import Contents, read_folder
from fidim_lab.app.report.contents.proof import proof
from fidim_lab.app.report.drawings.scene import scene
from fidim_lab.app.report.drawings.solid import Solid, solid
from fidim_lab.app.report.pages.html import render
from fidim_lab.app.report.pages.write import write_page
from fidim_lab.app.report.sections.explained import VERDICTS, ExplanationSection, explained
from fidim_lab.app.report.sections.numerals import duration
from fidim_lab.app.report.sections.tables import ReportTable, file_table, version_table
from fidim_lab.app.report.sections.words import recorded_sentence
from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.mismatch.conclusion.explanation import Explanation
from fidim_lab.model.mechanism import Mechanism

ARROWS = 150


@dataclass(frozen=True)
class ExplainPage:
    """Everything that the template sets, in words."""

    title: str
    badges: tuple[str, ...]
    summary: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    explanation: ExplanationSection
    solid: Solid
    origin: tuple[tuple[str, str], ...]
    origin_tables: tuple[ReportTable, ...]
    kind: str = "What the model leaves out"


def write_explain_page(folder: Path, explanation: Explanation, out: Path, pictures: Path | None = None) -> Path:
    """Write what `explain` found of a campaign folder as one HTML file; returns its path.

    Held-out windows are predicted again, with the numbers that the explanation states. `pictures`: a folder for all
    pictures as SVG files. Raises FileError where something cannot be read or written.
    """
    return write_page(render("explain.html.jinja", _page(read_folder(folder), explanation)), out, pictures)


def _page(contents: Contents, explanation: Explanation) -> ExplainPage:
    campaign, found = contents.campaign, as_file(explanation)
    section = explained(
        found,
        proof(found, campaign, explanation.unknown),
        campaign.robot.sensors.marker_noise,
    )
    body = Body.from_vector(np.array([explanation.parameters[name].value for name in PARAMETER_NAMES]))
    return ExplainPage(
        title=campaign.name,
        badges=(VERDICTS[found.verdict],),
        summary=_summary(contents, explanation),
        warnings=(),
        explanation=section,
        solid=solid(scene(campaign, Mechanism(campaign.robot), body), _arrows(explanation), _caption(explanation)),
        origin=(("computed in", duration(explanation.seconds)), *contents.provenance.manifest),
        origin_tables=(version_table(contents), file_table(contents)),
    )


def _summary(contents: Contents, explanation: Explanation) -> tuple[tuple[str, str], ...]:
    recorded = ("Recorded", recorded_sentence(contents))
    if explanation.answer is not None:
        return (recorded, *explanation.answer.parts)
    left_out = "; ".join(
        cause.id if cause.cable is None else f"{cause.id} of cable {cause.cable}" for cause in explanation.effects
    )
    chi2, rms = explanation.chi2_per_dof, explanation.rms_mm
    figures = [x for x in (chi2.before, chi2.after, rms.before, rms.after) if x is not None and isfinite(x)]
    shown = "Held-out windows could not be judged."
    if len(figures) == 4:
        shown = (
            f"In held-out windows χ²/dof falls from {figures[0]:.3g} to {figures[1]:.3g}, "
            f"and the rms error of the markers from {figures[2]:.3g} to {figures[3]:.3g} mm."
        )
    verdict = VERDICTS[explanation.verdict][2:].capitalize()
    named = f"Left out: {left_out}." if left_out else f"{verdict}: no effect is named."
    return (recorded, ("Found", named), ("Proof", shown))


def _arrows(explanation: Explanation) -> list[tuple[np.ndarray, np.ndarray]]:
    unknown = explanation.unknown
    if unknown is None or unknown.field is None:
        return []
    few = unknown.field.thinned(ARROWS)
    return list(zip(few.centres, few.forces, strict=True))


def _caption(explanation: Explanation) -> str:
    drawn = "The robot: pulleys with their cable's number, the platform at rest in each window, recorded paths"
    return f"{drawn}; green: the unknown force." if _arrows(explanation) else f"{drawn}."
