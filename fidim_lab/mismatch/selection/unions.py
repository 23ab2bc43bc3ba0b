"""Terms of two models that both did well over the first seconds, fitted together from zero.

A term with much freedom (a hose, whose end may be anywhere) takes the share of another one too when it comes first;
beside it, bent so, the other is asked for no more. Begun together, each takes its own.
"""

from collections.abc import Sequence
from itertools import combinations

from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.hypotheses import PERIODIC, Hypothesis
from fidim_lab.mismatch.selection.candidates import rest_of
from fidim_lab.mismatch.thresholds import SHARED


def unions(raced: Sequence[Completed], most: int) -> list[tuple[Hypothesis, ...]]:
    """Sets of at most so many terms, of two models of the first seconds, that no model has; the best first.

    Without two forms of one effect, of which the data tell the sum alone; without what oscillates
    and cables that stretch, of which nothing begins from nothing.
    """
    if not raced:
        return []
    least = SHARED.near * min(rest_of(one) for one in raced)
    well = sorted((one for one in raced if rest_of(one) <= least), key=rest_of)
    seen = {frozenset(one.tried) for one in raced}
    found: list[tuple[Hypothesis, ...]] = []
    for one, other in combinations(well, 2):
        terms = tuple(dict.fromkeys((*one.tried, *other.tried)))
        able = len(terms) <= most and len({(h.effect.id, h.effect.cable) for h in terms}) == len(terms)
        if able and frozenset(terms) not in seen and not any(_begins_somewhere(h) for h in terms):
            seen.add(frozenset(terms))
            found.append(terms)
    return found[: SHARED.runners_up]


def _begins_somewhere(tried: Hypothesis) -> bool:
    return tried.effect.id in PERIODIC or stretches(tried.effect)
