"""The report's summary in sentences: what was recorded, what was found, how it compares with a known truth."""

import numpy as np

from fidim_lab.app.formats.explanation_file import ExplanationTable
from fidim_lab.app.report.contents.folder import Contents
from fidim_lab.app.report.drawings.figures import ParameterRow
from fidim_lab.app.report.sections.numerals import duration, interval, short
from fidim_lab.app.report.sections.tables import stated
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Role
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.say import counted
from procedures.outcomes import Outcome


def recorded_sentence(contents: Contents) -> str:
    """What was recorded, on which robot, and how the run ended."""
    campaign, story = contents.campaign, contents.story
    robot = campaign.robot
    parts = [
        f"{_windows(campaign)} of {counted(robot.n, 'cable')} and {robot.mass:g} kg "
        f"({counted(len(robot.markers), 'marker')} at {campaign.sample_rate:g} Hz)"
    ]
    if contents.imported is not None:
        parts.append(f"imported from another laboratory's recording {contents.imported.name}")
    if contents.takes is not None:
        parts.append(f"imported from {counted(len(contents.takes.takes), 'take')} ({contents.takes.kind})")
    if story is not None:
        rejected = story.recordings - len(campaign.windows)
        if rejected > 0:
            parts.append(f"{counted(rejected, 'further recording')} {'was' if rejected == 1 else 'were'} rejected")
        how = "was interrupted" if story.outcome is Outcome.UNSET else f"ended with “{story.outcome.value}”"
        parts.append(f"the run {how} after {duration(story.seconds)}")
    return "; ".join(parts) + "."


def _windows(campaign: Campaign) -> str:
    if not campaign.windows:
        return "No window was recorded on a robot"
    held_out = len(campaign.of_role(Role.VALIDATE))
    total = sum(window.duration for window in campaign.windows)
    roles = f"{len(campaign.windows) - held_out} to identify from, {held_out} held out"
    return (
        f"{counted(len(campaign.windows), 'window')} of free motion ({roles}; {duration(total)} in all) "
        f"{'was' if len(campaign.windows) == 1 else 'were'} recorded on a robot"
    )


def found_sentence(parameters: tuple[ParameterRow, ...], gauge: tuple[ParameterRow, ...]) -> str:
    """Where G is, and the principal entries of I about it, beside CAD."""
    s, central = parameters[:3], gauge[1:4]
    return (
        f"The centre of mass lies at s = {_with_cad(s, 'mm')} from P, "
        f"and per unit mass I_xx, I_yy, I_zz about it are {_with_cad(central, '· 10⁻³ m²')}."
    )


def _with_cad(rows: tuple[ParameterRow, ...], unit: str) -> str:
    values = ", ".join(f"{interval(row.value, stated(row))}" for row in rows)
    nominal = ", ".join(f"{row.nominal or 0.0:.4g}" for row in rows)
    return f"({values}) {unit} (CAD: {nominal})"


def explained_sentence(found: ExplanationTable) -> str:
    """What `fidim explain` made of it, and the body with that."""
    held = found.held_out.chi2_per_dof
    better = f"held-out χ²/dof changes from {short(held.before)} to {short(held.after)}"
    if held.before is None or held.after is None:
        better = "no window was held out to test it"
    names = " and ".join(", ".join(one.label for one in found.effects).rsplit(", ", 1))
    thousandths = [
        interval(1e3 * found.parameters[name].value, 1e3 * found.parameters[name].sd) for name in PARAMETER_NAMES[:6]
    ]
    s, inertia = ", ".join(thousandths[:3]), ", ".join(thousandths[3:])
    where = f"With it the centre of mass lies at s = ({s}) mm from P, and per unit mass I_xx, I_yy, I_zz about P are "
    where += f"({inertia}) · 10⁻³ m²"
    match found.verdict:
        case Verdict.NOTHING_MISSING:
            return "fidim explain finds nothing missing from the model."
        case Verdict.EXPLAINED:
            return f"fidim explain names what is missing, {names}: {better}. {where}."
        case Verdict.PARTLY_EXPLAINED:
            return (
                f"fidim explain names a part of what is missing, {names}: {better}. {where}; the rest is unexplained."
            )
        case Verdict.UNKNOWN_PHYSICS:
            return f"fidim explain finds physics that is not in its catalogue: {better}."
        case Verdict.SENSOR_FAULT:
            return "fidim explain finds a fault of a sensor, not of the model."


def truth_sentence(rows: tuple[ParameterRow, ...]) -> str:
    """How far off the result is where the truth is known; empty elsewhere."""
    known = [(row, abs(row.value - row.true) / stated(row)) for row in rows if row.true is not None and stated(row)]
    if not known:
        return ""
    worst, ratio = max(known, key=lambda pair: pair[1])
    inside = sum(ratio <= 2 for _, ratio in known)
    rms = float(np.sqrt(np.mean([ratio**2 for _, ratio in known])))
    return (
        f"The true values are known: {inside} of {len(known)} parameters lie within twice the stated uncertainty. "
        f"The errors are {rms:.1f} times the uncertainty rms, and at most {ratio:.1f} times ({worst.name})."
    )
