"""Puts a report together: `make_page` from what a folder holds and what was identified; `html.render` sets it."""

import csv
import io
from contextlib import suppress
from dataclasses import dataclass

from fidim_lab.app.formats.body_text import python_snippet, toml, urdf
from fidim_lab.app.report.contents.folder import Contents
from fidim_lab.app.report.drawings import figures
from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.figures import correlations
from fidim_lab.app.report.drawings.scene import scene, views
from fidim_lab.app.report.drawings.solid import Solid, solid
from fidim_lab.app.report.drawings.svg import points_for
from fidim_lab.app.report.sections import tables, words
from fidim_lab.app.report.sections.explained import ExplanationSection
from fidim_lab.app.report.sections.numerals import duration, short
from fidim_lab.app.report.sections.paper import is_papers_robot
from fidim_lab.app.report.sections.tables import MARKS, ReportTable
from fidim_lab.app.report.sections.windows import WindowSection, section
from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.identification.results.result_file import ResultTable
from fidim_lab.identification.results.validation import expected_sigma_perp
from fidim_lab.model.mechanism import Mechanism

KINDS = ("moving", "settling", "checks", "hand", "recording")
"""what the timeline tells apart"""


@dataclass(frozen=True)
class Copy:
    """One text."""

    name: str
    text: str


@dataclass(frozen=True)
class Page:
    """Everything that the template sets, in words."""

    title: str
    badges: tuple[str, ...]
    summary: tuple[tuple[str, str], ...]
    """what a sentence is about, the sentence"""
    warnings: tuple[str, ...]
    parameters: Drawing | None
    correlations: Drawing | None
    parameter_tables: tuple[ReportTable, ...]
    copies: tuple[Copy, ...]
    explanation: ExplanationSection | None
    solid: Solid
    robot: tuple[Drawing, ...]
    cross_validation: Drawing | None
    windows_table: ReportTable | None
    windows: tuple[WindowSection, ...]
    rejected: ReportTable | None
    timeline: Drawing | None
    incidents: ReportTable | None
    trials: ReportTable | None
    imported: ReportTable | None
    origin: tuple[tuple[str, str], ...]
    """facts of the provenance"""
    origin_tables: tuple[ReportTable, ...]
    kind: str = "Free-motion identification"


def make_page(
    contents: Contents,
    result: IdentificationResult | None,
    trust: str,
    explanation: ExplanationSection | None = None,
) -> Page:
    """The page of a folder. `trust`: how far to trust the result, or why there is none."""
    campaign = contents.campaign
    verdicts = {} if result is None else {verdict.id: verdict for verdict in result.windows}
    removed = () if result is None else result.removed
    mechanism = Mechanism(campaign.robot)
    body = campaign.robot.nominal if result is None else result.body
    drawn, points = scene(campaign, mechanism, body), points_for(len(campaign.windows))
    robot = tuple(Drawing(svg, f"The robot {seen}.") for seen, svg in views(drawn))
    return Page(
        title=campaign.name,
        badges=_badges(contents, result),
        summary=_summary(contents, result, trust, explanation),
        warnings=() if result is None else result.warnings,
        parameters=None if result is None else _parameters(contents, result),
        correlations=None if result is None else correlations(result),
        parameter_tables=() if result is None else _parameter_tables(contents, result),
        copies=() if result is None else copies(result, campaign.robot.mass),
        explanation=explanation,
        solid=solid(drawn),
        robot=robot,
        cross_validation=None if result is None else _cross_validation(result),
        windows_table=None if result is None else tables.window_table(result, contents.story),
        windows=tuple(
            section(contents, window, verdicts.get(window.id), (mechanism, body), points, removed)
            for window in campaign.windows
        ),
        rejected=tables.rejected_table(contents),
        timeline=_timeline(contents),
        incidents=None if contents.story is None else tables.incident_table(contents.story),
        trials=None if contents.story is None else tables.trials_table(contents.story),
        imported=tables.imported_table(contents),
        origin=(*_origin(contents, result), *contents.provenance.manifest),
        origin_tables=(*tables.drive_tables(contents), tables.version_table(contents), tables.file_table(contents)),
    )


def _badges(contents: Contents, result: IdentificationResult | None) -> tuple[str, ...]:
    badges: list[str] = []
    if contents.truth is not None:
        badges.append("simulated")
    if contents.imported is not None or contents.takes is not None:
        badges.append("imported")
    if contents.story is not None:
        badges.append(f"run: {MARKS[contents.story.outcome]}")
    if result is None:
        return (*badges, "✗ nothing identified")
    sign = "✓" if result.outcome.good else "✗"
    return (*badges, f"{sign} {result.outcome.name.lower().replace('_', ' ')} ({result.method.value})")


