"""Several campaigns of one platform in, one result out: the joint body, its accuracy, and cross-predictions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np

from fidim_lab.data.records import Campaign, Role
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.choice import soft_mode
from fidim_lab.identification.cleaning.clean import clean_recordings
from fidim_lab.identification.cleaning.removed import Removed
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.input_check import check
from fidim_lab.identification.joint.cross import Cross, cross_predictions
from fidim_lab.identification.joint.fit import FRICTION, Alone, alone, fit_jointly
from fidim_lab.identification.joint.found import JointFit
from fidim_lab.identification.joint.sharing import Common, in_common
from fidim_lab.identification.joint.words import answer, warnings
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.identification.mle.findings import MISFIT, Figures, FitAnswer, doubtful
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.results.result import Geometry, IdentificationResult, Moved, ResultOutcome, WindowVerdict
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.side_by_side import side_by_side

FEWEST, MOST = 2, 8
"""campaigns of one joint fit; more than eight were not tried"""
NO_SIGMA = "a fit of several campaigns forms no equations of motion"


@dataclass(frozen=True, eq=False)
class JointResult:
    """The result of `fidim identify A B C`."""

    result: IdentificationResult
    """of all campaigns together; a window's id has its campaign's name before it"""
    campaigns: tuple[str, ...]
    shared: tuple[str, ...]
    """what campaigns have in common, a phrase each"""
    dissipation: dict[str, tuple[float, float]]
    """name → value, sd; empty where the recordings ask for none"""
    cross: tuple[Cross, ...]

    @property
    def table(self) -> dict[str, object]:
        """As the `joint` key of "fidim-result/1"."""
        return {
            "campaigns": list(self.campaigns),
            "shared": list(self.shared),
            "dissipation": {name: {"value": value, "sd": sd} for name, (value, sd) in self.dissipation.items()},
            "cross": [
                {
                    "fitted": [self.campaigns[k] for k in one.fitted],
                    "predicted": self.campaigns[one.predicted],
                    "rms_mm": None if one.rms is None else 1e3 * one.rms,
                    "pose_mm": None if one.of_pose is None else 1e3 * one.of_pose,
                    "median_mm": None if one.median is None else 1e3 * one.median,
                    "windows": [
                        {
                            "id": window.window,
                            "rms_mm": None if window.rms is None else 1e3 * window.rms,
                            "chi2_per_dof": window.chi2_per_dof,
                            "seconds": window.seconds,
                        }
                        for window in one.windows
                    ],
                }
                for one in self.cross
            ],
        }


def identify_jointly(campaigns: Sequence[Campaign], *, native: bool = False, predict: bool = True) -> JointResult:
    """Identify one body and one geometry from several campaigns; predict: also every campaign by the others.

    Raises SetupError where they cannot be of one platform, RefusedError where one of them cannot be fitted.
    """
    begin = perf_counter()
    _refuse(campaigns)
    notes, removed, cleaned = _cleaned(campaigns)
    common = in_common(cleaned)
    singles = alone(common, native=native)
    whole = fit_jointly(common, singles, FRICTION, native=native)
    figures = figures_of(whole, common.campaigns[0].robot.nominal)
    cross = cross_predictions(common, whole, native=native) if predict else ()
    ended = _outcome(whole, figures)
    windows = _verdicts(common, whole, singles, cross)
    geometry = replace(_geometry(whole), encoders=anchors_by_encoders(common.campaigns, common.anchors))
    told = FitAnswer(
        ended,
        answer(ended, whole, figures),
        windows,
        (*notes, *warnings(common, whole, geometry, cross)),
        noise_ratio=float(np.sqrt(whole.excess)),
    )
    together = " + ".join(campaign.name for campaign in campaigns)
    result = figures.result(together, common.campaigns[0].robot, told, begin)
    result = replace(result, geometry=geometry, removed=removed)
    names = tuple(campaign.name for campaign in campaigns)
    return JointResult(result, names, common.shared(), _dissipation(whole), cross)


def _refuse(campaigns: Sequence[Campaign]) -> None:
    names = [campaign.name for campaign in campaigns]
    if not FEWEST <= len(campaigns) <= MOST:
        raise SetupError(f"{len(campaigns)} campaigns; a joint fit takes {FEWEST} to {MOST}.")
    if len(set(names)) < len(names):
        raise SetupError(
            f"campaign.toml, name: {', '.join(names)}; a joint fit needs different names.",
            hint="Give each campaign.toml a name of its own.",
        )
    for campaign in campaigns:
        if (why := soft_mode(campaign)) is not None:
            raise RefusedError(
                f"{campaign.name}: its cables hardly hold one direction ({why}); a joint fit has rigid cables.",
                hint="Identify it by itself, or leave it out.",
            )


def _cleaned(campaigns: Sequence[Campaign]) -> tuple[list[str], tuple[Removed, ...], list[Campaign]]:
    """The one cleaning, of each campaign; notes and stretches named by their campaign."""
    notes: list[str] = []
    removed: list[Removed] = []
    cleaned: list[Campaign] = []
    cleanings = side_by_side([partial(clean_recordings, campaign) for campaign in campaigns])
    for campaign, cleaning in zip(campaigns, cleanings, strict=True):
        said, recordings = check(campaign), cleaning.recordings
        notes += [f"{campaign.name}: {note}" for note in (*said, *recordings.notes)]
        removed += [replace(one, window=f"{campaign.name}/{one.window}") for one in recordings.removed]
        cleaned.append(recordings.campaign)
    return notes, tuple(removed), cleaned


def _outcome(whole: JointFit, figures: Figures) -> ResultOutcome:
    """How it ended; the worst of what applies."""
    if not consistency.can_exist(figures.body) or figures.moved > consistency.ALLOWED:
        return ResultOutcome.IMPOSSIBLE_BODY
    if not whole.settled:
        return ResultOutcome.NOT_CONVERGED
    if whole.excess > MISFIT:
        return ResultOutcome.MISFIT
    return ResultOutcome.DOUBTFUL if doubtful(figures) else ResultOutcome.CONVERGED


def _dissipation(whole: JointFit) -> dict[str, tuple[float, float]]:
    sd = np.sqrt(np.diag(whole.tempered_covariance))
    names = whole.layout.names[BODY : BODY + whole.layout.dissipating]
    return {name: (float(whole.values[BODY + k]), float(sd[BODY + k])) for k, name in enumerate(names)}


def _geometry(whole: JointFit) -> Geometry:
    """Every piece that was left open, by the cable numbers of the first campaign that has it."""
    sd = np.sqrt(np.diag(whole.tempered_covariance))
    moved = tuple(
        Moved(
            piece.nuisance.what,
            piece.nuisance.cable,
            tuple(map(float, whole.values[piece.place])),
            tuple(map(float, sd[piece.place])),
        )
        for piece in whole.layout.pieces
    )
    return Geometry(whole.chi2_gain if moved else 0.0, moved)


def _verdicts(
    common: Common, whole: JointFit, singles: Sequence[Alone], cross: Sequence[Cross]
) -> tuple[WindowVerdict, ...]:
    """Fitted windows with what is left of them, held-out ones as the fit of all predicts them."""
    every = whole.chosen
    held = {(one.predicted, w.window): w for one in cross if one.fitted == every for w in one.windows}
    found: list[WindowVerdict] = []
    for k, campaign in enumerate(common.campaigns):
        member, left = whole.members[k], whole.remainders[k]
        fitted = {r.window.id: x for r, x in zip(member.likelihood.recordings, left, strict=True)}
        for window in campaign.windows:
            name = f"{campaign.name}/{window.id}"
            if window.id in fitted:
                found.append(_fitted(name, window.role, fitted[window.id]))
            elif (seen := held.get((k, window.id))) is not None and seen.rms is not None:
                found.append(_verdict(name, window.role, len(window.t), seen.rms, seen.chi2_per_dof))
            elif window.role is Role.IDENTIFY or seen is not None:
                why = singles[k].found.unused.get(window.id, "it cannot be predicted" if seen is None else seen.why)
                found.append(WindowVerdict(name, window.role, used=False, notes=(why,)))
    return tuple(found)


def _fitted(name: str, role: Role, left: Remainder) -> WindowVerdict:
    return _verdict(name, role, len(left.t), left.rms, left.chi2_per_dof)


def _verdict(name: str, role: Role, samples: int, rms: float, chi2_per_dof: float | None) -> WindowVerdict:
    return WindowVerdict(
        name, role, True, "trajectory", samples, rms_mm=1e3 * rms, chi2_per_dof=chi2_per_dof, no_sigma=NO_SIGMA
    )
