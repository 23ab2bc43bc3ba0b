"""Thresholds that several stages of the search share: one quantity, one value. Unit, reason and evidence of each.

What only one stage needs is in that stage's own `thresholds`. Horizons of time (s) are `stages.HORIZONS`, and odds of
20 are `evidence.ODDS`, both of `identification.mle`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class SharedThresholds:
    """One field for each quantity."""

    # evidence
    enough: float = 5.0
    """nats below which a term is not believed: never reached in 20 000 null draws (spec/findings.md)"""
    close: float = 25.0
    """nats within which a model may still win once it is fitted to whole windows, or given a more general form"""
    certain: float = 5.0
    """standard deviations beyond which a size, an offset or a misfit is not chance: once in a million"""
    chance: float = 1e-4
    """per campaign, that noise alone shows a push, or a place with structure"""
    confidence: float = 0.95
    """of a statement about which windows or which effects: of posterior weight, or against chance"""
    slight: float = 0.02
    """of the best log-evidence, by which a score to first order may be off where the motion is followed"""
    nearly: float = 0.25
    """the same where the motion is not followed: what has less than this part of the best is not fitted"""

    # of what a model leaves beyond noise, or of what the best one takes away
    some: float = 0.25
    """an addition that takes less, and leaves structure, ends the search; a plainer model that takes more is fair"""
    half: float = 0.5
    """a model that leaves more is no explanation: what has no name is taken up in part by any wide model, too"""
    nearly_all: float = 0.9
    """what takes as much is most of it: it spares further looks, and is part of the truth where little is left"""
    crawl: float = 0.01
    """a further round that takes less is the last one, where a fit leaves more than noise"""

    # χ²/dof
    little: float = 1.1
    """up to which little is left, whatever it is; and ratio of two fits, up to which one is as good as the other"""
    near: float = 3.0
    """below which a motion is followed well enough for first-order statements about it"""
    hopeless: float = 30.0
    """of the first seconds, from which a model is not tried on whole windows; of whole windows, not judged"""
    usual: float = 1.5
    """times what is usual, up to which a window is as good as the others: chance gives 1.03 in 10 s"""
    noise: float = 1.25
    """times the noise, up to which the scatter of samples about a polynomial is noise"""

    # windows
    few: float = 0.25
    """of all windows, or of a window's samples: a fault or a hand that touches more is how the robot moves"""
    fewest: int = 3
    """windows, below which neither their order nor their scatter says anything"""
    repeated: int = 3
    """faults of one kind, from which on a sensor is known to be faulty"""
    at_once: float = 0.15
    """s, within which what happens in several windows happens at the same time; found it is to a tenth"""
    samples: int = 50
    """of a window, with fewer of which it has no spectrum and no clock of its own"""

    # how much is tried
    most_terms: int = 3
    """effects, or kinds of errors, in one model"""
    leaders: int = 3
    """models that are fitted, where scores rank them well"""
    runners_up: int = 2
    """alternatives to what is best already that are fitted"""
    shortlist: int = 8
    """models that are fitted, where scores rank them badly"""
    rounds: int = 3
    """of two steps that depend on each other, each begun with what the other found; they settle in two"""
    wide: float = 10.0
    """times what is usual of a parameter or a survey: what is expected of it before any data"""


SHARED = SharedThresholds()
