"""`fidim identify`: a campaign folder in, the identified body with its uncertainty out.

`run_identify` does it, `summary` shows it to a person, `table` parts of it are reused by the dry run. Warnings are in
the summary because they belong to the answer.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fidim_lab.app.analysis.pose_from import Posed, comparison, read_posed
from fidim_lab.app.analysis.scaling import Forms, scaling_table
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.choice import Choice, suited_method
from fidim_lab.identification.equations.estimators import Method, method_named
from fidim_lab.identification.identify import MODEL_ERROR, SPREAD_SEEN, identify
from fidim_lab.identification.mle.findings import OTHER_NOISE, closing
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.motion.recipe import BEST, PAPER, Recipe
from fidim_lab.identification.results.result import IdentificationResult, Outcome, Parameter, WindowVerdict
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.identification.results.validation import QUICK, THOROUGH, expected_sigma_perp
from fidim_lab.model.native import compiler
from fidim_lab.units import millimetres, percent

UNUSABLE = (Outcome.IMPOSSIBLE_BODY, Outcome.LOST_PHASE, Outcome.NOT_CONVERGED)
"""outcomes with which the command fails"""
FOLLOWED = 1.5
"""times their noise: maximum likelihood that follows the recordings so closely is not overruled, however it ended"""


def run_identify(
    campaign_folder: Path,
    method: str | None = None,
    *,
    paper: bool = False,
    predict: bool = True,
    poses: PoseSource = PoseSource.MOCAP,
) -> IdentificationResult:
    """Identify the body from a campaign folder.

    `method`: None takes what suits the campaign, and total least squares where maximum likelihood fails. `paper`: the
    paper's form to the letter (`recipe.PAPER`) instead of ours. `predict`: also simulate every window from its fitted
    initial state (half a second per 10 s window). `poses`: where they come from.
    Raises FileError for a wrong campaign, SetupError for an unknown method, RefusedError when no body is identified.
    """
    if paper and method not in (None, Method.TLS):
        raise SetupError(f"--paper is a form of total least squares; it does not go with --method {method}.")
    if method is not None:
        method_named(method)
    return identify_posed(read_posed(campaign_folder, poses), method, paper=paper, predict=predict)


def identify_posed(
    posed: Posed, method: str | None = None, *, paper: bool = False, predict: bool = True
) -> IdentificationResult:
    """As `run_identify`, from a campaign that is in memory."""
    asked = Method.TLS if paper else None if method is None else method_named(method)
    campaign = posed.campaign
    choice = suited_method(campaign) if asked is None else Choice(asked)
    recipe: Recipe = PAPER if paper else BEST
    checks = THOROUGH if predict else QUICK
    native = compiler() is not None
    result = identify(campaign, choice.method, recipe, checks, native=native)
    if asked is None and choice.method is Method.MLE and _unfollowed(result):
        why = (
            f"Maximum likelihood failed (--method mle shows it): {result.outcome.value} Total least squares, which "
            "needs no simulated motion, is shown instead."
        )
        try:
            instead = identify(campaign, Method.TLS, recipe, checks, native=native)
            choice, result = Choice(Method.TLS, why), replace(instead, fallback=why)
        except RefusedError:  # then what maximum likelihood says, though it failed, is all that there is
            pass
    said = (choice.why, *posed.notes) if choice.why else posed.notes
    said = (*said, *aligned(campaign))
    own = result.warnings if not posed.notes else tuple(w for w in result.warnings if not w.startswith(OTHER_NOISE))
    return replace(result, warnings=(*said, *own))


def _unfollowed(result: IdentificationResult) -> bool:
    """Whether maximum likelihood says nothing of the body."""
    failed = result.outcome in (Outcome.LOST_PHASE, Outcome.NOT_CONVERGED)
    return failed and (result.outcome is Outcome.LOST_PHASE or (result.noise_ratio or np.inf) > FOLLOWED)


def aligned(campaign: Campaign) -> tuple[str, ...]:
    """What was done about late markers, and what its uncertainty may come to; empty where nothing was."""
    known = campaign.alignment
    if known is None:
        return ()
    fastest = max((_fastest(window) for window in campaign.windows), default=0.0)
    return (
        f"Markers were {1e3 * known.lag:.2f} ms ± {1e3 * known.sd:.2f} ms late against the encoders, by a jog of "
        f"{known.at}; "
        "lengths and currents are those of the instants at which they were seen. The uncertainty moves a length by "
        f"{millimetres(2.0 * known.sd * fastest):.2g} mm at most.",
    )


def _fastest(window: Window) -> float:
    """m/s, the 99th percentile of all cables' speeds: single counts of an encoder are no motion."""
    if window.lengths is None or len(window.t) < 3:
        return 0.0
    speeds = np.abs(np.gradient(window.lengths, window.t, axis=0))
    known = speeds[np.isfinite(speeds)]
    return float(np.quantile(known, 0.99)) if len(known) else 0.0


