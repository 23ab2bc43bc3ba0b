"""The answer in words: from selection and verdict to an `Explanation`."""

from collections.abc import Sequence

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Campaign
from fidim_lab.effects.effect import UnknownEffect
from fidim_lab.effects.equivalences import EQUIVALENCES
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.trajectories.stages import HORIZONS
from fidim_lab.mismatch.conclusion.classes import alike, general_geometry_may_be_it, stands_alone
from fidim_lab.mismatch.conclusion.explanation import BodyParameter, Explanation, MismatchPlace, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter, LawTerm
from fidim_lab.mismatch.conclusion.ranking import ranking
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.locate import locate
from fidim_lab.mismatch.residuals.residual import of_fit
from fidim_lab.mismatch.scores.alarms import alarm_rate
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce

REST = "Record 10 s of the platform at rest: what the markers do then are errors of motion capture, slow and fast ones."
MOST_PLACES = 5
"""with structure, that are listed"""


def tell(baseline: Baseline, found: Selection, judged: Judged, seconds: float) -> Explanation:
    """Everything that is answered."""
    named, verdict, untested = judged.named, judged.verdict, baseline.tried.untested
    terms = range(len(named.model.tried))
    slow = verdict is Verdict.UNKNOWN_PHYSICS and slower_than_frames(found)
    faint = any(named.model.size_in_sd(k) < CONCLUSION.message_faint for k in terms)
    doubtful = faint or general_geometry_may_be_it(found)
    effects = tuple(_cause(found, named.model, k, doubtful) for k in terms)
    return Explanation(
        campaign=baseline.campaign.name,
        verdict=verdict,
        effects=effects,
        where=_places(baseline.fit) if verdict is not Verdict.NOTHING_MISSING else (),
        chi2_per_dof=Before(found.baseline.held_out.chi2_per_dof, named.held_out.chi2_per_dof),
        rms_mm=Before(1e3 * found.baseline.held_out.rms, 1e3 * named.held_out.rms),
        ranking=ranking(found, named, baseline.context),
        parameters=body_parameters(named.model.fit, baseline.campaign),
        parameters_before=body_parameters(baseline.fit, baseline.campaign),
        next_experiment=REST if slow else next_experiment(verdict, effects, found.best.whiteness.vibration),
        message=_message(judged, found, effects, _limits(baseline, found)),
        seconds=seconds,
        untested=untested,
    )


def _places(found: Fit) -> tuple[MismatchPlace, ...]:
    """Where the model as it is leaves structure, the largest share first."""
    places = locate(of_fit(found), MOST_PLACES)
    return tuple(MismatchPlace(p.window, p.t, p.channel, p.frequency, p.share, p.says) for p in places)


def _cause(found: Selection, model: Completed, k: int, doubtful: bool) -> NamedCause:
    """Term k. doubtful: no name of this model is the only one."""
    effect, members = model.tried[k].effect, alike(found, k)
    ids, has_own = tuple(one.id for one in members), not effect.parts(*model.theta_of(k))
    single = stands_alone(members) and has_own and not doubtful
    return NamedCause(effect.id, effect.cable, ids, _parameters(model, k), effect.says, members, single)


def law_terms(model: Completed) -> tuple[LawTerm, ...]:
    """The terms of a model with a law that nothing of the catalogue has, that law first; none without such a law."""
    if all(term.effect.id != UnknownEffect.id for term in model.tried):
        return ()
    order = sorted(range(len(model.tried)), key=lambda k: model.tried[k].effect.id != UnknownEffect.id)
    effects = [(model.tried[k].effect, _parameters(model, k)) for k in order]
    return tuple(
        LawTerm(effect.variant if effect.id == UnknownEffect.id else effect.id, effect.says, parameters)
        for effect, parameters in effects
    )


def _parameters(model: Completed, k: int) -> dict[str, EffectParameter]:
    """Of term k; where the model leaves more than noise, their sd are as much larger."""
    inflation = float(np.sqrt(max(1.0, model.fit.chi2_per_dof)))
    return {
        parameter.name: EffectParameter(float(value), float(sd) * inflation, parameter.unit)
        for parameter, value, sd in zip(model.tried[k].effect.parameters, *model.theta_of(k), strict=True)
    }


