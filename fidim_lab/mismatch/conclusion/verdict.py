"""The verdict, from the residuals of fitted and held-out windows and the effects named."""

from dataclasses import dataclass

from fidim_lab.effects.effect import UnknownEffect
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce


@dataclass(frozen=True, eq=False)
class Judged:
    """The conclusion."""

    verdict: Verdict
    named: Candidate
    """the model whose effects are named: the baseline where none are"""
    outdone_by: UnknownForce | None = None
    """the unknown wrench that explains more than the effects found"""
    law: Candidate | None = None
    """the best model, where it has a law of force that no effect of the catalogue has"""

    @property
    def known(self) -> bool:
        """Whether effects are named."""
        return self.verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)


def judge(found: Selection) -> Judged:
    """The verdict on where the search ended."""
    if found.outdone is not None:
        return Judged(Verdict.UNKNOWN_PHYSICS, found.baseline, found.alone)
    if any(h.effect.id == UnknownEffect.id for h in found.best.model.tried):
        return Judged(Verdict.UNKNOWN_PHYSICS, found.baseline, law=found.best)
    verdict = _verdict(found)
    known = verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)
    return Judged(verdict, found.best if known else found.baseline)


def _verdict(found: Selection) -> Verdict:
    best = found.best
    if not best.model.tried:
        return Verdict.NOTHING_MISSING if best.is_white else Verdict.UNKNOWN_PHYSICS
    left = best.held_out.chi2_per_dof if best.held_out.dof else best.model.fit.chi2_per_dof
    if best.is_white:
        if left <= SHARED.little * max(1.0, best.model.fit.chi2_per_dof):
            return Verdict.EXPLAINED
        # so loosely determined that its own errors cover what it misses: such a fit has not been tested
        lacked = found.baseline.held_out.chi2_per_dof - 1.0
        mostly = left - 1.0 <= (1.0 - SHARED.nearly_all) * lacked
        return Verdict.PARTLY_EXPLAINED if mostly else Verdict.UNKNOWN_PHYSICS
    before, after = found.baseline.whiteness.excess, best.whiteness.excess
    taken = SHARED.nearly_all if left <= SHARED.little else CONCLUSION.beyond_siblings
    if best.model.at_an_edge:
        return Verdict.UNKNOWN_PHYSICS  # pressed as far as is possible at all, it stands in for something else
    if any(h.effect.of_each_window for h in best.model.tried):
        if left > CONCLUSION.verdict_white:
            return Verdict.UNKNOWN_PHYSICS  # free in every window, it takes much of anything
        taken = CONCLUSION.beyond_siblings
    return Verdict.PARTLY_EXPLAINED if after < (1 - taken) * before else Verdict.UNKNOWN_PHYSICS
