"""Thresholds for cutting samples out and putting them back: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CleaningThresholds:
    """One field for each decision."""

    # all of them: how well pushes and hands are timed, and how much motion is looked at beside them
    segment: float = 2.0
    """s, of a window's segments, and of the free motion on either side of a contact that is compared"""
    timed: float = 0.25
    """s, between the times that are tried for a push; so much earlier it may have begun, before it shows"""
    beside: float = 0.75
    """s before a push that are not fitted, and least of free motion on either side"""
    free: float = 1.0
    """s of free motion, without which a part is not kept; from a push, from where on a new start must do worse; and the
    most by which a hand may begin before the segments that show it"""

    # common_push
    common_push_sharper: float = 3.0
    """times what a smooth hill over the whole window would lose as far away, that the gain of a new start must lose"""

    # contacts
    contacts_above: float = 1.8
    """times its neighbours' χ²/dof that a segment with a hand has; missing physics: up to 1.4"""
    contacts_far_above: float = 3.0
    """the same where the kinematics are contradicted; and what a hand has whose times each window shows by itself"""
    contacts_at_an_end: float = 5.0
    """the same where there is one neighbour only"""
    contacts_certain: float = 8.0
    """standard deviations of χ²/dof"""
    contacts_foreseen: float = 3.0
    """robust standard deviations above what segments as lively as this one have, within which none stands out"""
    contacts_most: float = 0.6
    """of a window's segments; beyond, nothing in it is known to be free"""
    contacts_pooled: int = 4
    """windows, and at least half of all"""

    # hand_times
    departed: tuple[float, float] = (1.4, 3.0)
    risen: float = 3.6
    """least and most rms residual over `hand_times_smooth` numbers, in what it usually is, beyond which the motion is
    not free any more; between them a share of what it rises to: what a strong hand leaves bends the
    fit of the body, too"""
    hand_times_smooth: int = 48
    """numbers (coordinates of markers) over which the residual is smoothed"""
    hand_times_known: int = 2
    """segments on either side, from which the motion is carried on"""

    # odd_windows
    odd_windows_carried: float = 9.0
    """χ²/dof up to which a motion carried on over a contact still fits: it is less certain than a fitted one"""
    odd_windows_instant: float = 0.35
    """s at an edge of a window: shorter than any hand, and what samples a few rows from the edge cannot be judged
    alone"""
    odd_windows_better: float = 6.0
    """times smaller than without the fault"""

    # off_motion
    off_motion_many: int = 5
    """spikes of a marker, from which on it is known to be faulty"""
    off_motion_off: float = 6.0
    """standard deviations of the noise that no sample of a fitted motion is off"""
    clearer_astray: float = 60.0
    """as `MARKERS.rivals_clearer`, of a fit far astray: what it leaves turns as sharply as the motion does"""

    # restarts
    restarts_longest: float = 3.0
    """s that a push lasts at most"""
    restarts_certain: float = 2.0
    """standard deviations by which a longer push must leave less"""
    restarts_much_more: float = 40.0
    """χ², that must be left beyond the best with a new start away from it: 100 and more for hands, under 25 for
    physics"""

    # restored
    restored_alike: float = 4.0
    """times χ²/dof of the windows in which no hand was seen, within which a window is followed like them: a hand left
    in throws a prediction off by hundreds"""

    # segments
    segments_fewest: int = 20
    """samples with a marker, without which a segment says nothing"""


CLEANING = CleaningThresholds()
