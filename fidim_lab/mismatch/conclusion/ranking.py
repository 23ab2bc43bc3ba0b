"""The models that were tried, with the reasons why they lost."""

from collections.abc import Sequence

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.mismatch.conclusion.parts import Ranked
from fidim_lab.mismatch.conclusion.why_lost import forms, names, why_lost, why_lost_early, why_not_fitted
from fidim_lab.mismatch.fitting.refit import Completed, evidence
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.selection.candidates import Candidate, common_scale
from fidim_lab.mismatch.selection.select import Selection

MOST_LISTED = 8
"""entries of the ranking that were scored but not fitted"""

MOST_BRIEFLY = 4
"""entries that were fitted to the first seconds alone"""


def ranking(found: Selection, named: Candidate, context: Context) -> tuple[Ranked, ...]:
    """Models of whole windows, the best by held-out χ² first; then of the first seconds; then what was only scored."""
    fitted = [_ranked(candidate, named, context) for candidate in found.tried]
    known = {names(candidate.model) for candidate in found.tried}
    brief: dict[tuple[str, ...], Ranked] = {}
    for model in _best_first(found.passing):
        effects = tuple(_name(h.effect) for h in model.tried)
        if names(model) not in known and effects not in brief and len(brief) < MOST_BRIEFLY:
            brief[effects] = _fitted_briefly(effects, model, found, named, context)
    scored: list[Ranked] = []
    seen: set[object] = set()
    for score in found.first.singles:
        effect = score.tried[0].effect
        listed = (score.tried[0].label,) in known or (_name(effect),) in brief
        if effect in seen or listed or len(scored) == MOST_LISTED:
            continue
        seen.add(effect)
        scored.append(_scored(score, found, named, context))
    return (*fitted, *brief.values(), *scored)


def _best_first(models: Sequence[Completed]) -> list[Completed]:
    """By evidence."""
    scale = common_scale(models) if models else 1.0
    return sorted(models, key=lambda model: -evidence(model, models[0], scale))


def _fitted_briefly(
    effects: tuple[str, ...], model: Completed, found: Selection, named: Candidate, context: Context
) -> Ranked:
    possible, limits = _limits(model, context)
    seconds = float(model.fit.journey.ends.max())
    why = f"χ²/dof {model.fit.chi2_per_dof:.3f} of the first {seconds:.2g} s; not fitted to whole windows.{limits}"
    lost = why_lost_early(model, found, named, possible=possible)
    return Ranked(effects, None, possible, why, forms(model), lost)


def _limits(model: Completed, context: Context) -> tuple[bool, str]:
    """Whether everything in it is possible, and what is not, in words that follow others."""
    reasons = [h.effect.plausible(model.theta_of(k)[0], context) for k, h in enumerate(model.tried)]
    impossible = [reason for reason in reasons if reason is not None]
    bound = " A parameter is at the limit of its possible range." if any(model.at_bound) else ""
    return not impossible and not bound, " ".join((bound, *impossible)).rstrip()


def _ranked(candidate: Candidate, named: Candidate, context: Context) -> Ranked:
    model, held = candidate.model, candidate.held_out
    possible, limits = _limits(model, context)
    said = "accepted: " if candidate is named and (model.tried or candidate.is_white) else ""
    unseen = f"{held.chi2_per_dof:.3f} held out" if held.dof else "no window held out"
    why = f"{said}χ²/dof {model.fit.chi2_per_dof:.3f} fitted, {unseen}. "
    why += f"{candidate.whiteness.says}{limits}"
    effects = tuple(_name(h.effect) for h in model.tried)
    lost = why_lost(candidate, named, possible=possible)
    return Ranked(effects, held.chi2_per_dof if held.dof else None, possible, why, forms(model), lost)


def _scored(score: Score, found: Selection, named: Candidate, context: Context) -> Ranked:
    tried = score.tried[0]
    possible = tried.effect.plausible(tried.theta(score.theta[0]), context) is None
    why = f"not fitted; by its score χ² falls by {max(score.gain, 0.0):.0f} (log-evidence {score.log_evidence:.0f})"
    lost = why_not_fitted(score, found, named)
    return Ranked((_name(tried.effect),), None, possible, why, tried.effect.label, lost)


def _name(effect: NamedEffect) -> str:
    return effect.id if effect.cable is None else f"{effect.id} (cable {effect.cable})"
