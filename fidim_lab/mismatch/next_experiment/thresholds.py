"""Thresholds for choosing a next window: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NextExperimentThresholds:
    """One field for each decision."""

    # next_windows
    next_windows_pool: int = 36
    """random windows among which the best is chosen"""

    # proposal
    proposal_clear: float = 0.9
    """odds at which an experiment is said to separate"""

    # separate
    separate_rate: float = 25.0
    """samples a second that are computed with; the noise is made smaller for those left out"""
    most_windows: int = 12
    """further windows that a set may have"""


NEXT_EXPERIMENT = NextExperimentThresholds()
