"""By which figures a verdict is reached and told: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ConclusionThresholds:
    """One field for each decision."""

    # certainty
    certainty_many: int = 3
    """effects, of which none is told as the only one: of 2 that imitated a left-out one all had 3 or more, or left
    something unexplained"""

    # message
    message_faint: float = 30.0
    """standard deviations of an effect's size, below which it is not told as the only one: what is not listed is
    imitated by what is to 0.94 to 0.97 of its χ² (spec/findings.md), and of 30² the rest, 0.03, is what one more term
    must take to be believed, 5 nats beside its freedom"""

    # parsimony_check
    parsimony_check_many: int = 9
    """parameters of effects, from which they may stand for anything, and all is tried that has no name"""
    parsimony_check_several: int = 2
    """effects, from which a single wrench is asked for that does nearly all"""

    # timing
    timing_smallest: float = 3e-4
    """s; less matters to nobody, and current loops lag as much"""
    timing_slowest: float = 5e-5
    """of a rate: what cheap quartz clocks have, and less than anybody would notice"""
    timing_farthest: float = 0.3
    """s, of an offset that is looked for"""
    timing_stride: float = 0.01
    """s, of the first look"""

    # verdict
    verdict_white: float = 1.03
    """held-out χ²/dof up to which an effect with a phase of its own in every window may be a part of the truth"""
    beyond_siblings: float = 0.99
    """the same where more is left: of what something else does, a sibling takes 0.94 to 0.97 (drag by swivel damping,
    dry friction by damping: spec/findings.md), so that a name which takes no more may be a mere stand-in"""


CONCLUSION = ConclusionThresholds()
