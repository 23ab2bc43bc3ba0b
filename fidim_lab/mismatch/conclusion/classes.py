"""Effects that the data cannot tell apart: by the information matrix at the fitted model, and by fits.

Where another effect in the place of a named one loses less than 5 nats, the data say nothing between the two. A name
stands alone where every rival loses odds of 20, general geometry among them.
"""

import numpy as np

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.conclusion.explanation import ClassMember
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.selection.candidates import evidence_of_all
from fidim_lab.mismatch.selection.confounders import imitators
from fidim_lab.mismatch.selection.general_geometry import rival
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.thresholds import SHARED


def alike(found: Selection, k: int) -> tuple[ClassMember, ...]:
    """Other effects that may stand in the place of term k of the best model, the most alike first; one of each id."""
    named, fits = found.best.model.tried[k].effect.id, _by_fits(found, k)
    foretold = imitators(found.last, k) if found.best.model.whole else ()
    # what the search found more convincing loses nothing to what is only foretold
    seen = [_member(one.tried, one.theta, max(0.0, one.loss)) for one in foretold if one.tried.effect not in fits]
    members: dict[str, ClassMember] = {}
    for member in sorted((*fits.values(), *seen), key=lambda one: one.loss):
        members.setdefault(member.id, member)
    close = [one for one in members.values() if one.id != named and one.loss < SHARED.enough]
    return tuple(sorted(close, key=lambda one: (one.loss, one.id)))


def general_geometry_may_be_it(found: Selection) -> bool:
    """Whether a usual survey, opened instead of what is named, loses less than odds of 20."""
    general = rival(found.last) if found.best.model.tried else None
    return general is not None and general.instead > -ODDS


def stands_alone(members: tuple[ClassMember, ...]) -> bool:
    """Whether each of these loses odds of 20."""
    return all(one.loss > ODDS for one in members)


def _member(tried: Hypothesis, theta: np.ndarray, loss: float, sd: np.ndarray | None = None) -> ClassMember:
    sds = [None] * len(theta) if sd is None else [float(value) for value in sd]
    parameters = {
        parameter.name: EffectParameter(float(value), spread, parameter.unit)
        for parameter, value, spread in zip(tried.effect.parameters, theta, sds, strict=True)
    }
    return ClassMember(tried.effect.id, tried.effect.cable, float(loss), parameters)


def _by_fits(found: Selection, k: int) -> dict[NamedEffect, ClassMember]:
    """What stands in the place of term k in models of whole windows that differ from the best in it alone."""
    best = found.best.model
    kept = {h.effect for j, h in enumerate(best.tried) if j != k}
    members: dict[NamedEffect, ClassMember] = {}
    for candidate in found.tried:
        effects = {h.effect for h in candidate.model.tried}
        if candidate.model is best or len(effects) != len(best.tried) or not kept < effects:
            continue
        (other,) = effects - kept
        if other.cable in (None, best.tried[k].effect.cable):
            loss = max(0.0, -evidence_of_all(candidate, found.best, max(1.0, best.fit.chi2_per_dof)))
            at = next(j for j, h in enumerate(candidate.model.tried) if h.effect == other)
            if other not in members or loss < members[other].loss:
                members[other] = _member(candidate.model.tried[at], *_sized(candidate.model, at, loss))
    return members


def _sized(model: Completed, k: int, loss: float) -> tuple[np.ndarray, float, np.ndarray]:
    """θ, the loss, and the sd of θ, of a term that was fitted."""
    theta, sd = model.theta_of(k)
    return theta, loss, sd * np.sqrt(max(1.0, model.fit.chi2_per_dof))