def identify_command(
    campaign_folder: Path,
    method: str | None,
    json_file: Path | None,
    report: Path | None,
    *,
    paper: bool = False,
    poses: PoseSource = PoseSource.MOCAP,
) -> int:
    """What `fidim identify` does: identify, print, write. Returns the exit code; raises as `run_identify`.

    `paper`: the paper's form is the result, and a table shows it beside its columns scaled and our form. `poses`: where
    they come from; other sources than the motion capture are shown beside it where it saw the whole pose.
    """
    if poses is not PoseSource.MOCAP:
        return _from_own_sensors(campaign_folder, poses, method, json_file, report, paper=paper)
    with Working("identifying by the paper" if paper else "identifying", windows_of(campaign_folder)):
        result = run_identify(campaign_folder, method, paper=paper)
        ours = run_identify(campaign_folder, Method.TLS, predict=False) if paper else None
    if json_file is not None:
        write_result(json_file, result)
    console.out.print(summary(result))
    if ours is not None:
        console.out.print(scaling_table(Forms(paper=result, ours=ours)))
    if report is not None:
        console.out.print(f"Report      {write_report(campaign_folder, result, report)}", markup=False)
    return 0 if result.outcome.answers and not result.fallback else 1


def _from_own_sensors(
    folder: Path, poses: PoseSource, method: str | None, json_file: Path | None, report: Path | None, *, paper: bool
) -> int:
    if paper or report is not None:
        raise SetupError(f"--pose-from {poses.value} goes with neither --paper nor --report: both are about markers.")
    if method is not None:
        method_named(method)
    with Working("identifying from own sensors", windows_of(folder)):
        posed = read_posed(folder, poses)
        result = identify_posed(posed, method)
        beside = run_identify(folder, result.method.value, predict=False) if posed.differences else None
    if json_file is not None:
        write_result(json_file, result)
    console.out.print(summary(result))
    if beside is not None:
        console.out.print(comparison(posed, result, beside))
    return 0 if result.outcome.answers and not result.fallback else 1


def summary(result: IdentificationResult) -> RenderableType:
    """The whole answer for a terminal: parameters, gauge-free values, windows, warnings, a closing sentence."""
    parts: list[RenderableType] = [
        Text(f"{result.campaign}: {result.message}"),
        parameter_table(result),
        gauge_table(result),
        window_table(result),
        *(Text(f"warning: {warning}", style="yellow") for warning in result.warnings),
        Text(closing_sentence(result), style="bold"),
    ]
    return Group(*parts)


def parameter_table(result: IdentificationResult) -> Table:
    """CAD, identified, nominal sd, spread between windows, and that spread in percent, for all nine.

    Where parameters were dropped as non-essential, the others fitted anew without them stand beside.
    """
    table = Table(title="Inertial parameters (s in mm, I in 1e-3 m² per unit mass, about P)")
    refits = ["re-fit"] if result.non_essential else []
    console.columns(table, "parameter", "CAD", "identified", "sd", "spread", "spread, %", *refits)
    for name, parameter in result.parameters.items():
        refit = parameter.without_non_essential
        shown = "" if refit is None else "dropped" if name in result.non_essential else f"{millimetres(refit):.3f}"
        table.add_row(*_cells(name, parameter), *(shown for _ in refits))
    return table


def gauge_table(result: IdentificationResult) -> Table:
    """What does not depend on where P is put: s_z from the attachment plane, and I about G."""
    table = Table(title="Free of the choice of P: s_z from the plane of the attachments (mean a_z), I about G")
    console.columns(table, "parameter", "CAD", "identified", "sd", "spread", "spread, %")
    s_z, plane = result.parameters["s_z"], result.attachment_plane
    relative = Parameter(
        s_z.value - plane, s_z.sd, s_z.sd_bootstrap, s_z.sd_jackknife, s_z.nominal - plane, seen=s_z.seen
    )
    table.add_row(*_cells("s_z − a_z", relative))
    for name, parameter in result.about_com().items():
        table.add_row(*_cells(f"{name} about G", parameter))
    return table


