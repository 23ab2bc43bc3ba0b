"""Thresholds for finding and accepting an unknown wrench: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class UnknownForceThresholds:
    """One field for each decision."""

    # evidence
    evidence_folds: int = 12
    """parts at most into which windows are divided, each left out in turn"""
    evidence_weaker: tuple[float, ...] = (1.0, 0.3, 0.1, 0.03)
    """times the prior sd with the most evidence: windows left out decide which"""
    evidence_search: int = 90
    """evaluations from each of the best starts"""

    # field
    field_every: int = 3
    """nodes: about 30 samples a second"""

    # joint
    joint_strides: tuple[float, float] = (5.0, 10.0)
    """s; from the horizon at which the unknown was looked at to whole windows"""

    # latent
    latent_most: int = 24
    """combinations of weights that are fitted"""
    latent_determined: float = 0.05
    """of a combination's prior variance that the data must take away"""

    # responses
    responses_spacing: float = 0.08
    """s between bumps: force up to about 5 Hz as it is, faster ones weaker; motion answers them with 1/ω² anyway"""
    responses_thin: int = 2
    """every second node is enough for the course of a force"""

    # unknown
    unknown_terms: int = 2
    """wrenches at most"""

    # words
    words_clearly: float = 0.3
    """mean power over mean of its size, beyond which it is said to brake or to drive"""


UNKNOWN_FORCE = UnknownForceThresholds()
