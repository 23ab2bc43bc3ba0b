"""The answer by whole windows, where no model was found that leaves only noise."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Robot, Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.evidence import ODDS, GeometryOdds
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.geometry import Surveyed
from fidim_lab.identification.mle.geometry_words import told_geometry
from fidim_lab.identification.mle.soft import ALL_NOISE
from fidim_lab.identification.results.result import Geometry
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.conclusion.explanation import BodyParameter, ClassMember, Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.message import next_experiment
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter, HeldOutFigures, Ranked
from fidim_lab.mismatch.conclusion.surveyed import geometry_cause, geometry_says, is_wrong
from fidim_lab.mismatch.conclusion.why_lost import odds_against
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.whole_motion.common_part import CommonPart
from fidim_lab.mismatch.whole_motion.models import ModelFits, WholeModel
from fidim_lab.mismatch.whole_motion.search import SearchOutcome, search
from fidim_lab.mismatch.whole_motion.weighing import log_odds, odds_of_all, taken
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.say import Say
from fidim_lab.units import millimetres


def with_whole_motion(
    told: Explanation,
    campaign: Campaign,
    common: Callable[[], CommonPart],
    tried: Sequence[Candidate],
    budget: Budget,
    say: Say,
    without: Collection[str] = (),
) -> tuple[Explanation, Fit | None]:
    """The answer of whole windows to a verdict that leaves something open, with its fit.

    Where they say no more, the answer as it was, and None. They say more where all terms together take half of what
    held-out windows lack, and leave at most half of what the answer so far leaves of them (sums of squares), and less
    than any model so far. They are not asked where a model so far predicts them: it may be one of cables that stretch,
    which are not tried again where they are rigid here.
    common: makes what every model contains. tried: all models so far.
    """
    figures = [one.held_out for one in tried if not one.held_out.refused]
    if not campaign.of_role(Role.VALIDATE) or _follows(told, figures, campaign.robot):
        return told, None
    try:
        outcome = search(campaign, common(), budget, say, without)
    except RefusedError as refusal:
        say(str(refusal))
        return told, None
    base, best = outcome.base, outcome.best
    if not best.size or taken(base, best) < SHARED.half or not _leaves_less(best, told, figures):
        return told, None
    return _told(told, outcome, campaign), best.found


def _follows(told: Explanation, figures: Sequence[HeldOut], robot: Robot) -> bool:
    """Whether the answer so far, a law without a name perhaps, or a model leaves hardly more than noise of them."""
    known = [told.rms_mm.after, *(millimetres(one.rms) for one in figures)]
    return any(rms is not None and rms < ALL_NOISE * millimetres(robot.sensors.marker_noise) for rms in known)


def _leaves_less(best: WholeModel, told: Explanation, figures: Sequence[HeldOut]) -> bool:
    """Whether it leaves at most half of what the answer so far leaves, as one that predicts no window does.

    And less than each model so far that predicts every window.
    """
    rms = told.rms_mm.after
    if any(one.chi2_per_dof <= best.chi2_per_dof for one in figures):
        return False
    return rms is None or not np.isfinite(rms) or millimetres(best.held_out) ** 2 <= SHARED.half * rms**2


def _told(told: Explanation, outcome: SearchOutcome, campaign: Campaign) -> Explanation:
    base, best, robot = outcome.base, outcome.best, campaign.robot
    sd = best.sd(outcome.temper)
    effects = tuple(_cause(outcome, k, sd) for k in range(len(best.terms)))
    exact = _exact(outcome)
    geometry = _geometry(outcome, exact, sd, campaign)
    # what the file's own survey leaves open is no cause
    named = robot.survey is None and (is_wrong(best.geometry, robot) or taken(exact, best) > SHARED.some)
    if geometry is not None and named:
        effects = (*effects, geometry_cause(geometry))
    explained = best.held_out < ALL_NOISE * robot.sensors.marker_noise
    verdict = Verdict.EXPLAINED if explained else Verdict.PARTLY_EXPLAINED if effects else told.verdict
    return replace(
        told,
        verdict=verdict,
        effects=effects,
        # places are those that rigid cables miss
        where=() if base.common.nuisances else told.where,
        unknown=None,
        chi2_per_dof=Before(base.chi2_per_dof, best.chi2_per_dof),
        rms_mm=Before(millimetres(base.held_out), millimetres(best.held_out)),
        ranking=tuple(_ranked(one, outcome) for one in outcome.tried),
        parameters=_body(best, sd, robot),
        parameters_before=_body(base, base.sd(base.temper), robot),
        next_experiment=next_experiment(verdict, effects),
        message=_message(outcome, effects, geometry, robot),
        geometry=geometry,
        test=_opened_once(outcome, campaign),
        left_out=None,
    )


def _cause(outcome: SearchOutcome, k: int, sd: np.ndarray) -> NamedCause:
    """Term k with what stands for it; alone where every rival was tried and is excluded."""
    best, tried = outcome.best, outcome.best.terms[k]
    rivals = outcome.rivals[k]
    members = sorted((_member(one, k, outcome) for one in rivals or ()), key=lambda one: one.loss)
    others = tuple(one for one in members if one.id != tried.effect.id)
    ids = tuple(dict.fromkeys(one.id for one in others))
    parameters = _parameters(best, k, sd)
    return NamedCause(tried.effect.id, tried.effect.cable, ids, parameters, tried.effect.says, others, rivals == ())


def _member(rival: WholeModel, k: int, outcome: SearchOutcome) -> ClassMember:
    effect = rival.terms[k].effect
    loss = odds_of_all(outcome.best, rival)
    return ClassMember(effect.id, effect.cable, loss, _parameters(rival, k, rival.sd(outcome.temper)))


def _parameters(model: WholeModel, k: int, sd: np.ndarray) -> dict[str, EffectParameter]:
    effect, found = model.terms[k].effect, model.found
    place = found.place_of(effect)
    low, high = found.prior.bounds
    values = zip(effect.parameters, range(place.start, place.stop), strict=True)
    return {
        p.name: EffectParameter(
            float(found.values[at]), float(sd[at]) if low[at] < found.values[at] < high[at] else None, p.unit
        )
        for p, at in values
    }


def _exact(outcome: SearchOutcome) -> WholeModel:
    """The best model's terms with the robot file's geometry; the model as it is where these were not fitted."""
    best = outcome.best
    return next((one for one in outcome.tried if one.terms == best.terms and not one.geometry), outcome.base)


def _geometry(outcome: SearchOutcome, exact: WholeModel, sd: np.ndarray, campaign: Campaign) -> Geometry | None:
    best = outcome.best
    if not best.geometry:
        return None
    weighed = GeometryOdds(chi2_gain=(exact.cost - best.cost) / outcome.temper)
    told = told_geometry(Surveyed(best.found, best.geometry, weighed), sd)
    return replace(told, encoders=anchors_by_encoders([campaign]))


def _body(model: WholeModel, sd: np.ndarray, robot: Robot) -> dict[str, BodyParameter]:
    rows = zip(PARAMETER_NAMES, model.found.values[:BODY], sd[:BODY], robot.nominal.vector, strict=True)
    return {name: BodyParameter(float(value), float(spread), float(nominal)) for name, value, spread, nominal in rows}


def _ranked(one: WholeModel, outcome: SearchOutcome) -> Ranked:
    names = [h.label for h in one.terms] + (["open geometry"] if one.geometry else [])
    behind = log_odds(outcome.best, one)
    why = f"whole windows: fitted {millimetres(one.fitted):.2g} mm"
    why += f", held out {millimetres(one.held_out):.2g} mm" if one.is_predicted else ""
    why += (
        "." if one is outcome.best else f"; evidence {'lower' if behind > 0 else 'higher'} by {abs(behind):.0f} nats."
    )
    chi2 = one.chi2_per_dof if one.is_predicted else np.nan
    lost = "" if one is outcome.best else _why_lost(one, behind, outcome)
    return Ranked(tuple(names), chi2 if np.isfinite(chi2) else None, True, why, lost=lost)


def _why_lost(one: WholeModel, behind: float, outcome: SearchOutcome) -> str:
    """A line for people."""
    best = outcome.best
    if behind <= -ODDS:
        share = taken(best, one) if one.is_predicted else 0.0
        hardly = f"hardly better: {100 * share:.0f} % of what is left of them goes" if share > 0.0 else "no better"
        return f"It fits better, but predicts held-out windows {hardly}."
    name = " + ".join(h.label for h in best.terms) or "nothing left out"
    return odds_against(behind, name, further=one.size > best.size)


def _opened_once(outcome: SearchOutcome, campaign: Campaign) -> HeldOutFigures | None:
    """Figures of the windows of role `test`, without and with the terms; None without any."""
    common = outcome.base.common
    windows = common.prepared(campaign, Role.TEST, lambda _: None)
    if not windows:
        return None
    trial = ModelFits(common, windows)
    before, after = (replace(one, predict=trial.predicted) for one in (outcome.base, outcome.best))
    chi2 = Before(before.chi2_per_dof, after.chi2_per_dof)
    return HeldOutFigures(chi2, Before(millimetres(before.held_out), millimetres(after.held_out)))


def _message(outcome: SearchOutcome, effects: Sequence[NamedCause], geometry: Geometry | None, robot: Robot) -> str:
    base, best, floor = outcome.base, outcome.best, robot.sensors.marker_noise
    names = " and ".join(c.id if c.cable is None else f"{c.id} (cable {c.cable})" for c in effects)
    named = f"Left out: {names}." if names else "No effect is named; the robot file's geometry was fitted."
    said = [
        f"{named} Whole windows decide here: without it the error is {millimetres(base.held_out):.2g} mm in held-out "
        f"windows and {millimetres(base.fitted):.2g} mm in fitted ones, with it {millimetres(best.held_out):.2g} and "
        f"{millimetres(best.fitted):.2g} mm.",
    ]
    for cause, rivals in zip(effects, outcome.rivals, strict=False):
        if rivals:
            others = ", ".join(f"{one.label} ({millimetres(one.held_out):.2g} mm)" for one in rivals)
            said.append(f"Instead of {cause.id}, the windows do not exclude: {others}.")
        elif rivals is None:
            said.append(f"What could replace {cause.id} was not tried.")
        elif cause.single:
            said.append(f"No tested effect can replace {cause.id}.")
    said += [outcome.cut_short] if outcome.cut_short else []
    explained = best.held_out < ALL_NOISE * floor
    said = [*base.common.sentences, *said]
    if geometry is not None:
        said.append(geometry_says(geometry, robot, is_wrong(best.geometry, robot), explained))
    if not explained:
        said.append(
            f"About {millimetres(best.held_out):.2g} mm, {best.held_out / floor:.0f} times the markers' noise, remain "
            "unexplained; the standard deviations treat this remainder as noise with few independent values."
        )
    return " ".join(said)
