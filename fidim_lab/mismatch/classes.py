"""Effects that the data at hand cannot tell apart, from the information matrix at the fitted model.

What a named effect does to the recordings, body, starts and the other effects being adjusted, is a vector; what of it
another effect cannot imitate, within its bounds, is what the data say between the two. Below 5 nats they say nothing.
"""

import numpy as np

from fidim_lab.mismatch.refit import evidence
from fidim_lab.mismatch.score import bounded, eliminated
from fidim_lab.mismatch.select import Selection
from fidim_lab.mismatch.views import ENOUGH, View

MOST_ALIKE = 3


def alike(found: Selection, k: int) -> tuple[str, ...]:
    """Other ids that may stand in the place of term k of the best model, the most alike first; at most three."""
    named = found.best.model.tried[k].effect.id
    losses = _by_information(found.last, k) if found.best.model.whole else {}
    for id, loss in _by_fits(found, k).items():
        losses[id] = min(loss, losses.get(id, np.inf))
    close = sorted((loss, id) for id, loss in losses.items() if id != named and loss < ENOUGH)
    return tuple(id for _, id in close)[:MOST_ALIKE]


def _by_information(seen: View, k: int) -> dict[str, float]:
    """Nats lost where another effect takes the place of term k, to first order, for each id the least."""
    model, projected = seen.model, seen.projected
    term, place = model.tried[k], model.place_of(k)
    shared = len(model.fit.values)
    count = len(projected.gram) - 1 - shared
    own = place.start + np.array(term.scored)
    outside = np.setdiff1d(np.arange(shared), np.arange(place.start, place.stop))
    rest = eliminated(projected.gram, outside, np.concatenate([own, shared + np.arange(count)]))
    size = len(own)
    away = model.fit.values[own] - term.absent[list(term.scored)]
    whole = float(away @ rest[:size, :size] @ away)
    losses: dict[str, float] = {}
    for other, columns in zip(projected.tried, projected.slices, strict=True):
        if other.effect.cable not in (None, term.effect.cable):
            continue
        at = slice(size + columns.start, size + columns.stop)
        low, high = (side[list(other.scored)] for side in other.effect.bounds(seen.context))
        cross, curvature = rest[at, :size] @ away, rest[at, at]
        best = bounded(curvature, cross, low, high)
        imitated = float(2 * cross @ best - best @ curvature @ best)
        loss = 0.5 * max(0.0, whole - imitated) / projected.inflation
        losses[other.effect.id] = min(loss, losses.get(other.effect.id, np.inf))
    return losses


def _by_fits(found: Selection, k: int) -> dict[str, float]:
    """Nats by which models lost that were fitted to whole windows and differ from the best in term k alone."""
    best = found.best.model
    kept = {h.effect for j, h in enumerate(best.tried) if j != k}
    losses: dict[str, float] = {}
    for candidate in found.tried:
        effects = {h.effect for h in candidate.model.tried}
        if candidate.model is best or len(effects) != len(best.tried) or not kept < effects:
            continue
        (other,) = effects - kept
        if other.cable in (None, best.tried[k].effect.cable):
            loss = max(0.0, evidence(best, candidate.model, max(1.0, best.fit.chi2_per_dof)))
            losses[other.id] = min(loss, losses.get(other.id, np.inf))
    return losses
