"""Thresholds for preferring models of whole windows: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class WholeMotionThresholds:
    """One field for each decision."""

    most_terms: int = 3
    """as many as the search over the first seconds may take"""
    shortlist: int = 8
    """effects fitted in one step: those that take most to first order"""
    nearly: float = 0.25
    """of the most that one effect takes to first order; scores are off by that where much is missing"""
    takes: float = 0.25
    """of the held-out sum of squares that a further term must take: as for additions elsewhere"""
    half: float = 0.5
    """of the held-out sum of squares that all terms together must take, before any is named; and of what the other
    search leaves, that they may leave"""
    odds: float = 3.0
    """nats: odds of 20, by which a rival must lose to be excluded"""
    begun: float = 10.0
    """times a usual survey, a centimetre for anchors, from which an open geometry is found; evidence moves it"""
    survey_rounds: int = 2
    """of offsets and of how many times a usual survey they are, in turn"""
    fewest: int = 3
    """windows that two models must both predict, before their scatter says anything"""
    tail: float = 0.05
    """chance that windows prefer the one model by accident, below which they prefer it"""


WHOLE_MOTION = WholeMotionThresholds()
