"""A fit of several campaigns: what was predicted from what, and how far it may be trusted."""

from fidim_lab.app.report.sections.numerals import short
from fidim_lab.app.report.sections.tables import ReportTable
from fidim_lab.identification.joint.identify import JointResult
from fidim_lab.units import millimetres


def cross_table(found: JointResult) -> tuple[ReportTable, ...]:
    """A row for each pair of a fit and a campaign that it has not seen; no table without one."""
    rows: list[tuple[str, ...]] = []
    for one in found.cross:
        known = [millimetres(window.rms) for window in one.windows if window.rms is not None]
        fitted = (
            "all" if len(one.fitted) == len(found.campaigns) else " + ".join(found.campaigns[k] for k in one.fitted)
        )
        held = " (held out)" if one.predicted in one.fitted else ""
        figures = (one.rms, one.of_pose, one.median)
        shown = ("–" if value is None else short(millimetres(value)) for value in figures)
        largest = short(max(known)) if known else "–"
        rows.append(
            (fitted, found.campaigns[one.predicted] + held, f"{len(known)}/{len(one.windows)}", *shown, largest)
        )
    names = ("fitted on", "predicted", "windows", "rms, mm", "of the pose, mm", "median, mm", "largest, mm")
    caption = "Fitted on some campaigns, predicted on others; only the initial states are fitted again"
    return (ReportTable(caption, names, tuple(rows)),) if rows else ()


def closing(found: JointResult) -> str:
    """How far this may be trusted."""
    if not found.result.outcome.answers:
        return found.result.outcome.value
    return (
        "One body and one geometry explain all campaigns down to noise; every ± includes the uncertainty of the survey."
    )
