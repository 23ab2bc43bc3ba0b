"""Tables of the report, as text cells: parameters, gauge-free values, windows, attempts, what was rejected, files.

A column appears only where something is known for it. The page's template sets them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

from rich.table import Table

from fidim_lab.app.report.contents.folder import Contents, GradeRow, Imported, ImportedTakes
from fidim_lab.app.report.contents.story import Attempt, Story, ToldMeasurement
from fidim_lab.app.report.drawings.figures import Bar, ParameterRow
from fidim_lab.app.report.sections.incidents import incident_rows
from fidim_lab.app.report.sections.numerals import decimals, duration, fixed, short, size
from fidim_lab.app.report.sections.paper import FOUND
from fidim_lab.app.terminal import console
from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.identification.results.result import IdentificationResult, InertialParameter, WindowVerdict
from fidim_lab.identification.results.validation import expected_sigma_perp
from fidim_lab.units import degrees, millimetres, percent, plain, signed
from procedures.outcomes import Outcome

MARKS = {
    Outcome.PASS: "✓ pass",
    Outcome.MARGINAL: "~ marginal",
    Outcome.SKIPPED: "– skipped",
    Outcome.UNSET: "? open",
    Outcome.FAIL: "✗ fail",
    Outcome.ABORTED: "✗ aborted",
    Outcome.ERROR: "✗ error",
}
"""a sign and a word for each outcome: never colour alone"""


@dataclass(frozen=True)
class ReportTable:
    """Text cells under column names; the first column is the row's name."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: bool = True
    """whether all columns but the first hold numbers"""

    @property
    def on_screen(self) -> Table:
        """The same for a terminal."""
        return console.table(self.caption, self.columns, self.rows, left=1 if self.numbers else len(self.columns))


def parameter_rows(result: IdentificationResult, true: Body | None) -> tuple[ParameterRow, ...]:
    """The nine parameters in mm and 1e-3 m², the first picture and the first table alike."""
    values = [None] * 9 if true is None else [float(v) for v in true.vector]
    return tuple(
        _row(name, result.parameters[name], value) for name, value in zip(PARAMETER_NAMES, values, strict=True)
    )


def gauge_rows(result: IdentificationResult, true: Body | None) -> tuple[ParameterRow, ...]:
    """What does not depend on where P is put: s_z from the plane of the attachments (mean a_z), and I about G."""
    s_z, plane = result.parameters["s_z"], result.attachment_plane
    relative = InertialParameter(
        s_z.value - plane, s_z.sd, s_z.sd_bootstrap, s_z.sd_jackknife, s_z.nominal - plane, seen=s_z.seen
    )
    central = [None] * 6 if true is None else _central(true)
    return (
        _row("s_z − a_z", relative, None if true is None else float(true.com[2]) - plane),
        *(
            _row(f"{name} about G", parameter, value)
            for (name, parameter), value in zip(result.about_com().items(), central, strict=True)
        ),
    )


