"""Thresholds for finding and accepting an unknown wrench: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class UnknownForceThresholds:
    """One field for each decision."""

    # by_place
    most_centres: int = 45
    """of a field in space"""
    by_place_widths: tuple[float, ...] = (0.08, 0.15, 0.3)
    """of a field in space, as shares of the room that was visited"""
    by_place_outside: float = 0.25
    """how far outside the room that was visited, in its diagonals, a centre of force is looked for"""

    # by_rate
    by_rate_powers: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0)
    by_rate_teeth: tuple[float, ...] = (4.0, 100.0, 2.0)
    """in one turn: from where to where, and by what they are tried"""
    by_rate_small: float = 1e-9
    """(m/s)² or (rad/s)² under a root: keeps derivatives finite at rest"""

    # by_time
    by_time_frequencies: tuple[float, float] = (0.2, 8.0)
    """Hz"""
    by_time_harmonics: int = 3
    knocks_at: tuple[float, float] = (0.3, 2.5)
    knocks_apart: float = 0.02
    """Hz: from where to where, and by what, frequencies of knocks are tried"""
    of_knocks: int = 10
    """harmonics: a platform of a few Hz hardly answers to what is faster"""

    # evidence
    evidence_folds: int = 12
    evidence_weaker: tuple[float, ...] = (1.0, 0.3, 0.1, 0.03)
    """times the prior sd with the most evidence: windows left out decide which"""
    evidence_best_starts: int = 2
    evidence_search: int = 90
    """evaluations from each of the best starts"""
    evidence_unseen: float = 1e-200
    """curvature of a push that falls between two samples, or after the last one: rounding"""

    # field
    field_every: int = 3
    """nodes: about 30 samples a second"""

    # joint
    joint_strides: tuple[float, float] = (5.0, 10.0)
    """s; from the horizon at which the unknown was looked at to whole windows"""

    # knocks
    knocks_phases: int = 48
    """angles that are tried"""
    knocks_widths: tuple[float, ...] = (0.02, 0.04, 0.08, 0.16)
    """s, standard deviation of a knock"""
    knocks_leaders: int = 3
    """windows, of which each in turn says first which force all feel"""

    # latent
    latent_most: int = 24
    """combinations of weights that are fitted"""
    latent_determined: float = 0.05
    """of a combination's prior variance that the data must take away"""

    # own_times
    own_times_ridge: float = 1e-4
    """of the curvature by the loudest weight: harmonics of which the windows tell next to nothing stay small"""

    # responses
    responses_spacing: float = 0.08
    """s between bumps: force up to about 5 Hz as it is, faster ones weaker; motion answers them with 1/ω² anyway"""
    responses_thin: int = 2
    """every second node is enough for the course of a force"""

    # unknown
    unknown_shorter: tuple[float, float] = (3.0, 1.0)
    """s; looked at otherwise"""
    unknown_fair: float = 0.25
    """of the best one's gain on windows left out: among families that reach it evidence decides. Windows left out are
    too strict a judge alone: what acts in places that one window visits cannot be foretold by the others"""
    unknown_as_evident: float = 0.98
    """of the log-evidence: what first order says of motions that the base misses by far is not surer"""
    nearly_all: float = 0.9
    """of the excess, of windows left out, too: what takes as much, and does not repeat, spares families that take
    long"""
    unknown_listed: int = 10
    unknown_second: float = 0.2
    """of the excess: where more is left, a second term is looked for"""
    unknown_feeble: float = 0.25
    """of that rest: a second term that takes less away from windows left out is none"""
    unknown_terms: int = 2
    """wrenches at most"""

    # words
    words_clearly: float = 0.3
    """mean power over mean of its size, beyond which it is said to brake or to drive"""
    words_linear: int = 12
    """weights of a force that grows in proportion to the place: each component's constant, then its three slopes"""
    words_others: float = 0.9
    """of the best one's gain: families that explain as much are said too"""


UNKNOWN_FORCE = UnknownForceThresholds()
