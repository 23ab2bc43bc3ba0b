"""Comparing completed models: which has more evidence, and which predicts held-out windows better."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.fitting.refit import Completed, evidence
from fidim_lab.mismatch.residuals.whiteness import Whiteness, whiteness
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True, eq=False)
class Candidate:
    """One completed model with its figures on windows that it has not seen."""

    model: Completed
    held_out: HeldOut
    whiteness: Whiteness
    """of what is left of fitted and held-out windows"""

    @property
    def is_white(self) -> bool:
        """Whether nothing but noise is left."""
        return self.whiteness.is_white


def rest_of(model: Completed) -> float:
    """χ²/dof of what it was fitted to, beyond that of the noise."""
    return max(model.excess - 1, 0.0)


def candidate(model: Completed, held: HeldOut) -> Candidate:
    """A model with what it leaves of windows that it has not seen."""
    return Candidate(model, held, whiteness((*model.leftovers, *held.leftovers)))


def rank(judged: Candidate) -> float:
    """χ²/dof of held-out windows; of those that were fitted where there are none."""
    held = judged.held_out
    return held.chi2_per_dof if held.dof else judged.model.fit.chi2_per_dof


def improves(fresh: Candidate, best: Candidate, *, feeble: bool = False) -> bool:
    """Held-out windows get better; and where structure stays, a good part of it is taken away, unless `feeble`.

    Where the candidate is what makes all white, and follows a window farther than the best does or less far, that is
    enough: by how much a window is missed that cannot be followed says little.
    """
    before, after = best.held_out, fresh.held_out
    no_better = bool(before.dof and after.dof) and after.chi2_per_dof >= before.chi2_per_dof
    if no_better and (before.dof == after.dof or best.is_white or not fresh.is_white):
        return False
    rest = max(best.whiteness.excess, 1e-9)
    return feeble or fresh.is_white or rest - fresh.whiteness.excess > SHARED.some * rest


def accepted(best: Candidate, fresh: Sequence[Candidate], *, feeble: bool = False) -> Candidate | None:
    """The most convincing of those that also predict held-out windows better than `best`; None where there is none.

    feeble: also where most of what whole windows lack stays: it may be of something else, which drowns the rest there.
    """
    usable = [c for c in fresh if improves(c, best, feeble=feeble)]
    models = [c.model for c in usable]
    if not models:
        return None
    chosen = more_convincing(best.model, models) if best.model.whole else best_of(models)
    return None if chosen is None else of_model(chosen, usable)


def of_model(model: Completed, candidates: Iterable[Candidate]) -> Candidate | None:
    """The candidate of this very model; None where it is none of theirs."""
    return next((candidate for candidate in candidates if candidate.model is model), None)


def more_convincing(best: Completed, fresh: Sequence[Completed]) -> Completed | None:
    """Of models with more evidence than `best`, the one with most; of those within 5 nats, the smallest; or None."""
    scale = common_scale([best, *fresh])
    better = [m for m in fresh if evidence(m, best, scale) > SHARED.enough]
    return best_of(better) if better else None


def most_convincing(best: Completed, fresh: Sequence[Completed]) -> Completed:
    """As `more_convincing`; `best` where there is none."""
    return more_convincing(best, fresh) or best


def best_of(models: Sequence[Completed]) -> Completed:
    """That with most evidence; of those within 5 nats of it, the smallest."""
    scale = common_scale(models)
    top = max(models, key=lambda m: evidence(m, models[0], scale))
    near = [m for m in models if evidence(top, m, scale) < SHARED.enough]
    return min(near, key=lambda m: (len(m.tried), evidence(top, m, scale)))


def common_scale(models: Sequence[Completed]) -> float:
    """χ²/dof of the best of some models: what is left there counts as noise for all of them."""
    return max(1e-3, min(m.fit.chi2_per_dof for m in models))


def advantage(model: Completed, than: Completed) -> float:
    """Nats by which one model is more convincing than another; what the better one leaves counts as noise."""
    return evidence(model, than, common_scale([model, than]))


def evidence_of_all(judged: Candidate, than: Candidate, scale: float) -> float:
    """Log-evidence of one model over another of all windows: of those fitted, and of those held out given these.

    scale: as `evidence`; what the better one leaves of held-out windows counts as noise there. Those that only one of
    them can follow say nothing here.
    """
    before, after = than.held_out, judged.held_out
    noise = max(scale, min(before.chi2_per_dof, after.chi2_per_dof))
    held = 0.5 * (before.chi2 - after.chi2) / noise if before.dof == after.dof else 0.0
    return evidence(judged.model, than.model, scale) + held


def price(model: Completed, k: int) -> float:
    """Nats that doing without term k would cost, to first order."""
    place, tried = model.place_of(k), model.tried[k]
    away = (model.fit.values[place] - tried.absent)[list(tried.scored)]
    chosen = np.arange(place.start, place.stop)[list(tried.scored)]
    covariance = model.fit.covariance[np.ix_(chosen, chosen)]
    if not np.isfinite(covariance).all():
        return np.inf  # nothing is known of it: tried no further
    return 0.5 * float(away @ np.linalg.lstsq(covariance, away, rcond=1e-12)[0]) / max(1.0, model.fit.chi2_per_dof)
