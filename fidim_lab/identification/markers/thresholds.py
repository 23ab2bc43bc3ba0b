"""Thresholds for single marker tracks: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MarkerThresholds:
    """One field for each decision."""

    # clock_check
    clock_check_uneven: float = 0.02
    """of a step: stamps farther than this from the grid are said to be uneven"""
    other_rate: float = 0.005
    """of the sample rate"""

    # displaced
    false_alarm: float = 1e-3
    """per campaign, for each of the two tests (single coordinate, three together)"""
    displaced_margin: float = 1.05
    """for noise that was underestimated"""
    displaced_nothing: float = 0.8
    """of what a score must be: steps that add up to less cancel"""
    displaced_clearer: float = 1.15
    """times as telling a step must be, where a spike would do; a true one is 1.4 times"""
    displaced_rounds: int = 60
    displaced_short: int = 3
    """samples: displaced stretches up to this are spikes"""

    # frozen
    frozen_shortest: int = 3
    """identical samples"""
    frozen_chance: float = 1e-6
    """probability, in a window, that rounding of noisy values gives such a run"""

    # levels
    levels_enough: float = 2.0
    """s"""
    levels_same: float = 2.0
    """standard deviations of a coordinate, within which a marker that was displaced twice is where it was"""

    # lost_frames
    lost_frames_side: int = 10
    lost_frames_smooth: int = 7
    """samples on either side, and degree, of the polynomial through a place where frames may be lost"""
    most_lost: int = 20
    """frames"""
    plainer: float = 0.7
    """times the χ²/dof of one displaced sample, or a step, that lost frames must come down to"""
    lost_frames_fits: float = 2.0
    """χ²/dof up to which the motion with lost frames is smooth"""

    # neighbours
    neighbours_degree: int = 6
    neighbours_reach: float = 0.08
    """s on either side"""
    fewest_spare: int = 2
    """neighbours beyond the coefficients of the polynomial, without which a sample is not judged"""
    fewest_beside_step: int = 4
    """samples on either side of a step: with fewer it cannot be told from spikes"""
    neighbours_smallest_norm: float = 0.1
    """a displacement that the polynomial follows to 99 % cannot be judged"""
    neighbours_mad: float = 0.6745
    """median of |normal| in standard deviations"""
    much_less: float = 0.85
    """of the noise by fourth differences: below, by eighth, it is believed instead (three standard deviations)"""

    # rigid_steps
    rigid_steps_reach: float = 1.0
    """s on either side, over which distances are averaged"""
    rigid_steps_fewest: int = 20
    """samples on either side"""
    rigid_steps_chance: float = 1e-3
    """of one step found in a whole campaign in which none is"""
    rigid_steps_still: float = 4.0
    """times the largest change elsewhere in the window, in χ², that a step makes"""
    rigid_steps_others: int = 3
    """markers, without which nothing says which of two has jumped"""
    rigid_steps_unsure: float = 12.0
    """χ², within which of the best another sample may be the first after the step, or another marker the one that
    jumps"""
    rigid_steps_most: int = 4
    """steps of one window"""
    rigid_steps_seen: float = 0.2
    """of the largest: directions that distances show less are not said to be moved in"""

    # rivals
    rivals_reach: int = 7
    rivals_degree: int = 5
    """samples on either side, and degree of the polynomial"""
    rivals_sharper: tuple[int, int] = (7, 9)
    """degrees of motion that turns more sharply"""
    rivals_most_bad: int = 3
    """samples that may be displaced at once"""
    rivals_near_bad: int = 3
    """samples on either side among which they are looked for"""
    rivals_fewest: int = 3
    """samples beyond all unknowns, without which nothing is said"""
    rivals_clearer: float = 12.0
    """by which the criterion must prefer a fault to motion and blow: a factor of 400 in odds"""

    # noise
    finest: float = 0.1
    """of the stated noise: nothing is judged by less. Cameras err slowly by more (the paper's frames scatter by a
    fifth); without any, as simulations are written, rounding, encoders and ways to integrate would be told"""

    # samples
    samples_fewest: int = 30
    """samples, without which a window is not looked at"""


MARKERS = MarkerThresholds()
