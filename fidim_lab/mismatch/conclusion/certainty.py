"""Which effects are named without a rival: fits of unlisted effects show where a good fit is no proof.

If an effect is not in the catalogue, others combine to imitate it: a damping of the swivels
becomes friction there with a tone and a drag beside it, that of a joint which sticks first becomes two drags, a cable
that stretches a frame that yields, with a wrong anchor. Each of them may have no rival that is nearly as good, so
odds alone would make it certain (`fidim benchmark explain --without each`).
"""

from dataclasses import replace
from itertools import combinations

from fidim_lab.effects.effect import HandContact
from fidim_lab.effects.equivalences import holds_others, shared_by
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION


def only_certain(told: Explanation) -> Explanation:
    """The explanation with no name as the only one where its effects may be parts of something that is not listed.

    That is: where something stays unexplained, where there are several effects of one family, or many in all, and where
    one of them has a rival: what stands in its place would change the others. A steady force always has one: gravity
    that is tilted does the same.
    """
    laws = [cause for cause in told.effects if cause.id != HandContact.id]
    alike = any(shared_by((one.id, other.id)) for one, other in combinations(told.effects, 2))
    rivalled = any(holds_others(cause.id) or not cause.single for cause in laws)
    few = len(laws) < CONCLUSION.certainty_many
    certain = told.verdict is Verdict.EXPLAINED and few and not alike and not rivalled
    return replace(told, effects=tuple(replace(one, single=one.single and certain) for one in told.effects))