def body_parameters(found: Fit, campaign: Campaign) -> dict[str, BodyParameter]:
    """The nine parameters of a fit with their sd, times √χ²/dof where that is above 1, beside the robot file's."""
    scale = float(np.sqrt(max(1.0, found.chi2_per_dof)))
    nominal = campaign.robot.nominal.vector
    return {
        name: BodyParameter(float(found.values[k]), float(found.sd[k]) * scale, float(nominal[k]))
        for k, name in enumerate(PARAMETER_NAMES)
    }


def next_experiment(verdict: Verdict, effects: Sequence[NamedCause], vibration: float | None = None) -> str | None:
    """The experiment that separates a named effect from a rival; None where there is no rival.

    vibration: Hz, of a line in what is left that is faster than the platform swings.
    """
    for cause in effects:
        for other in cause.equivalent_to:
            for known in EQUIVALENCES:
                if cause.id in known.ids and other in known.ids:
                    return f"To tell {cause.id} from {other}: {known.separate}."
    if vibration is not None:
        return (
            f"Find what vibrates at {vibration:.3g} Hz: cameras, frame, drives or a fan (an accelerometer on each "
            "shows it), or cables that vibrate."
        )
    if verdict in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED):
        return "Repeat one window at the same place with half the displacement: this separates force from geometry."
    return None


def _limits(baseline: Baseline, found: Selection) -> str:
    """What the figures mean: false alarms, a model that was not fitted to whole windows, what was not tried."""
    said = f" {alarm_rate(found.first.projected, SHARED.enough).says}"
    if baseline.whole is None:
        said += " Without effects the model cannot follow a whole window: "
        said += f"it was fitted to the first {HORIZONS[2]:g} s of each."
    refused = found.best.held_out.refused
    if refused:
        said += f" Held-out windows that could not be judged: {'; '.join(refused.values())}"
    said += f" {found.cut_short}" if found.cut_short else ""
    untested = baseline.tried.untested
    return said + (f" Not tested: {', '.join(untested)}." if untested else "")


def best_of_all(found: Selection) -> str:
    """How near the best hypothesis came; one that fitted windows support may be refused by held-out ones."""
    every = found.first.singles
    if not every:
        return ""
    best = every[0]
    said = f"; the best of {len(every)} hypotheses, {best.label}, has log-evidence {best.log_evidence:.1f}"
    if best.log_evidence < SHARED.enough:
        return f"{said} ({SHARED.enough:g} would be needed)"
    if not found.baseline.held_out.dof:
        return f"{said} on the fitted windows, but does not explain enough of them"
    return f"{said} on the fitted windows, but held-out windows are predicted no better with it"


def _message(judged: Judged, found: Selection, effects: Sequence[NamedCause], limits: str) -> str:
    verdict, named = judged.verdict, judged.named
    figures = figures_of(found.baseline, named)
    names = " and ".join(c.id if c.cable is None else f"{c.id} (cable {c.cable})" for c in effects)
    match verdict:
        case Verdict.NOTHING_MISSING:
            said = f"Nothing is missing: {figures}{best_of_all(found)}."
        case Verdict.EXPLAINED:
            said = f"Left out: {names}; {figures}. {_shift(found, named)}"
        case Verdict.PARTLY_EXPLAINED:
            said = f"Left out: {names}, but something remains unexplained; {figures}. {_shift(found, named)}"
        case _:
            best = found.best
            said = f"Something is missing that no effect tested here explains; {_left(found.baseline)}. "
            said += f"{found.baseline.whiteness.says} {_slow_noise(found)}{_best_of_no_use(found)}"
            if best.model.tried:
                said += f" The best attempt, {best.model.label}, leaves {_left(best)}."
                said += _law_without_a_name(law_terms(best.model))
            if judged.outdone_by is not None:
                said += f" {_outdone(judged.outdone_by, found)}"
    return said + _by_mass(effects, found.best.model.mechanism.robot.mass) + limits


