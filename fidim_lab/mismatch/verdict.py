"""The verdict, by what is left of fitted and held-out windows, and what is named."""

from dataclasses import dataclass

from fidim_lab.mismatch.explanation import Verdict
from fidim_lab.mismatch.select import WHITE, Candidate, Selection, is_white

MOSTLY = 0.9
"""of the held-out excess that named effects must take away to count as a part of the truth"""
HALF = 0.5
"""of the excess that an effect known by its score alone must explain"""


@dataclass(frozen=True, eq=False)
class Judged:
    """What is concluded."""

    verdict: Verdict
    named: Candidate
    """the model whose effects are named: the baseline where none are"""

    @property
    def known(self) -> bool:
        """Whether effects are named."""
        return self.verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)


def judge(found: Selection) -> Judged:
    """The verdict on where the search ended."""
    verdict = _verdict(found)
    known = verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED)
    return Judged(verdict, found.best if known else found.baseline)


def _verdict(found: Selection) -> Verdict:
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