def _summary(
    contents: Contents, result: IdentificationResult | None, trust: str, explanation: ExplanationSection | None
) -> tuple[tuple[str, str], ...]:
    """The body of the model that is complete comes first; what was identified without it is told beside that."""
    recorded = ("Recorded", words.recorded_sentence(contents))
    left_out = () if explanation is None else (("Left out", explanation.sentence),)
    if result is None:
        return (recorded, ("Found", "Nothing was identified."), ("Why", trust), *left_out)
    rows, gauge = tables.parameter_rows(result, _true(contents)), tables.gauge_rows(result, _true(contents))
    found, beside = words.found_sentence(rows, gauge), words.truth_sentence(rows)
    if explanation is not None and explanation.completes:
        without = " ".join(one for one in (found, trust, beside) if one)
        return (recorded, ("Found", explanation.sentence), ("Without it", without))
    truth = (("Truth", beside),) if beside else ()
    return (recorded, ("Found", found), ("Trust", trust), *truth, *left_out, ("Next", result.answer.next))


def _true(contents: Contents) -> Body | None:
    return None if contents.truth is None else contents.truth.body


def _parameters(contents: Contents, result: IdentificationResult) -> Drawing:
    rows = tables.parameter_rows(result, _true(contents)) + tables.gauge_rows(result, _true(contents))
    caption = "Identified parameters with their intervals, and other known values."
    return Drawing(figures.parameters(rows), caption, "parameters")


def _parameter_tables(contents: Contents, result: IdentificationResult) -> tuple[ReportTable, ...]:
    true = _true(contents)
    papers_robot = true is None and is_papers_robot(contents.campaign.robot)
    return tables.parameter_tables(result, true, papers_robot=papers_robot)


def _cross_validation(result: IdentificationResult) -> Drawing | None:
    found = tables.bars(result.windows)
    if not found:
        return None
    expected = None
    if result.sigma_W is not None:
        expected = expected_sigma_perp(result.sigma_W, result.body, result.freedoms)
    held_out = sum(bar.held_out for bar in found)
    caption = "σ⊥ (Eq. 50) of each window against σ_W (Eq. 31)" + (
        f" = {short(result.sigma_W)} m/s²; the expected σ⊥ is √λ ‖χ‖ σ_W = {short(expected)}."
        if expected is not None
        else "."
    )
    if not held_out:
        caption += " No window was held out, so this is not an independent test."
    return Drawing(figures.cross_validation(found, result.sigma_W, expected), caption, "cross-validation")


def _timeline(contents: Contents) -> Drawing | None:
    story = contents.story
    if story is None or not story.bouts:
        return None
    windows = [told.id for told in story.windows]
    marks = [incident.t for incident in story.incidents]
    dotted = "; dotted: a problem" if marks else ""
    return Drawing(
        figures.timeline(windows, KINDS, story.bouts, marks),
        f"Steps of the run over time, by window{dotted}.",
        "timeline",
    )


def _origin(contents: Contents, result: IdentificationResult | None) -> tuple[tuple[str, str], ...]:
    facts: list[tuple[str, str]] = []
    truth, story = contents.truth, contents.story
    if story is not None:
        stood = truth is not None and story.began == story.ended  # a jumping clock leaves the time of day as it was
        when = f"{duration(story.seconds)} of simulated time" if stood else f"from {story.began} to {story.ended}"
        facts.append(("journal", when))
        if story.held:
            facts.append(("state at the end", story.held))
    if truth is not None:
        facts.append(("effects added by the simulator", ", ".join(truth.case.label) or truth.case.title or "nothing"))
        if truth.seed is not None:
            facts.append(("seed", str(truth.seed)))
    if result is not None:
        facts.append(("method", result.method.value))
        facts.append(("C of the equations (Eq. 40)", short(result.C)))
        facts.append(("rms of the equations, divided by that of marker noise", short(result.noise_ratio)))
    return tuple(facts)


def copies(result: IdentificationResult, mass: float) -> tuple[Copy, ...]:
    """The result in each form. mass (kg): the robot file's, for URDF, which is left out for an impossible body."""
    table = ResultTable.model_validate(result.to_json())
    texts = [
        Copy("TOML: value, sd and CAD of each parameter, SI, about P, per unit mass", toml(table, None)),
        Copy("CSV: the same, one row per parameter", _csv(result)),
        Copy("Python", python_snippet(table, None)),
    ]
    with suppress(InfeasibleError):
        texts.append(Copy(f"URDF inertial, about G, with the robot file's mass of {mass:g} kg", urdf(table, mass)))
    return tuple(texts)


def _csv(result: IdentificationResult) -> str:
    buffer = io.StringIO()
    out = csv.writer(buffer, lineterminator="\n")
    out.writerow(["parameter", "value", "sd", "spread", "nominal", "unit"])
    for name, parameter in result.parameters.items():
        spread = "" if parameter.spread is None else repr(float(parameter.spread))
        values = [repr(float(x)) for x in (parameter.value, parameter.sd)]
        unit = "m" if name.startswith("s_") else "m^2"
        out.writerow([name, *values, spread, repr(float(parameter.nominal)), unit])
    return buffer.getvalue()
