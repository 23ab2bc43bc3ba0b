"""Thresholds for cutting samples out and putting them back: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CleaningThresholds:
    """One field for each decision."""

    # clean
    clean_moves: float = 1.5
    """times their noise by fourth differences, up to which markers do not move: 1 is noise alone"""
    clean_fewest: int = 5
    """samples, without which fourth differences say nothing"""

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
    contacts_lively: float = 1.4
    contacts_often: float = 1 / 3
    """χ²/dof of a first segment over that of a usual one, and share of the windows that may begin so: more, and it is
    not a hand but how every motion begins"""
    contacts_foreseen: float = 3.0
    """robust standard deviations above what segments as lively as this one have, within which none stands out"""
    contacts_steepest: float = 10.0
    """power of the liveliness with which the excess of χ²/dof may grow"""
    contacts_lasting: float = 0.25
    """of the windows: more that are disturbed up to their ends show how the robot moves"""
    contacts_most: float = 0.6
    """of a window's segments; beyond, nothing in it is known to be free"""
    contacts_as_noise: float = 4.0
    """standard deviations of the usual χ²/dof up to which all windows' segments of one time are noise"""
    contacts_median: float = 1.25
    """times the standard deviation of a mean: that of the median, which a hand on a few windows does not move"""
    contacts_same_time: float = 0.1
    """s by which the edges of segments may differ that are pooled"""
    contacts_pooled: int = 4
    """windows, and at least half of all"""
    contacts_worth: float = 1.0
    """s of free motion, without which a part is not kept"""

    # hand_times
    departed: tuple[float, float] = (1.4, 3.0)
    risen: float = 3.6
    """least and most rms residual over `SMOOTH` numbers, in what it usually is, beyond which the motion is not free any
    more; between them a share of what it rises to: what a strong hand leaves bends the fit of the body, too"""
    hand_times_smooth: int = 48
    hand_times_known: int = 2
    """segments on either side, from which the motion is carried on"""
    not_fitted: float = 0.75
    earlier: float = 1.0
    """s before the segments with a contact: what is not fitted, and the most by which it may begin earlier"""
    hand_times_sooner: float = 0.25
    """s by which a soft push begins before it shows"""

    # odd_windows
    odd_windows_good: float = 1.5
    """times what is usual, up to which a window is as good as the others"""
    odd_windows_beside: float = 2.0
    """s of free motion on either side of a contact that are compared"""
    odd_windows_carried: float = 9.0
    """χ²/dof up to which a motion carried on over a contact still fits: it is less certain than a fitted one"""
    odd_windows_instant: float = 0.35
    """s at an edge of a window: shorter than any hand, and what samples a few rows from the edge cannot be judged
    alone"""
    odd_windows_better: float = 6.0
    """times smaller than without the fault"""

    # off_motion
    off_motion_off: float = 6.0
    """standard deviations of the noise that no sample of a fitted motion is off"""
    most_off: float = 0.2
    """of a marker's samples in a window that may be spikes"""
    off_motion_many: int = 5
    off_motion_often: int = 3
    """spikes of a marker, and windows in which it jumps, from which on it is known to be faulty"""
    off_motion_about: float = 0.15
    """s, within which jumps of several windows are at the same time; found they are to a tenth"""
    clearer_astray: float = 60.0
    """as `CLEARER`, of a fit far astray: what it leaves turns as sharply as the motion does"""

    # residual_checks
    residual_checks_rounds: int = 3
    """of looking at segments: what is weak shows only when what is stronger is gone"""
    residual_checks_odd: float = 1.5
    """times the median χ²/dof of the windows: far beyond chance (0.03 in 10 s); what is then done must be shown to
    help"""
    residual_checks_usual: float = 1.2
    """the most that this median may be: where every window lacks something it is not a fault of one"""
    most_odd: float = 0.25
    """of the windows: more are not odd (but one may always be)"""

    # restarts
    restarts_step: float = 0.25
    """s, between the times that are tried"""
    restarts_apart: float = 0.75
    """s of free motion on either side"""
    restarts_longest: float = 3.0
    """s that a push lasts at most"""
    restarts_chance: float = 1e-4
    """of one push found in all windows together where there is none"""
    restarts_few: float = 0.2
    """of the windows: more are no hand (but one may always be)"""
    restarts_certain: float = 2.0
    """standard deviations by which a longer push must leave less"""
    restarts_well: float = 5.0
    """standard deviations of χ² beyond its expectation, up to which two starts make good a window"""
    restarts_away: float = 1.0
    """s from a push, from where on a new start must do worse"""
    restarts_much_more: float = 40.0
    """χ², that must be left beyond the best with a new start away from it: 100 and more for hands, under 25 for
    physics"""
    restarts_unseen: float = 1e-11
    """of the largest eigenvalue of scaled normal equations, below which a direction is not seen at all"""

    # restored
    restored_alike: float = 4.0
    """times χ²/dof of the windows in which no hand was seen, within which a window is followed like them: a hand left
    in throws a prediction off by hundreds"""

    # segments
    segments_length: float = 2.0
    """s"""
    segments_fewest: int = 20
    """samples with a marker, without which a segment says nothing"""


CLEANING = CleaningThresholds()
