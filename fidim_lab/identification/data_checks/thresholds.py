"""Thresholds for checks of a campaign without dynamics: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DataCheckThresholds:
    """One field for each decision."""

    # encoder_check
    encoder_check_fewest: int = 10
    """samples on either side of a step"""
    encoder_check_steps: float = 5.0
    """encoder resolutions: smaller is not a slip"""
    encoder_check_certain: float = 8.0
    """standard deviations of what is left on either side, over √N"""
    encoder_check_share: float = 0.5
    """of the variance that one step must explain; a length that follows the tension is compliance, not a slip"""

    # noise_check
    noise_check_spread: float = 0.055
    """standard deviation of the logarithm of `noise_of` for one coordinate of 1000 samples"""
    noise_check_certain: float = 6.0
    """standard deviations"""
    noise_check_campaign: float = 0.08
    noise_check_channel: float = 0.15
    noise_check_window: float = 0.3
    """relative differences that are worth a word: all from the declared, one coordinate or one window from the
    others"""

    # redundancy
    redundancy_every: float = 0.1
    """s"""
    worst_condition: float = 5.0
    """of the free motions as markers see them: beyond, near a fold of the surface, the pose may be on the wrong side"""
    redundancy_contradicts: float = 1.5
    """times what noise and encoder resolution give"""
    redundancy_fewest: int = 5
    """samples"""
    redundancy_lift: float = 0.05
    """of the weight: losses and scale of currents make that much"""

    # robot_changes
    robot_changes_few: int = 5
    """cables, of which all orders are tried"""

    # robot_mistakes
    robot_mistakes_samples: int = 4
    """poses of each window"""
    robot_mistakes_windows: int = 8
    robot_mistakes_close: float = 1e-3
    """m, to which markers and lengths are weighted"""
    robot_mistakes_upright: float = 0.25
    """rad, how far the platform may lean"""
    robot_mistakes_rounds: int = 12
    robot_mistakes_longest: float = 0.3
    """m or rad in one step"""
    robot_mistakes_better: float = 5.0
    """times smaller the misfit must become"""
    robot_mistakes_tie: float = 1.5
    """within this factor of the best, another change is named beside it"""
    robot_mistakes_fitted: float = 0.02
    """m of misfit, up to which a fitted frame or marker is only perhaps the mistake: pulleys 2.7 mm off make 5 mm, and
    a frame 17 mm aside imitates them to 0.6 mm"""
    robot_mistakes_noise: float = 3.0
    """times the noise of markers and encoders that is left where a frame truly is the mistake: 1, and 6 in that case"""
    robot_mistakes_part: float = 5e-3
    """m, from which on something is wrong besides"""
    hopeless: float = 0.05
    """m: what misses by more is no fit, and no effect of the catalogue makes as much"""

    # screening
    screening_gross: float = 5e-3
    """m of kinematic misfit, from which simple mistakes of the robot file are looked for"""
    screening_few: int = 3
    """windows that are compared when the robot file is plainly wrong"""


DATA_CHECKS = DataCheckThresholds()
