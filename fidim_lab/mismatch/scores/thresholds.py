"""Thresholds for accepting scores: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ScoreThresholds:
    """One field for each decision."""

    # alarms
    alarms_draws: int = 10_000
    alarms_seed: int = 1
    alarms_confidence: float = 3.0
    """draws without an alarm that make its rate less than CONFIDENCE / draws, at 95 %"""

    # frequencies
    frequencies_turn: float = 0.2
    """turns in a whole window between the frequencies that are tried at last"""
    frequencies_loudest: int = 16
    """frequencies of the scan that are tried"""
    frequencies_few: int = 50
    """samples, with fewer of which a window has no spectrum"""

    # own_phase
    own_phase_rounds: int = 6
    """of finding phases and amplitude in turn"""
    own_phase_phases: int = 72
    """angles that are tried"""
    own_phase_same: float = 0.85
    """of what tones with amplitudes of their own would take in each window"""

    # score
    score_tiny: float = 1e-12
    longest_look: int = 200
    """pairs of which the best values within bounds are computed"""

    # views
    enough: float = 5.0
    """log-evidence below which a term is not believed: never reached in 20 000 null draws (spec/findings.md)"""
    shortest_view: float = 1.0
    """s, of the view where not even the first seconds are followed"""
    views_singles: int = 3
    views_pairs: int = 3
    """how many are fitted"""
    views_nearly: float = 0.5
    """of the best log-evidence: what has less is not fitted"""
    views_racing: int = 8
    racing_nearly: float = 0.25
    of_one_kind: int = 2
    """the same where the model follows less than it was fitted to: fits are short there, and scores far off"""
    views_tie: float = 10.0
    slight: float = 0.02
    """nats, and share of the best log-evidence, by which a score may be off where the motion is followed"""
    feeble: float = 0.25
    """of what is left: an addition to whole windows that takes less, and leaves structure, ends the search"""
    nearly_all_by_a_tone: float = 0.85
    """of what is left: a tone that takes as much is tried before anything else; of what frictions leave one takes
    half"""
    views_periods: float = 2.0
    """of such a tone, beside other terms, within what is looked at"""


SCORES = ScoreThresholds()
