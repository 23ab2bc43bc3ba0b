"""Which of two models of whole windows is preferred: by evidence of fitted windows and by held-out windows.

Evidence counts what a model leaves as noise of few independent values. It cannot know that another robot pose shows
another share of what is missing; the windows themselves do: how far the one predicts better differs from window to
window, and a mean that is within that scatter says nothing.
"""

import numpy as np
from scipy.stats import t as student

from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.whole_motion.models import WholeModel


def log_odds(model: WholeModel, than: WholeModel) -> float:
    """Nats of evidence for one model over another, by what the better of the two leaves."""
    temper = min(model.temper, than.temper)
    return model.nats(temper) - than.nats(temper)


def odds_of_all(model: WholeModel, than: WholeModel) -> float:
    """As `log_odds`, by all windows: what a model leaves of held-out ones counts as what it leaves of fitted ones."""
    both = [id for id in model.held if id in than.held]
    less = sum(than.held[id].chi2 - model.held[id].chi2 for id in both)
    return log_odds(model, than) + 0.5 * less / min(model.temper, than.temper)


def chance(model: WholeModel, than: WholeModel) -> float:
    """That windows held out prefer `model` by accident alone (one-sided t of log rms); 1 where too few windows tell."""
    both = [id for id in model.held if id in than.held]
    gains = np.array([np.log(than.held[id].rms / model.held[id].rms) for id in both])
    if len(gains) < SHARED.fewest:
        return 1.0
    spread = float(gains.std(ddof=1)) / np.sqrt(len(gains))
    return float(student.sf(gains.mean() / spread, len(gains) - 1)) if spread > 0 else float(gains.mean() <= 0)


def excludes(model: WholeModel, other: WholeModel) -> bool:
    """Whether the other cannot stand for the model: evidence says so by odds of 20, and windows held out agree.

    A wider model must be the more evident one: what it does by its freedom, the simpler one does without. Where the
    model leaves noise alone, evidence needs no second witness.
    """
    odds = log_odds(model, other)
    if other.parameters > model.parameters:
        return odds > 0.0
    if model.found.explained:
        return odds > ODDS
    return odds > ODDS and chance(model, other) < 1 - SHARED.confidence


def taken(before: WholeModel, after: WholeModel) -> float:
    """Share of the held-out sum of squares that goes; below 0 where it grows. Over windows that both predict."""
    both = [id for id in before.held if id in after.held]
    was = sum(before.held[id].chi2 / before.held[id].dof for id in both)
    now = sum(after.held[id].chi2 / after.held[id].dof for id in both)
    return 1.0 - now / was if was else 0.0