def window_table(result: IdentificationResult) -> Table:
    """Every window with σ⊥ and, where it was predicted, the error of the trajectory."""
    expected = None
    if result.sigma_W is not None:
        expected = expected_sigma_perp(result.sigma_W, result.body, result.freedoms)
    scale = (
        "" if result.sigma_W is None else f"; σ_W = {result.sigma_W:.3g}, so σ⊥ ≈ {expected:.3g} is as good as fitted"
    )
    table = Table(title=f"Windows (σ⊥ of Eq. 50{scale}; rms and χ²/dof: predicted from the fitted initial state)")
    console.columns(table, "window", "role", "pose from", "samples", "σ⊥", "rms, mm", "χ²/dof", "conditioning")
    for window in result.windows:
        table.add_row(*_window_cells(window))
    return table


def closing_sentence(result: IdentificationResult) -> str:
    """How far this may be trusted, said honestly."""
    if result.outcome in UNUSABLE:
        return result.outcome.value
    if result.method is Method.MLE:
        return closing(result)
    s_z = result.parameters["s_z"]
    if s_z.spread is None:
        return (
            "With fewer than three windows nothing shows the model error: total least squares states only its nominal "
            "sd, which are several times too small on a real robot."
        )
    ratio = max((p.spread or 0.0) / p.sd for p in result.parameters.values() if p.sd > 0)
    noise = result.noise_ratio or 0.0
    lever = abs(s_z.value - result.attachment_plane)
    size = f"s_z is good to about {millimetres(s_z.spread):.2g} mm ({percent(s_z.spread / lever):.2g} % of its lever)"
    fitted = sum(window.used and window.role is Role.IDENTIFY for window in result.windows)
    if result.outcome is Outcome.MISFIT:
        found = (
            f"the equations are off by {noise:.1f}" if noise > MODEL_ERROR else f"the windows disagree by {ratio:.0f}"
        )
        return (
            f"The model lacks something ({found} times what noise explains). By the spread between windows {size}, but "
            "total least squares turns unmodelled physics into wrong parameters in every window alike, which no spread "
            "shows: expect errors of the order of 10 % until it is explained."
        )
    agree = "The windows agree within what noise explains"
    if ratio > SPREAD_SEEN:
        agree = f"{fitted} windows are few, and the answer leans on single ones"
    return (
        f"{agree}: {size}. Total least squares sees neither geometry nor length "
        "errors that are the same in all windows; held-out σ⊥ and χ²/dof are the test of that."
    )


def _cells(name: str, parameter: Parameter) -> tuple[str, ...]:
    """Both kinds happen to read well in thousandths: s in mm, I in 1e-3 m²."""
    spread = parameter.spread
    size = abs(parameter.value)
    digits = _decimals(parameter.sd)
    if not parameter.seen:
        return (name, f"{millimetres(parameter.nominal):.3f}", "not seen", "", "", "")
    return (
        name,
        f"{millimetres(parameter.nominal):.3f}",
        f"{millimetres(parameter.value):.{digits}f}",
        f"{millimetres(parameter.sd):.{digits}f}",
        "unknown" if spread is None else f"{millimetres(spread):.{digits}f}",
        "" if spread is None or size == 0 else _percent(spread / size),
    )


def _decimals(sd: float) -> int:
    """Three, or as many as show two digits of the standard deviation."""
    return 3 if sd <= 0 else int(np.clip(1 - np.floor(np.log10(millimetres(sd))), 3, 6))


def _window_cells(window: WindowVerdict) -> tuple[str, ...]:
    if not window.used:
        return (window.id, window.role.value, "not used", "", "", "", "", "")
    return (
        window.id,
        window.role.value,
        window.variant or "",
        str(window.samples),
        _number(window.sigma_perp),
        _number(window.rms_mm),
        _number(window.chi2_per_dof),
        _number(window.conditioning),
    )


def _percent(ratio: float) -> str:
    return "> 100" if ratio > 1 else f"{percent(ratio):.2g}"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
