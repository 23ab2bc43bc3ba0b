"""From a fitted baseline to the best set of effects: score, refit the best few, accept one, look again.

A term is accepted when the evidence asks for it (log-evidence > 5) and windows that no fit has seen get better. At most
three terms; it ends where nothing is left but noise, or where the best addition explains too little of the rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.likelihood import Simulation
from fidim_lab.identification.mle.optimise import FINAL, optimise
from fidim_lab.mismatch.baseline import Baseline
from fidim_lab.mismatch.columns import Scorer
from fidim_lab.mismatch.hypotheses import Hypotheses, Hypothesis
from fidim_lab.mismatch.refit import Completed, HeldOut, can_refit, predict, refit
from fidim_lab.mismatch.score import Projected, Score, pair_scores, project, single_scores
from fidim_lab.mismatch.stretch import is_compliant

ENOUGH = 5.0
"""log-evidence below which a term is not believed: never reached in 20 000 draws without an effect (FINDINGS.md)"""
MOST_TERMS = 3
NEAR = 3.0
"""χ²/dof below which the motion is followed well enough to score whole windows"""
SHORT = (3.0, 1.0)
"""s; horizons at which to score otherwise"""
SINGLES, PAIRS = 3, 2
"""how many are fitted"""
FEEBLE = 0.25
"""of the rest: an addition that explains less ends the search"""
WHITE = 1.03
"""χ²/dof, for the noise that the residuals show, up to which nothing is left (4 sd of 12 windows of 10 s)"""

COARSE_UP_TO, COARSENESS = 5.0, 3
"""s; up to there only every third frequency of the scan is tried"""

Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One completed model with its figures on windows that it has not seen."""

    model: Completed
    held_out: HeldOut


@dataclass(frozen=True, eq=False)
class Selection:
    """Where the search ended and what was looked at on the way."""

    best: Candidate
    """the baseline where nothing was accepted"""
    baseline: Candidate
    tried: tuple[Candidate, ...]
    """every model that was fitted, the best first by held-out χ²"""
    scores: tuple[Score, ...]
    """of all hypotheses at the baseline, the most evident first"""
    projected: Projected
    """at the baseline"""
    last: tuple[Score, ...]
    """of all hypotheses at the best model: what could still be added"""
    unfitted: Score | None
    """the most evident addition to the best model, where trajectories cannot carry it: known by its score alone"""
    unfitted_left: float
    """χ²/dof that it would leave"""

    @property
    def white(self) -> bool:
        """Whether nothing but noise is left."""
        return is_white(self.best)


def is_white(candidate: Candidate) -> bool:
    """By χ²/dof of fitted and held-out windows, for the noise that the residuals show."""
    ratio = max(1.0, candidate.model.fit.noise_ratio) ** 2
    held = candidate.held_out
    allowed = WHITE + 4 * np.sqrt(2 / max(1, held.dof))
    return candidate.model.excess < WHITE and (held.dof == 0 or held.chi2_per_dof / ratio < allowed)


def select(start: Baseline, say: Say) -> Selection:
    """Search for what was left out, starting from a baseline fit."""
    base, validate, tried, context = start.fit, start.held_out, start.tried, start.context
    baseline = _judged(Completed((), base, (), 0.0), validate)
    say(f"baseline: χ²/dof {base.chi2_per_dof:.3f}, held out {baseline.held_out.chi2_per_dof:.3f}")
    best, models = baseline, [baseline]
    projected, scores = _scored(baseline.model, tried, context)
    first, first_scores = projected, scores
    while len(best.model.tried) < MOST_TERMS and scores[0].log_evidence > ENOUGH:
        if _unfitted(scores, best) is not None:
            break
        fresh = _additions(best, base, validate, scores, projected, context, say)
        models.extend(fresh)
        better = [c for c in fresh if _is_better(c, best)]
        if not better:
            break
        best = min(better, key=lambda c: _figure(c))
        say(f"accepted: {best.model.label}, held-out χ²/dof {best.held_out.chi2_per_dof:.3f}")
        projected, scores = _scored(best.model, tried, context)
        if is_white(best) and scores[0].log_evidence < ENOUGH:
            break
    ranking = sorted(models, key=lambda c: c.held_out.chi2_per_dof)
    unfitted = _unfitted(scores, best)
    gain = 0.0 if unfitted is None else unfitted.gain
    left = (projected.left - gain) / max(1, projected.dof)
    return Selection(best, baseline, tuple(ranking), first_scores, first, scores, unfitted, left)


def _unfitted(scores: Sequence[Score], best: Candidate) -> Score | None:
    """The most evident hypothesis where it cannot be fitted and no other comes near."""
    top = scores[0]
    if top.log_evidence < ENOUGH or _can_be_fitted(top.tried[0].effect, best):
        return None
    rest = next((s for s in scores if _can_be_fitted(s.tried[0].effect, best)), None)
    return top if rest is None or top.log_evidence > rest.log_evidence + ENOUGH else None


