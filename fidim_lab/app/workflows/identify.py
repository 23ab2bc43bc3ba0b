"""A campaign folder in, the identified body with its uncertainty out, and how far it may be trusted."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.choice import Choice, suited_method
from fidim_lab.identification.equations.estimators import Method, method_named
from fidim_lab.identification.identify import MODEL_ERROR, SPREAD_SEEN, identify
from fidim_lab.identification.mle.findings import OTHER_NOISE, closing
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.motion.recipe import BEST, PAPER, Recipe
from fidim_lab.identification.motion.virtual_markers import PoseDifference, Sensed, with_poses_from
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.identification.results.validation import QUICK, THOROUGH
from fidim_lab.model.native import compiler
from fidim_lab.units import millimetres, percent

DISAGREE = 2.0
"""χ²/dof of a sample's readings beyond which sensors contradict each other or the geometry"""

UNUSABLE = (ResultOutcome.IMPOSSIBLE_BODY, ResultOutcome.LOST_PHASE, ResultOutcome.NOT_CONVERGED)
"""outcomes with which the command fails"""


FOLLOWED = 1.5
"""times their noise: maximum likelihood that follows the recordings so closely is not overruled, however it ended"""


@dataclass(frozen=True, eq=False)
class PosedCampaign:
    """A campaign to identify from, and what is to be said of its poses."""

    campaign: Campaign
    notes: tuple[str, ...] = ()
    differences: tuple[PoseDifference, ...] = ()
    """to the motion capture; empty where it is the source, or does not show the pose"""


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
        raise SetupError(f"--paper is a form of total least squares; it cannot be used with --method {method}.")
    if method is not None:
        method_named(method)
    return identify_posed(read_posed(campaign_folder, poses), method, paper=paper, predict=predict)


def identify_posed(
    posed: PosedCampaign, method: str | None = None, *, paper: bool = False, predict: bool = True
) -> IdentificationResult:
    """As `run_identify`, from a campaign that is in memory."""
    asked = Method.TLS if paper else None if method is None else method_named(method)
    campaign = posed.campaign
    choice = Choice(asked or Method.MLE) if asked or campaign.periods else suited_method(campaign)
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
    """The correction of late markers and the effect of its uncertainty; empty where there was none."""
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


def closing_sentence(result: IdentificationResult) -> str:
    """How far this may be trusted, said honestly."""
    if result.outcome in UNUSABLE:
        return result.outcome.value
    if result.method is Method.MLE:
        return closing(result)
    s_z = result.parameters["s_z"]
    if s_z.spread is None:
        return (
            "With fewer than three windows the model error is not known: total least squares states only its nominal "
            "sd, which are several times too small on a real robot."
        )
    ratio = max((p.spread or 0.0) / p.sd for p in result.parameters.values() if p.sd > 0)
    noise = result.noise_ratio or 0.0
    lever = abs(s_z.value - result.attachment_plane)
    size = f"s_z is good to about {millimetres(s_z.spread):.2g} mm ({percent(s_z.spread / lever):.2g} % of s_z − a_z)"
    fitted = sum(window.used and window.role is Role.IDENTIFY for window in result.windows)
    if result.outcome is ResultOutcome.MISFIT:
        found = (
            f"the equations are off by {noise:.1f}" if noise > MODEL_ERROR else f"the windows disagree by {ratio:.0f}"
        )
        return (
            f"The model lacks something ({found} times what noise explains). By the spread between windows {size}, but "
            "total least squares turns unmodelled physics into the same wrong parameters in every window, which the "
            "spread does not show: expect errors of the order of 10 % until it is explained."
        )
    agree = "The windows agree within what noise explains"
    if ratio > SPREAD_SEEN:
        agree = f"{fitted} windows are few, so the answer depends on single windows"
    return (
        f"{agree}: {size}. Total least squares does not see errors of geometry or "
        "lengths that are the same in all windows; held-out σ⊥ and χ²/dof test this."
    )


def read_posed(folder: Path, source: PoseSource = PoseSource.MOCAP) -> PosedCampaign:
    """Read a campaign with its poses from `source`. Raises FileError, and SetupError or RefusedError without poses."""
    campaign = read_campaign(folder, periods=source is PoseSource.MOCAP)
    if source is PoseSource.MOCAP:
        return PosedCampaign(campaign)
    sensed = with_poses_from(campaign, source)
    return PosedCampaign(sensed.campaign, _notes(sensed, source), sensed.differences)


def _notes(sensed: Sensed, source: PoseSource) -> tuple[str, ...]:
    zeros, sensors = sensed.zeros, "swivel angles, lengths and inclination"
    what = sensors if source is PoseSource.SWIVEL else f"{sensors} together with the markers"
    notes = [
        f"Poses come from {what}; the marker columns of the windows hold four virtual markers with "
        f"{millimetres(sensed.campaign.robot.sensors.marker_noise):.2g} mm of noise."
    ]
    if sensed.calibrated:
        notes.append(
            f"Zeros and delays of the sensors were calibrated against the markers: swivels stray by "
            f"{zeros.swivel_noise * 1e3:.1f} mrad (delay {zeros.swivel_delay * 1e3:.1f} ms), inclinations by "
            f"{np.mean(zeros.inclination_noise) * 1e3:.1f} mrad (delay {zeros.inclination_delay * 1e3:.1f} ms), "
            f"lengths by {millimetres(zeros.length_noise):.2f} mm."
        )
    else:
        notes.append(
            "The markers do not show the whole pose, so nothing calibrates the sensors: swivel encoders and "
            "inclinometer are taken as absolute (zero at the robot file's axes), without delay."
        )
    if sensed.chi2_per_dof > DISAGREE:
        notes.append(
            f"Lengths, swivel angles and inclination contradict each other (χ²/dof {sensed.chi2_per_dof:.1f}): zeros, "
            "signs, swivel axes or cable order are not as the robot file says."
        )
    return (*notes, *(f"Window {name} is not used: {why}" for name, why in sensed.unused.items()))
