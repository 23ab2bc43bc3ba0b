"""`fidim identify`: a campaign folder in, the identified body with its uncertainty out.

`run_identify` does it, `identified.summary` shows it to a person.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fidim_lab.app.analysis.identified import next_command, summary
from fidim_lab.app.analysis.pose_from import PosedCampaign, comparison, read_posed
from fidim_lab.app.analysis.scaling import Forms, scaling_table
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.data.records import Campaign, Window
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.choice import Choice, suited_method
from fidim_lab.identification.equations.estimators import Method, method_named
from fidim_lab.identification.identify import identify
from fidim_lab.identification.mle.findings import OTHER_NOISE
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.motion.recipe import BEST, PAPER, Recipe
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.identification.results.validation import QUICK, THOROUGH
from fidim_lab.model.native import compiler
from fidim_lab.units import millimetres

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
    posed: PosedCampaign, method: str | None = None, *, paper: bool = False, predict: bool = True
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
    """Whether maximum likelihood says nothing of the body, and not why: what its model lacks, equations lack, too."""
    if result.cause:
        return False
    failed = result.outcome in (ResultOutcome.LOST_PHASE, ResultOutcome.NOT_CONVERGED)
    return failed and (result.outcome is ResultOutcome.LOST_PHASE or (result.noise_ratio or np.inf) > FOLLOWED)


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
    console.out.print(f"next        {next_command(campaign_folder, result, json_file)}", markup=False)
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
    console.out.print(f"next        {next_command(folder, result, json_file)}", markup=False)
    return 0 if result.outcome.answers and not result.fallback else 1
