"""Thresholds for judging residuals: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ResidualThresholds:
    """One field for each decision."""

    # break_rivals
    break_rivals_reach: float = 0.3
    known_reach: float = 0.5
    """s on either side; of a marker that is known to jump"""
    break_rivals_fewest: int = 12
    break_rivals_most: int = 60
    """samples on either side, at least if so many lie within `break_rivals_farthest`, and at most"""
    break_rivals_farthest: float = 0.8
    """s"""
    break_rivals_degrees: tuple[int, ...] = (2, 4, 6)
    """of the polynomial beside a kink, a step or bad samples"""
    break_rivals_sharper: tuple[int, int] = (8, 10)
    """of motion alone, which may turn more sharply"""
    near: int = 2
    break_rivals_near_bad: int = 5
    """samples by which a step may be elsewhere; among which further samples may be off"""
    break_rivals_ramps: tuple[int, ...] = (3, 5, 8, 12)
    """samples, within which a body may have moved quickly, instead of a step between two"""
    break_rivals_faint: float = 4.0
    """standard deviations: missing physics in quick motion looks like steps of three"""

    # breaks
    breaks_scales: tuple[tuple[float, int], ...] = ((0.5, 4), (0.5, 6), (0.25, 4), (0.25, 6), (0.12, 4))
    """s on either side, and degree of the polynomial: the more telling first"""
    breaks_fewest: int = 8
    """samples on either side, whatever the rate"""
    breaks_level: float = 2.0
    """times the noise: scatter of samples about their neighbours, and of steps from place to place, up to which samples
    follow a polynomial"""
    breaks_around: float = 2.0
    breaks_samples: int = 100
    """s, and samples at least, over which that is looked at"""
    breaks_gap: int = 3
    """missing samples from which on a step may hide behind them"""
    breaks_plain: float = 36.0
    """by how much a step must be preferred behind a gap, over which no scan sees how smooth the motion is"""
    breaks_rounds: int = 12
    breaks_smallest_norm: float = 0.3
    """a break that the polynomial follows to 90 % cannot be judged"""

    # locate
    locate_segment: float = 0.5
    """s over which energy is summed up"""
    locate_worth: float = 0.5
    """of the correlation, from which a companion is named"""
    locate_finer: int = 4
    """times finer than 1/duration is the periodogram"""
    locate_highest: float = 25.0
    """Hz"""

    # whiteness
    whiteness_edges: tuple[float, ...] = (0.0, 0.75, 1.5, 3.0, 6.0, 10.0)
    """Hz, of the bands; above the last one is noise alone"""
    whiteness_narrow: float = 0.5
    """Hz, of each of the bands above it, in which a vibration shows: five lines of 10 s"""
    whiteness_vibrates: float = 0.02
    """of the noise's variance that a vibration must have: steps of integration leave ripples of 0.005"""
    whiteness_white: float = 1e-3
    """p-value from which on a remainder is called white"""
    whiteness_interpolated: float = 3.0
    """times the variance above the last edge that noise may have below it: readings of another clock were interpolated,
    which takes up to 2.6 away there at 100 Hz"""
    fewest_reference: int = 100
    """degrees of freedom above the last edge; with fewer the declared noise is believed"""


RESIDUALS = ResidualThresholds()
