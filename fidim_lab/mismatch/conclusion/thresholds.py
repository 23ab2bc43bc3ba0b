"""By which figures a verdict is reached and told: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ConclusionThresholds:
    """One field for each decision."""

    # certainty
    certainty_many: int = 3
    """effects, of which none is told as the only one: of 2 that imitated a left-out one all had 3 or more, or left
    something unexplained"""
    sized: float = 5.0
    """sd from 0 of the amplitudes of each named effect together, for any name of the model to be the only one: 10 and
    more in right answers (golden files), 1.2 of a loose mass that stood for drag that was not listed"""

    # explanation
    most_alike: int = 3
    """effects in `equivalent_to` of the file, by spec/formats.md; the others are in `further_equivalent`"""

    weight_told: float = 0.95
    """of the posterior weight, that the effects hold which are told as not told apart"""

    # merge_cleaning
    merge_cleaning_places: int = 6
    """faults that are listed each in a place of its own; the others are counted in the message"""
    merge_cleaning_repeated: int = 3
    """faults of sensors from which on a contradiction of the kinematics that has no name is put down to them"""

    # message
    most_places: int = 5

    # parsimony_check
    parsimony_check_many: int = 9
    """parameters of effects, from which they may stand for anything, and all is tried that has no name"""
    parsimony_check_several: int = 2
    """effects, from which a single wrench is asked for that does nearly all"""

    # ranking
    ranking_listed: int = 8
    """entries of the ranking that were scored but not fitted"""
    ranking_briefly: int = 4
    """entries that were fitted to the first seconds alone"""

    # timing
    timing_clear: float = 5.0
    """standard deviations beyond which an offset is named: once in a million without one"""
    timing_smallest: float = 3e-4
    """s; less matters to nobody, and current loops lag as much"""
    timing_slowest: float = 5e-5
    """of a rate: what cheap quartz clocks have, and less than anybody would notice"""
    timing_farthest: float = 0.3
    timing_stride: float = 0.01
    """s, of the first look"""
    timing_rounds: int = 4
    timing_fewest: int = 3
    """courses"""
    timing_samples: int = 50
    """of a window, with fewer of which it is not asked"""

    # unknown_table
    unknown_table_samples: int = 600
    """of the wrench that are kept: fifty of each of twelve windows, enough for pictures"""
    unknown_table_digits: int = 5
    """significant, of what is drawn"""

    # verdict
    verdict_white: float = 1.03
    """held-out χ²/dof up to which an effect with a phase of its own in every window may be a part of the truth"""
    all_but_noise: float = 1.1
    """held-out χ²/dof up to which little is left, whatever it is"""
    verdict_mostly: float = 0.9
    """of the excess that named effects must take away, where little is left, to count as a part of the truth"""
    beyond_siblings: float = 0.99
    """the same where more is left: of what something else does, a sibling takes 0.94 to 0.97 (drag by swivel damping,
    dry friction by damping: spec/findings.md), so that a name which takes no more may be a mere stand-in"""


CONCLUSION = ConclusionThresholds()
