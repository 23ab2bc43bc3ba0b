"""`explain`: a campaign in, what physics was left out and how that is known.

Baseline fit, score of every hypothesis, refit of those that matter, acceptance on windows that no fit has seen
(`select`), and a verdict by what is left.
"""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Motion, Role
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.equivalences import EQUIVALENCES
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.mismatch.explanation import (
    Before,
    BodyParameter,
    EffectParameter,
    Explanation,
    NamedCause,
    Ranked,
    Verdict,
)
from fidim_lab.mismatch.hypotheses import Hypothesis, hypotheses
from fidim_lab.mismatch.refit import Completed
from fidim_lab.mismatch.score import Score, explained_share
from fidim_lab.mismatch.select import ENOUGH, WHITE, Candidate, Selection, is_white, select
from fidim_lab.mismatch.whereabouts import whereabouts
from fidim_lab.model.mechanism import Mechanism

ALIKE = 0.9995
"""of one hypothesis's influence that another imitates: from here on the data do not separate them"""
MOST_ALIKE = 3
MOSTLY = 0.9
"""of the held-out excess that named effects must take away to count as a part of the truth"""
HALF = 0.5
"""of the excess that an effect known by its score alone must explain"""
LISTED = 8
"""entries of the ranking that were scored but not fitted"""

Say = Callable[[str], None]


def explain(campaign: Campaign, *, native: bool = True, say: Say = lambda _: None) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    Raises RefusedError where no window can be fitted at all.
    """
    begin = perf_counter()
    mechanism = Mechanism(campaign.robot, native=native)
    say("fitting the baseline")
    base = fit(mechanism, campaign.of_role(Role.IDENTIFY))
    tried = hypotheses(campaign.robot)
    context = context_of(base)
    found = select(base, campaign.of_role(Role.VALIDATE), tried, context, say)
    verdict = judge(found)
    known = verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)
    named = found.best if known else found.baseline
    effects = tuple(_cause(found, named.model, k) for k in range(len(named.model.tried)))
    if known and found.unfitted is not None:
        effects = (*effects, _cause_by_score(found, found.unfitted))
    return Explanation(
        campaign=campaign.name,
        verdict=verdict,
        effects=effects,
        where=whereabouts(base) if verdict is not Verdict.NOTHING_MISSING else (),
        chi2_per_dof=Before(found.baseline.held_out.chi2_per_dof, named.held_out.chi2_per_dof),
        rms_mm=Before(1e3 * found.baseline.held_out.rms, 1e3 * named.held_out.rms),
        ranking=_ranking(found, named, context),
        parameters=_parameters(named.model.fit, campaign),
        parameters_before=_parameters(base, campaign),
        next_experiment=_next_experiment(verdict, effects),
        message=_message(verdict, found, named, effects, tried.untested),
        seconds=perf_counter() - begin,
        untested=tried.untested,
    )


def context_of(base: Fit) -> Context:
    """Tensions and rates of the fitted motion, for what is physically possible."""
    mechanism, simulation = base.likelihood.mechanism, base.journey.optimum.simulation
    parts = [batch.trajectories for batch in simulation.batches]
    nodes = [np.isfinite(part.tensions).all(axis=2) for part in parts]

    def stacked(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name)[good] for part, good in zip(parts, nodes, strict=True)])

    positions = stacked("positions")
    motion = Motion(
        np.arange(len(positions), dtype=float),
        positions,
        stacked("rotations"),
        stacked("twists"),
        stacked("accelerations"),
    )
    return Context.of_motion(mechanism, motion, mechanism.robot.mass * stacked("tensions"))


def judge(found: Selection) -> Verdict:
    """The verdict, by what is left of fitted and held-out windows."""
    best = found.best
    if found.unfitted is not None:
        if found.unfitted_left < WHITE:
            return Verdict.EXPLAINED
        enough = found.unfitted.share > HALF or best.model.tried
        return Verdict.PARTLY_EXPLAINED if enough else Verdict.UNKNOWN_PHYSICS
    if not best.model.tried:
        return Verdict.NOTHING_MISSING if is_white(best) else Verdict.UNKNOWN_PHYSICS
    if is_white(best):
        return Verdict.EXPLAINED
    before, after = found.baseline.held_out.chi2_per_dof - 1, best.held_out.chi2_per_dof - 1
    return Verdict.PARTLY_EXPLAINED if after < (1 - MOSTLY) * before else Verdict.UNKNOWN_PHYSICS


def _cause(found: Selection, model: Completed, k: int) -> NamedCause:
    tried = model.tried[k]
    values, sds = model.theta_of(k)
    inflation = float(np.sqrt(max(1.0, model.excess)))
    parameters = {
        parameter.name: EffectParameter(float(value), float(sd) * inflation, parameter.unit)
        for parameter, value, sd in zip(tried.effect.parameters, values, sds, strict=True)
    }
    effect = tried.effect
    return NamedCause(effect.id, effect.cable, _alike(found, tried), parameters, effect.says)


def _cause_by_score(found: Selection, score: Score) -> NamedCause:
    """An effect that cannot be fitted yet, with the size that its score gives, to first order."""
    tried = score.tried[0]
    theta = tried.theta(score.theta[0])
    parameters = {
        parameter.name: EffectParameter(float(value), None, parameter.unit)
        for parameter, value in zip(tried.effect.parameters, theta, strict=True)
    }
    return NamedCause(tried.effect.id, tried.effect.cable, _alike(found, tried), parameters, tried.effect.says)


def _alike(found: Selection, named: Hypothesis) -> tuple[str, ...]:
    """Other ids that imitate this one's influence, the most alike first."""
    original = next((h for h in found.projected.tried if h.effect == named.effect), None)
    if original is None:
        return ()
    shares: dict[str, float] = {}
    for other in found.projected.tried:
        if other.effect.id == named.effect.id or other.effect.cable not in (None, named.effect.cable):
            continue
        share = explained_share(found.projected, original, other)
        if share >= ALIKE:
            shares[other.effect.id] = max(share, shares.get(other.effect.id, 0.0))
    return tuple(sorted(shares, key=lambda id: -shares[id]))[:MOST_ALIKE]


