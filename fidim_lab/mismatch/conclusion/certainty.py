"""Which effects are named without a rival: fits of unlisted effects show where a good fit is no proof.

Leave an effect out of the catalogue, and others are put together until they imitate it: a damping of the swivels
becomes friction there with a tone and a drag beside it, that of a joint which sticks first becomes two drags. Each of
them has no rival that is nearly as good, so odds alone would make it certain
(`fidim benchmark explain --without EFFECT`).
"""

from dataclasses import replace

from fidim_lab.effects.equivalences import shared_by
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.merge_cleaning import HAND
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION


def only_certain(told: Explanation) -> Explanation:
    """The explanation with no name as the only one where its effects may be parts of something that is not listed.

    That is: where something stays unexplained, where there are several effects of one family, or many in all.
    """
    ids = [cause.id for cause in told.effects]
    laws = [id for id in ids if id != HAND]
    all_in_doubt = told.verdict is not Verdict.EXPLAINED or len(laws) >= CONCLUSION.certainty_many

    def in_doubt(place: int) -> bool:
        return all_in_doubt or any(shared_by((ids[place], id)) for k, id in enumerate(ids) if k != place)

    effects = (replace(one, single=one.single and not in_doubt(k)) for k, one in enumerate(told.effects))
    return replace(told, effects=tuple(effects))
