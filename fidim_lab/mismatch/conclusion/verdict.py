"""The verdict, by what is left of fitted and held-out windows, and what is named."""

from dataclasses import dataclass

from fidim_lab.effects.without_term import Unknown
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.unknown_force.unknown import Unknown as Wrench

WHITE = 1.03
"""held-out χ²/dof up to which an effect with a phase of its own in every window may be a part of the truth"""
ALL_BUT_NOISE = 1.1
"""held-out χ²/dof up to which little is left, whatever it is"""
MOSTLY = 0.9
"""of the excess that named effects must take away, where little is left, to count as a part of the truth"""
BEYOND_SIBLINGS = 0.99
"""the same where more is left: of what something else does, a sibling takes 0.94 to 0.97 (drag by swivel damping, dry
friction by damping: FINDINGS.md), so that a name which takes no more may be a mere stand-in"""


@dataclass(frozen=True, eq=False)
class Judged:
    """What is concluded."""

    verdict: Verdict
    named: Candidate
    """the model whose effects are named: the baseline where none are"""
    outdone_by: Wrench | None = None
    """the wrench without a name that says more than the effects which the search has found"""

    @property
    def known(self) -> bool:
        """Whether effects are named."""
        return self.verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)


def judge(found: Selection) -> Judged:
    """The verdict on where the search ended."""
    if found.outdone is not None:
        return Judged(Verdict.UNKNOWN_PHYSICS, found.baseline, found.alone)
    verdict = _verdict(found)
    known = verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)
    return Judged(verdict, found.best if known else found.baseline)


def _verdict(found: Selection) -> Verdict:
    best = found.best
    if any(h.effect.id == Unknown.id for h in best.model.tried):
        return Verdict.UNKNOWN_PHYSICS  # a law that nothing of the catalogue has
    if best.is_white:
        return Verdict.EXPLAINED if best.model.tried else Verdict.NOTHING_MISSING
    if not best.model.tried:
        return Verdict.UNKNOWN_PHYSICS
    before, after = found.baseline.whiteness.excess, best.whiteness.excess
    left = best.held_out.chi2_per_dof if best.held_out.dof else best.model.fit.chi2_per_dof
    taken = MOSTLY if left <= ALL_BUT_NOISE else BEYOND_SIBLINGS
    if best.model.at_an_edge:
        return Verdict.UNKNOWN_PHYSICS  # pressed as far as is possible at all, it stands in for something else
    if any(h.effect.of_each_window for h in best.model.tried):
        if left > WHITE:
            return Verdict.UNKNOWN_PHYSICS  # free in every window, it takes much of anything
        taken = BEYOND_SIBLINGS
    return Verdict.PARTLY_EXPLAINED if after < (1 - taken) * before else Verdict.UNKNOWN_PHYSICS