def slower_than_frames(found: Selection) -> bool:
    """Whether no more than the stated noise is left, most of it slower than noise from frame to frame."""
    before = found.baseline
    left = before.held_out.chi2_per_dof if before.held_out.dof else before.model.fit.chi2_per_dof
    return left <= SHARED.little and before.whiteness.level**2 < SHARED.half


def _slow_noise(found: Selection) -> str:
    if not slower_than_frames(found):
        return ""
    frames = 1e3 * found.baseline.whiteness.level * found.best.model.mechanism.robot.sensors.marker_noise
    return (
        f"That is within the stated noise, but from frame to frame the markers scatter by {frames:.2g} mm only: the "
        "rest is slower. Motion capture may err so by itself. "
    )


def _outdone(rival: UnknownForce, found: Selection) -> str:
    """Why effects that were found are not named."""
    figures, end = (
        f"held-out χ²/dof {rival.after.chi2_per_dof:.3g}",
        "is therefore not named.",
    )
    if found.outdone is None:
        return f"An unknown wrench explains more with fewer parameters ({figures}). {found.best.model.label} {end}"
    return (
        f"One unknown wrench leaves only noise in all windows ({figures}); {found.outdone.label} explains only the "
        f"first seconds and {end}"
    )


def figures_of(before: Candidate, after: Candidate) -> str:
    """The residual before and after; once where both are the same model."""
    if before is after and before.held_out.dof:
        return f"{_left(before)}, rms {1e3 * before.held_out.rms:.3g} mm"
    if before is after:
        return _left(before)
    if not (before.held_out.dof and after.held_out.dof):
        fitted = [one.model.fit.chi2_per_dof for one in (before, after)]
        return f"χ²/dof of the fitted windows {fitted[0]:.3g} → {fitted[1]:.3g}, without held-out windows to confirm it"
    then, now = before.held_out, after.held_out
    chi2 = f"held-out χ²/dof {then.chi2_per_dof:.3g} → {now.chi2_per_dof:.3g}"
    return f"{chi2}, rms {1e3 * then.rms:.3g} → {1e3 * now.rms:.3g} mm"


def _left(one: Candidate) -> str:
    """What a model leaves."""
    if one.held_out.dof:
        return f"held-out χ²/dof {one.held_out.chi2_per_dof:.3g}"
    return f"χ²/dof of the fitted windows {one.model.fit.chi2_per_dof:.3g}, without held-out windows to judge it"


def _law_without_a_name(terms: Sequence[LawTerm]) -> str:
    """What is known of a law that nothing of the catalogue has, where one was fitted."""
    if not terms:
        return ""
    law = terms[0]
    values = (f"{name} = {p.value:.3g} ± {p.sd:.2g} {p.unit}".removesuffix(" 1") for name, p in law.parameters.items())
    return f" The closest law is {law.like}: {law.says}, {', '.join(values)}."


def _by_mass(effects: Sequence[NamedCause], mass: float) -> str:
    """Free motion determines forces per mass alone: their sizes are as good as the robot file's mass."""
    units = {value.unit for cause in effects for value in cause.parameters.values()}
    if not any("N" in unit or "kg" in unit for unit in units):
        return ""
    return (
        f" Sizes in newtons or kilograms assume the robot file's {mass:.4g} kg: free motion gives them only per unit "
        "mass."
    )


def _best_of_no_use(found: Selection) -> str:
    """What the most evident effect would take away, to first order."""
    if not found.first.singles:
        return ""
    top, rest = found.first.singles[0], max(found.first.rest, 1e-9)
    return f"The best single effect, {top.label}, explains {100 * min(top.gain / rest, 1.0):.0f} % of it."


def _shift(found: Selection, named: Candidate) -> str:
    """How far the body moved when the effects were added."""
    base, done = found.baseline.model.fit, named.model.fit
    moved = done.values[:9] - base.values[:9]
    sds = np.abs(moved) / (base.sd[:9] * np.sqrt(max(1.0, base.chi2_per_dof)))
    k = int(np.argmax(sds))
    com = 1e3 * float(np.linalg.norm(moved[:3]))
    return (
        f"The centre of mass moved by {com:.3g} mm. {PARAMETER_NAMES[k]} changed most, "
        f"by {sds[k]:.3g} of its sd in the fit without them."
    )