def _ranking(found: Selection, named: Candidate, context: Context) -> tuple[Ranked, ...]:
    fitted = [_ranked(candidate, named, context) for candidate in found.tried]
    known = {_key(candidate.model.tried) for candidate in found.tried}
    scored: list[Ranked] = []
    seen: set[object] = set()
    for score in found.scores:
        effect = score.tried[0].effect
        if effect in seen or _key(score.tried) in known or len(scored) == LISTED:
            continue
        seen.add(effect)
        scored.append(Ranked((_name(effect),), None, _possible(score, context) is None, _why_not_fitted(score)))
    return (*fitted, *scored)


def _ranked(candidate: Candidate, named: Candidate, context: Context) -> Ranked:
    model, held = candidate.model, candidate.held_out
    reasons = [h.effect.plausible(model.theta_of(k)[0], context) for k, h in enumerate(model.tried)]
    impossible = [reason for reason in reasons if reason is not None]
    bound = " A parameter is held at the bound of what is possible." if any(model.at_bound) else ""
    said = "accepted: " if candidate is named else ""
    why = f"{said}χ²/dof {model.fit.chi2_per_dof:.3f} fitted, {held.chi2_per_dof:.3f} held out; log-evidence "
    why += f"{model.log_evidence:.0f} over the baseline.{bound} {' '.join(impossible)}".rstrip()
    effects = tuple(_name(h.effect) for h in model.tried)
    return Ranked(effects, held.chi2_per_dof, not impossible and not any(model.at_bound), why)


def _why_not_fitted(score: Score) -> str:
    return f"by score it takes {max(score.gain, 0.0):.0f} off χ² (log-evidence {score.log_evidence:.0f}); not fitted"


