"""Effects that the data at hand cannot tell apart, from the information matrix of the scores."""

from fidim_lab.mismatch.hypotheses import Hypothesis
from fidim_lab.mismatch.score import explained_share
from fidim_lab.mismatch.select import Selection

ALIKE = 0.9995
"""of one hypothesis's influence that another imitates: from here on the data do not separate them"""
MOST_ALIKE = 3


def alike(found: Selection, named: Hypothesis) -> tuple[str, ...]:
    """Other ids that imitate this one's influence, the most alike first."""
    original = next((h for h in found.projected.tried if h.effect == named.effect), None)
    if original is None:
        return ()
    shares: dict[str, float] = {}
    for other in found.projected.tried:
        if other.effect.id == named.effect.id or other.effect.cable not in (None, named.effect.cable):
            continue
        share = explained_share(found.projected, original, other)
        if share >= ALIKE:
            shares[other.effect.id] = max(share, shares.get(other.effect.id, 0.0))
    return tuple(sorted(shares, key=lambda id: -shares[id]))[:MOST_ALIKE]
