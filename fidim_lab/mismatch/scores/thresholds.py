"""Thresholds for accepting scores: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ScoreThresholds:
    """One field for each decision."""

    # frequencies
    frequencies_turn: float = 0.2
    """turns in a whole window between the frequencies that are tried at last"""
    frequencies_loudest: int = 16
    """frequencies of the scan that are tried"""

    # own_phase
    own_phase_rounds: int = 6
    """of finding phases and amplitude in turn"""
    own_phase_phases: int = 72
    """angles that are tried"""

    # score
    longest_look: int = 200
    """pairs of which the best values within bounds are computed"""

    # own_phase, views
    by_a_tone: float = 0.85
    """of what is left, from which a tone is tried before anything else (of what frictions leave, it takes half); and of
    what tones with amplitudes of each window would take, that one amplitude must"""

    # views
    views_tie: float = 10.0
    """nats, beside `SHARED.slight`, by which a score may be off where the motion is followed"""
    views_periods: float = 2.0
    """of such a tone, beside other terms, within what is looked at"""


SCORES = ScoreThresholds()