def _possible(score: Score, context: Context) -> str | None:
    tried = score.tried[0]
    return tried.effect.plausible(tried.theta(score.theta[0]), context)


def _key(tried: Sequence[Hypothesis]) -> tuple[str, ...]:
    return tuple(sorted(h.label for h in tried))


def _name(effect: NamedEffect) -> str:
    return effect.id if effect.cable is None else f"{effect.id} (cable {effect.cable})"


def _parameters(found: Fit, campaign: Campaign) -> dict[str, BodyParameter]:
    scale = float(np.sqrt(max(1.0, found.excess)))
    nominal = campaign.robot.nominal.vector
    return {
        name: BodyParameter(float(found.values[k]), float(found.sd[k]) * scale, float(nominal[k]))
        for k, name in enumerate(PARAMETER_NAMES)
    }


def _next_experiment(verdict: Verdict, effects: Sequence[NamedCause]) -> str | None:
    for cause in effects:
        for other in cause.equivalent_to:
            for known in EQUIVALENCES:
                if cause.id in known.ids and other in known.ids:
                    return f"To tell {cause.id} from {other}: {known.separate}."
    if verdict in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED):
        return "Repeat one window at the same place with half the displacement: it tells force from geometry."
    return None


def _message(
    verdict: Verdict, found: Selection, named: Candidate, effects: Sequence[NamedCause], untested: Sequence[str]
) -> str:
    before, after = found.baseline.held_out, named.held_out
    figures = f"held-out χ²/dof {before.chi2_per_dof:.3g} → {after.chi2_per_dof:.3g}, rms {1e3 * before.rms:.3g} → "
    figures += f"{1e3 * after.rms:.3g} mm"
    names = " and ".join(c.id if c.cable is None else f"{c.id} (cable {c.cable})" for c in effects)
    match verdict:
        case Verdict.NOTHING_MISSING:
            best = found.scores[0] if found.scores else None
            said = f"Nothing is missing: held-out χ²/dof {before.chi2_per_dof:.3g}, rms {1e3 * before.rms:.3g} mm"
            if best is not None:
                said += f"; the best of {len(found.scores)} hypotheses, {best.label}, has log-evidence "
                said += f"{best.log_evidence:.1f} ({ENOUGH:g} would be needed)"
            said += "."
        case Verdict.EXPLAINED:
            said = f"Left out: {names}; {figures}. {_shift(found, named)}"
        case Verdict.PARTLY_EXPLAINED:
            said = f"Left out: {names}, but something remains unexplained; {figures}. {_shift(found, named)}"
        case _:
            best = found.best
            said = "Something is missing that no effect tested here explains; held-out χ²/dof "
            said += f"{before.chi2_per_dof:.3g}."
            if best.model.tried:
                said += f" The best attempt, {best.model.label}, leaves {best.held_out.chi2_per_dof:.3g}."
    if effects and found.unfitted is not None:
        said += f" {found.unfitted.label} is known by its score alone (log-evidence {found.unfitted.log_evidence:.0f}, "
        said += f"would leave χ²/dof {found.unfitted_left:.3g}): it cannot be fitted yet, so held-out figures lack it."
    return said + (f" Not tested: {', '.join(untested)}." if untested else "")


def _shift(found: Selection, named: Candidate) -> str:
    """How far the body moved when the effects were added."""
    base, done = found.baseline.model.fit, named.model.fit
    moved = done.values[:9] - base.values[:9]
    k = int(np.argmax(np.abs(moved) / base.sd[:9]))
    com = 1e3 * float(np.linalg.norm(moved[:3]))
    return (
        f"The centre of mass moved by {com:.3g} mm; most in its own sd moved {PARAMETER_NAMES[k]}, "
        f"by {abs(moved[k]) / base.sd[k]:.0f} sd of the fit without them."
    )
