"""Thresholds for scaling and scanning hypotheses: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LinearisedThresholds:
    """One field for each decision."""

    # hypotheses
    periodic_size: int = 6
    """parameters of a periodic hypothesis that have a score: sin and cos in x, y, z"""
    most_scanned: int = 20
    """scan points of one effect"""
    hypotheses_broad: float = 10.0
    """times a parameter's scale: standard deviation of what is expected of it before any data"""


LINEARISED = LinearisedThresholds()