def _central(body: Body) -> list[float]:
    inertia = body.inertia_about_com
    return [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _row(name: str, parameter: InertialParameter, true: float | None) -> ParameterRow:
    """Both kinds happen to read well in thousandths."""
    return ParameterRow(
        name=name,
        value=millimetres(parameter.value),
        sd=millimetres(parameter.sd),
        spread=None if parameter.spread is None else millimetres(parameter.spread),
        nominal=millimetres(parameter.nominal),
        true=None if true is None else millimetres(true),
        seen=parameter.seen,
    )


def stated(row: ParameterRow) -> float:
    """The uncertainty to believe: the larger of nominal sd and spread."""
    return max(row.sd, row.spread or 0.0)


def parameter_tables(
    result: IdentificationResult, true: Body | None = None, *, papers_robot: bool = False
) -> tuple[ReportTable, ReportTable]:
    """All nine, and what does not depend on the choice of P; true: what a simulator hid."""
    beside = paper_columns(result) if papers_robot else {}
    plane = f"the plane of the attachments (mean a_z = {millimetres(result.attachment_plane):.1f} mm)"
    return (
        parameter_table(
            "Inertial parameters per unit mass, about P: s in mm, I in 10⁻³ m²",
            parameter_rows(result, true),
            {"re-fit": refits(result)} | beside,
        ),
        parameter_table(
            f"Independent of the choice of P: s_z from {plane} in mm, I about G in 10⁻³ m²",
            gauge_rows(result, true),
            {},
        ),
    )


def truth_table(rows: Sequence[ParameterRow]) -> ReportTable:
    """Of parameters whose true values are known: the error in units of the stated uncertainty."""
    names = ("parameter", "identified", "±", "true", "error", "error, %", "error / ±")
    cells: list[tuple[str, ...]] = []
    for row in rows:
        true = row.true or 0.0
        error, wide, places = row.value - true, stated(row), decimals(stated(row))
        known = (fixed(value, places) for value in (row.value, wide, true))
        share, in_sd = (signed(a / b, n) if b else "" for a, b, n in ((100 * error, true, 3), (error, wide, 1)))
        cells.append((row.name, *known, signed(error, places), share, in_sd))
    caption = "Identified and true parameters per unit mass, about P: s in mm, I in 10⁻³ m²"
    return ReportTable(caption, names, tuple(cells))


def parameter_table(caption: str, rows: Sequence[ParameterRow], further: Mapping[str, Sequence[str]]) -> ReportTable:
    """Values with what is known of them; `further` columns, if not empty, follow CAD: a cell for each row."""
    more = {name: cells for name, cells in further.items() if cells}
    spread, true = any(row.spread is not None for row in rows), any(row.true is not None for row in rows)
    there = (*[True] * 3, spread, spread, True, *[True] * len(more), true, true, true)
    names = ("parameter", "identified", "sd", "spread", "spread, %", "CAD", *more, "true", "error", "error / ±")
    cells = [_cells(row, [column[k] for column in more.values()]) for k, row in enumerate(rows)]
    return ReportTable(caption, tuple(compress(names, there)), tuple(tuple(compress(row, there)) for row in cells))


def refits(result: IdentificationResult) -> tuple[str, ...]:
    """Each parameter after the non-essential ones were dropped; empty where that was not done."""
    if all(p.without_non_essential is None for p in result.parameters.values()):
        return ()
    return tuple(
        "dropped"
        if name in result.non_essential
        else fixed(_milli(p.without_non_essential), decimals(millimetres(max(p.sd, p.spread or 0.0))))
        for name, p in result.parameters.items()
    )


def paper_columns(result: IdentificationResult) -> dict[str, tuple[str, ...]]:
    """What the paper found, with the digits of ours."""
    return {
        name: tuple(
            fixed(millimetres(value), decimals(stated(row)))
            for value, row in zip(values, parameter_rows(result, None), strict=True)
        )
        for name, values in FOUND.items()
    }


def _cells(row: ParameterRow, further: Sequence[str]) -> tuple[str, ...]:
    """Digits as the larger uncertainty leaves them."""
    places = decimals(stated(row))
    if not row.seen:
        true = fixed(row.true, places)
        return (row.name, "not determined", "", "", "", fixed(row.nominal, places), *further, true, "", "")
    share = None if row.spread is None or row.value == 0 else row.spread / abs(row.value)
    error = None if row.true is None else row.value - row.true
    return (
        row.name,
        fixed(row.value, places),
        fixed(row.sd, max(places, decimals(row.sd))),
        fixed(row.spread, places),
        "" if share is None else "> 100" if share > 1 else f"{percent(share):.2g}",
        fixed(row.nominal, places),
        *further,
        fixed(row.true, places),
        "" if error is None else signed(error, places),
        "" if error is None or not stated(row) else signed(error / stated(row), 1),
    )


def window_table(result: IdentificationResult, story: Story | None = None) -> ReportTable:
    """One line a window: what the result means for it, and how often it was recorded."""
    windows = result.windows
    attempts = {told.id: sum(a.recorded for a in told.attempts) for told in story.windows} if story else {}
    names = ("window", "role", "pose from", "samples", "σ⊥, m/s²", "rms, mm", "χ²/dof", "conditioning", "recordings")
    there = (*[True] * 8, bool(attempts))
    rows = [(*verdict_cells(window), str(attempts.get(window.id, "–"))) for window in windows]
    scale = ""
    if result.sigma_W is not None:
        expected = expected_sigma_perp(result.sigma_W, result.body, result.freedoms)
        scale = f" (σ_W = {short(result.sigma_W)}, so σ⊥ ≈ {short(expected)} is expected)"
    caption = (
        f"All windows. σ⊥: residual of the equations of motion{scale}; rms and χ²/dof: recorded against predicted from "
        f"the fitted initial state alone. {result.no_sigma}"
    ).rstrip()
    return ReportTable(caption, tuple(compress(names, there)), tuple(tuple(compress(row, there)) for row in rows))


def verdict_cells(window: WindowVerdict) -> tuple[str, ...]:
    """id, role, variant, samples, σ⊥, rms, χ²/dof, conditioning."""
    numbers = (window.sigma_perp, window.rms_mm, window.chi2_per_dof, window.conditioning)
    pose_from = (window.variant or "–") if window.used else "not used"
    return (window.id, window.role.value, pose_from, str(window.samples), *map(short, numbers))


def bars(windows: Sequence[WindowVerdict]) -> tuple[Bar, ...]:
    """σ⊥ of every window that has one, held-out ones first."""
    found = [Bar(w.id, w.sigma_perp, w.role is Role.VALIDATE) for w in windows if w.sigma_perp is not None]
    return tuple(sorted(found, key=lambda bar: not bar.held_out))


def attempt_table(attempts: Sequence[Attempt]) -> ReportTable:
    """Every try at one window."""
    rows = [(str(a.number), duration(a.begin), MARKS[a.outcome], a.reason or _clean(a)) for a in attempts]
    return ReportTable("Attempts", ("attempt", "at", "verdict", "why"), tuple(rows), numbers=False)


def _clean(attempt: Attempt) -> str:
    return f"all {len(attempt.measurements)} checks passed" if attempt.measurements else ""


def check_table(measurements: Sequence[ToldMeasurement]) -> ReportTable:
    """What the check of a recording measured, against what is allowed."""
    rows = [
        (seen.name, f"{short(seen.value)} {seen.unit}".strip(), _allowed(seen), MARKS[seen.outcome])
        for seen in measurements
    ]
    return ReportTable("Checks of the recording", ("measurement", "found", "allowed", ""), tuple(rows), numbers=False)


def _allowed(seen: ToldMeasurement) -> str:
    if seen.low is not None and seen.high is not None:
        return f"{plain(seen.low, 4)} to {plain(seen.high, 4)} {seen.unit}".strip()
    if seen.low is not None:
        return f"≥ {plain(seen.low, 4)} {seen.unit}".strip()
    return "" if seen.high is None else f"≤ {plain(seen.high, 4)} {seen.unit}".strip()


def rejected_table(contents: Contents) -> ReportTable | None:
    """Recordings and windows that did not become part of the campaign, with the reason; None without any."""
    rows: list[tuple[str, ...]] = []
    kept = set(contents.rejected)
    for told in contents.story.windows if contents.story else ():
        for attempt in told.attempts:
            if not attempt.outcome.usable:
                file = f"{told.id}-attempt{attempt.number}.csv"
                there = file in kept
                kept.discard(file)
                reason = attempt.reason or "interrupted"
                rows.append((told.id, str(attempt.number), reason, f"rejected/{file}" if there else "–"))
        if told.outcome is not Outcome.UNSET and not told.outcome.usable:
            rows.append((told.id, "", f"given up: {told.reason}", "–"))
    rows += _never_accepted(contents.story)
    rows += [("", "", "no journal with the reason", f"rejected/{name}") for name in sorted(kept)]
    names = ("window", "attempt", "reason", "kept as")
    return ReportTable("Rejected recordings", names, tuple(rows), numbers=False) if rows else None


def _never_accepted(story: Story | None) -> list[tuple[str, ...]]:
    """One row for all windows that a run which ended early left open."""
    left = [told.id for told in story.windows if told.outcome is Outcome.UNSET] if story else []
    return [("", "", f"the run ended before these were accepted: {', '.join(left)}", "–")] if left else []


def incident_table(story: Story) -> ReportTable | None:
    """What went amiss in a run; None when nothing did."""
    rows = [
        (when, one.window if when == duration(one.t) else "", one.what, MARKS[one.outcome], says)
        for one, when, says in incident_rows(story.incidents)
    ]
    names = ("at", "window", "step", "outcome", "message")
    return ReportTable("Problems during the run", names, tuple(rows), numbers=False) if rows else None


def imported_table(contents: Contents) -> ReportTable | None:
    """What an import found and decided; None where the folder was not imported."""
    if contents.takes is not None:
        return takes_table(contents.takes)
    return None if contents.imported is None else import_table(contents.imported)


def takes_table(imported: ImportedTakes) -> ReportTable:
    """What was decided for each take, what is to be checked, and why one was left out."""
    rows: list[tuple[str, str, str]] = []
    for take in imported.takes:
        logged = [] if take.log is None else [f"log {Path(take.log).name}"]
        said = [("file", "; ".join([Path(take.file).name, *logged]))]
        said += [("check", warning) for warning in take.warnings] + [("decided", words) for words in take.decided]
        said += [("left out", take.refused)] if take.refused else []
        rows += [(take.id, kind, words) for kind, words in said]
    rows += [(name, "not read", why) for name, why in imported.unread.items()]
    return ReportTable(
        f"Imported as {imported.kind}: {imported.name}", ("take", "", "what"), tuple(rows), numbers=False
    )


def import_table(imported: Imported) -> ReportTable:
    """What an import found."""
    cluster, registration, clock = imported.cluster, imported.registration, imported.clock.log_minus_markers
    rows = (
        *((f"source: {what}", name) for what, name in imported.sources.items()),
        ("frames used", f"{cluster.frames_used} of {cluster.frames}"),
        ("noise of a marker coordinate", f"{millimetres(cluster.noise):.3f} mm"),
        ("marker distances constant to", f"{millimetres(cluster.rms):.3f} mm rms"),
        ("cable lengths constant to", f"{millimetres(registration.rms):.2f} mm rms, after correcting for stretch"),
        ("cable stretch", f"{registration.compliance * 1e6:.1f} µm/N"),
        ("the two verticals differ by", f"{degrees(registration.tilt):.2f}°"),
        ("log clock − marker clock", f"{clock.offset:.4f} ± {clock.sd:.4f} s"),
    )
    return ReportTable(f"Imported as {imported.kind}: {imported.name}", ("found", "value"), rows, numbers=False)


def drive_tables(contents: Contents) -> tuple[ReportTable, ...]:
    """How the drives met their requirements; winches of one table share it."""
    together: dict[tuple[GradeRow, ...], list[str]] = {}
    for drive in contents.drives:
        if drive.grades:
            together.setdefault(drive.grades, []).append(drive.config.name)
    names = ("requirement", "grade", "met", "by", "replacement")
    return tuple(
        ReportTable(
            f"What the drives of {', '.join(winches)} can do",
            names,
            tuple((g.requirement, g.grade, g.met, g.found, g.instead) for g in grades),
            numbers=False,
        )
        for grades, winches in together.items()
    )


def file_table(contents: Contents) -> ReportTable:
    """The folder's files with their checksums."""
    rows = [(file.name, size(file.size), file.sha256) for file in contents.provenance.files]
    return ReportTable("Files that this report is based on", ("file", "size", "SHA-256"), tuple(rows), numbers=False)


def version_table(contents: Contents) -> ReportTable:
    """What computed it."""
    return ReportTable("Computed with", ("software", "version"), contents.provenance.versions, numbers=False)


def _milli(value: float | None) -> float | None:
    return None if value is None else millimetres(value)


def trials_table(story: Story) -> ReportTable | None:
    """Each stop that was tried, with what the winch's own encoder told; None where none was."""
    if not story.trials:
        return None
    rows = [
        (tried.window, tried.trial, MARKS[tried.outcome], *_stop_cells(tried.measurements), tried.reason)
        for tried in story.trials
    ]
    columns = (
        "winch",
        "trial",
        "",
        "time, s",
        "allowed",
        "distance, mm",
        "allowed",
        "then, mm",
        "without power, mm",
        "",
    )
    caption = f"Stops proven by trial, without load, at {short(story.trials[0].speed)} m/s, by each winch's own encoder"
    return ReportTable(caption, columns, tuple(rows), numbers=False)


def _stop_cells(seen: Sequence[ToldMeasurement]) -> tuple[str, ...]:
    """Time and way with what was allowed, and what it moved with power and without it afterwards."""
    cells = ["", "", "", "", "", ""]
    for one in seen:
        factor = 1e3 if one.unit == "m" else 1.0
        value = "" if one.value is None else short(factor * one.value)
        if one.name.startswith(("time", "way")):
            at = 0 if one.name.startswith("time") else 2
            cells[at : at + 2] = value, "" if one.high is None else short(factor * one.high)
        elif one.name.startswith("moved"):
            cells[5 if "power" in one.name else 4] = value
    return tuple(cells)
