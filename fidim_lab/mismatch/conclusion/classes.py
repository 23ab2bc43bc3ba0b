"""Effects that the data at hand cannot tell apart: by the information matrix at the fitted model, and by fits.

Where another effect in the place of a named one loses less than 5 nats, the data say nothing between the two.
"""

import numpy as np

from fidim_lab.mismatch.fitting.refit import evidence
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.selection.confounders import imitators
from fidim_lab.mismatch.selection.select import Selection


def alike(found: Selection, k: int) -> tuple[str, ...]:
    """Other ids that may stand in the place of term k of the best model, the most alike first."""
    named = found.best.model.tried[k].effect.id
    seen = imitators(found.last, k) if found.best.model.whole else ()
    losses = {one.tried.effect.id: one.loss for one in seen}
    for id, loss in _by_fits(found, k).items():
        losses[id] = min(loss, losses.get(id, np.inf))
    close = sorted((loss, id) for id, loss in losses.items() if id != named and loss < SCORES.enough)
    return tuple(id for _, id in close)


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