def _additions(
    best: Candidate,
    base: Fit,
    validate: Sequence[Window],
    scores: Sequence[Score],
    projected: Projected,
    context: Context,
    say: Say,
) -> list[Candidate]:
    """The best model with each of the most evident additions."""
    fresh: list[Candidate] = []
    for score in _worth(best, scores, projected, context):
        starts = [best.model.theta_of(k)[0] for k in range(len(best.model.tried))]
        starts += [h.theta(theta) for h, theta in zip(score.tried, score.theta, strict=True)]
        say(f"fitting {' + '.join(x for x in (best.model.label, score.label) if x != 'nothing')}")
        found = refit(base, best.model.fit, (*best.model.tried, *score.tried), starts, context)
        if found is None:
            continue
        candidate = _judged(found, validate)
        say(f"  χ²/dof {found.fit.chi2_per_dof:.3f}, held out {candidate.held_out.chi2_per_dof:.3f}")
        fresh.append(candidate)
        if is_white(candidate):
            break
    return fresh


def _worth(best: Candidate, scores: Sequence[Score], projected: Projected, context: Context) -> list[Score]:
    """The most evident additions that can be fitted, one for each effect, and pairs that say much more."""
    chosen: list[Score] = []
    seen: set[object] = set()
    for score in scores:
        effect = score.tried[0].effect
        if effect in seen or score.log_evidence < ENOUGH or not _can_be_fitted(effect, best):
            continue
        seen.add(effect)
        chosen.append(score)
    singles = chosen[:SINGLES]
    room = MOST_TERMS - len(best.model.tried)
    if room < 2 or not singles:
        return singles
    pairs = [
        pair
        for pair in pair_scores(projected, context)
        if pair.log_evidence > singles[0].log_evidence + ENOUGH
        and all(_can_be_fitted(h.effect, best) for h in pair.tried)
    ]
    return singles + pairs[:PAIRS]


def _can_be_fitted(effect: NamedEffect, best: Candidate) -> bool:
    """Whether trajectories carry it; a stretch that spoils whole windows is beyond their first order."""
    if is_compliant(effect) and best.model.excess >= NEAR:
        return False
    return can_refit(effect, best.model.mechanism)


def _is_better(candidate: Candidate, best: Candidate) -> bool:
    """More evidence, and held-out windows that improve; a model that explains next to nothing of the rest is none."""
    gained = candidate.model.log_evidence - best.model.log_evidence
    held, before = candidate.held_out, best.held_out
    rest = before.chi2_per_dof - 1
    improved = before.chi2_per_dof - held.chi2_per_dof
    return gained > ENOUGH and improved > 0 and (improved > FEEBLE * rest or is_white(candidate))


def _figure(candidate: Candidate) -> tuple[int, float]:
    """White models with few terms first, then by held-out χ²."""
    white = is_white(candidate)
    if white:
        return len(candidate.model.tried), -candidate.model.log_evidence
    return MOST_TERMS + 1, candidate.held_out.chi2_per_dof


def _judged(model: Completed, validate: Sequence[Window]) -> Candidate:
    return Candidate(model, predict(model, validate))


def _scored(model: Completed, tried: Hypotheses, context: Context) -> tuple[Projected, tuple[Score, ...]]:
    """Scores of all hypotheses that the model does not have yet, at a horizon where its motion is followed."""
    simulation = _followed(model.fit)
    left = _without(tried, model.tried)
    if float(simulation.ends.max()) < COARSE_UP_TO:
        left = replace(left, periodic=tuple(h for h in left.periodic if _is_coarse(h)))
    projected = project(Scorer(model.mechanism, left), model.fit, model.fit.likelihood, simulation)
    return projected, single_scores(projected, context)


def _is_coarse(tried: Hypothesis) -> bool:
    """Every third frequency: a few seconds do not tell more apart."""
    return round(10 * float(tried.absent[-1])) % COARSENESS == 2


def _followed(found: Fit) -> Simulation:
    """The motion at the longest horizon at which the model follows it."""
    if found.excess < NEAR:
        return found.journey.optimum.simulation
    simulation = found.journey.optimum.simulation
    point = found.journey.optimum.point
    for horizon in SHORT:
        ends = np.minimum(found.journey.ends, horizon)
        optimum = optimise(found.likelihood, point, ends, found.prior, FINAL, np.ones(len(found.values), dtype=bool))
        if optimum is None:
            continue
        simulation = optimum.simulation
        rows = sum(len(residual.rows) for residual in simulation.residuals)
        if optimum.cost / rows < NEAR * found.noise_ratio**2:
            break
    return simulation


def _without(tried: Hypotheses, used: Sequence[Hypothesis]) -> Hypotheses:
    effects = {h.effect for h in used}
    return replace(
        tried,
        direct=tuple(h for h in tried.direct if h.effect not in effects),
        periodic=tuple(h for h in tried.periodic if h.effect not in effects),
    )
