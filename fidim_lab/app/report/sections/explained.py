"""What was left out and the proof, as a section of a page: tables in words, pictures of before and after."""

from collections.abc import Mapping
from dataclasses import dataclass

from fidim_lab.app.formats.explanation_file import ExplanationTable, FamilyTable, UnknownTable
from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.app.report.contents.proof import ProofOfCause
from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.sections import proof_figures
from fidim_lab.app.report.sections.numerals import decimals, fixed, short
from fidim_lab.app.report.sections.tables import ReportTable
from fidim_lab.app.report.sections.words import explained_sentence
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter
from fidim_lab.units import millimetres, percent, signed

VERDICTS = {
    Verdict.NOTHING_MISSING: "✓ nothing missing",
    Verdict.EXPLAINED: "✓ explained",
    Verdict.PARTLY_EXPLAINED: "~ partly explained",
    Verdict.UNKNOWN_PHYSICS: "✗ unknown physics",
    Verdict.SENSOR_FAULT: "✗ sensor fault",
}
"""a sign and words: never colour alone"""


@dataclass(frozen=True)
class ExplanationSection:
    """What the template sets."""

    verdict: str
    sentence: str
    """for the page's summary"""
    completes: bool
    """whether it names what is missing, so that its body is the one to believe"""
    message: str
    next: str
    effects: tuple[ReportTable, ...]
    places: tuple[str, ...]
    unknown: tuple[str, ...]
    field: tuple[Drawing, ...]
    before_after: tuple[ReportTable, ...]
    drawings: tuple[Drawing, ...]
    notes: tuple[str, ...]
    tried: tuple[ReportTable, ...]


def explained(found: ExplanationTable, shown: ProofOfCause, noise: float) -> ExplanationSection:
    """The section. `shown`: `proof` of the same explanation; noise: of a marker coordinate (m), by the robot file."""
    unknown = found.unknown
    field = None if unknown is None else unknown.field
    return ExplanationSection(
        verdict=VERDICTS[found.verdict],
        sentence=explained_sentence(found),
        completes=found.verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED),
        message=found.message,
        next=found.next_experiment or "",
        effects=effect_tables(found),
        places=tuple(dict.fromkeys(place.says for place in found.where)),
        unknown=() if unknown is None else unknown.words,
        field=() if field is None else proof_figures.field_drawings(field.field),
        before_after=(figures_table(found), *channel_tables(found), shift_table(found)),
        drawings=(proof_figures.shifts(found), *proof_figures.drawings(shown, noise)),
        notes=shown.notes,
        tried=(ranking_table(found), *_families(unknown), *_untested(found)),
    )


def effect_tables(found: ExplanationTable) -> tuple[ReportTable, ...]:
    """Each effect, or term of a law without a name, with its sizes."""
    return (
        *(_sizes_table(f"{one.label}: {one.says}{_alike(one)}", one.parameters) for one in found.effects),
        *(_sizes_table(f"Like {term.like}: {term.says}", term.parameters) for term in found.law),
    )


def _alike(effect: EffectTable) -> str:
    return f"; these data cannot separate it from {', '.join(effect.alike)}" if effect.alike else ""


def _sizes_table(caption: str, parameters: Mapping[str, EffectParameter]) -> ReportTable:
    rows = [
        (name, short(p.value, 5), "at its limit" if p.sd is None else f"{p.sd:.2g}", p.unit)
        for name, p in parameters.items()
    ]
    return ReportTable(caption, ("parameter", "value", "sd", "unit"), tuple(rows))


def figures_table(found: ExplanationTable) -> ReportTable:
    """Figures of windows that were not fitted."""
    judged = {
        "test windows": found.test,
        "each window by the others": found.left_out,
        "held-out windows": found.held_out,
    }
    rows: list[tuple[str, ...]] = []
    for windows, figures in judged.items():
        if figures is not None:
            chi2, rms = figures.chi2_per_dof, figures.rms_mm
            rows.append((windows, "χ²/dof", short(chi2.before), short(chi2.after), _gone(chi2)))
            rows.append((windows, "rms, mm", short(rms.before), short(rms.after), "–"))
    caption = "Windows that were not fitted; only their initial states are. χ²/dof = 1: only noise is left."
    return ReportTable(caption, ("windows", "figure", "before", "after", "excess removed"), tuple(rows))


def channel_tables(found: ExplanationTable) -> tuple[ReportTable, ...]:
    """What each channel shows beside the model."""
    rows = tuple(
        (
            one.channel,
            "noise" if one.white else "more than noise",
            f"{one.p:.2g}",
            "–" if one.trend_over_windows is None else f"{one.trend_over_windows:.2g}",
        )
        for one in found.channels
    )
    names = ("channel", "what the model leaves", "chance in noise", "chance of its course over the windows")
    return (ReportTable("Channels of the fitted windows, each by itself", names, rows),) if rows else ()


def _gone(one: Before) -> str:
    """The share of χ²/dof above 1 that has gone."""
    if one.before is None or one.after is None or one.before <= 1.0:
        return "–"
    return f"{percent(min(1.0, (one.before - one.after) / (one.before - 1.0))):.3g} %"


def shift_table(found: ExplanationTable) -> ReportTable:
    """The body before and after, and how far it moved in sd of the fit before."""
    rows: list[tuple[str, ...]] = []
    for name, after in found.parameters.items():
        before = found.parameters_before[name]
        places = decimals(millimetres(max(after.sd, 1e-12)))
        values = (after.nominal, before.value, after.value)
        rows.append(
            (
                name,
                *(fixed(millimetres(value), places) for value in values),
                f"{millimetres(before.sd):.2g}",
                f"{millimetres(after.sd):.2g}",
                signed((after.value - before.value) / before.sd, 1) if before.sd > 0 else "–",
            )
        )
    names = ("parameter", "CAD", "before", "after", "sd before", "sd after", "moved / sd before")
    caption = "Parameters about P, per unit mass: s in mm, I in 10⁻³ m²; where χ²/dof is above 1, sd includes its root."
    return ReportTable(caption, names, tuple(rows))


def ranking_table(found: ExplanationTable) -> ReportTable:
    """Every model that was fitted, then the best that were only scored."""
    rows = [
        (
            one.name,
            short(one.held_out_chi2_per_dof),
            "✓ possible" if one.plausible else "✗ impossible",
            f"{one.lost} {one.why}".strip(),
        )
        for one in found.ranking
    ]
    names = ("model", "held-out χ²/dof", "physically", "why")
    return ReportTable("Hypotheses, the best first", names, tuple(rows), numbers=False)


def _families(unknown: UnknownTable | None) -> tuple[ReportTable, ...]:
    """Unknown wrenches that were compared."""
    if unknown is None or not unknown.tried:
        return ()
    rows = [(one.label, *_weighed(one)) for one in unknown.tried]
    names = ("kind of wrench", "excess χ² explained, fitted windows", "windows left out in turn", "log-evidence")
    return (
        ReportTable("Unknown wrenches that were compared; a negative share makes the fit worse", names, tuple(rows)),
    )


def _weighed(one: FamilyTable) -> tuple[str, str, str]:
    fitted, left_out = ("–" if x is None else f"{percent(x):.0f} %" for x in (one.explained, one.left_out))
    return fitted, left_out, "–" if one.log_evidence is None else f"{one.log_evidence:.0f}"


def _untested(found: ExplanationTable) -> tuple[ReportTable, ...]:
    rows = tuple((id, "this version cannot test it") for id in found.untested)
    return (ReportTable("Not tested", ("effect", "why"), rows, numbers=False),) if rows else ()
