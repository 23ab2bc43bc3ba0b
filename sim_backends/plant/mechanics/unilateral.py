"""Which cables pull: a cable can go slack and come back. Both decisions are small complementarity problems.

Tensions and impulses are never negative, a taut cable never gets longer than it is, and of the two one is always zero:
Gauss' principle of least constraint (Moreau's form), solved as non-negative least squares.
"""

import numpy as np
from scipy.optimize import nnls

SLACKENING = 1e-7
"""m and m/s: a slack cable further beyond its length than this, and getting longer faster, has become taut"""
STICKING = 2e-3
"""m/s: a cable at its length that moves away slower than this, and would come back, stays taut"""


def pushes(condensed: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """p ≥ 0 with condensed·p − wanted ≥ 0 and p·(condensed·p − wanted) = 0, for a positive definite matrix (m, m).

    With J M⁻¹ Jᵀ and the excess of acceleration (m/s²) these are tensions, N; with that of rate (m/s) impulses, N s.
    """
    factor = np.linalg.cholesky(condensed)
    return nnls(factor.T, np.linalg.solve(factor, wanted))[0]


def impact(condensed: np.ndarray, too_fast: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Impulses (m,), N s, that stop touching cables from getting longer, without any rebound.

    Args:
        condensed: J M⁻¹ Jᵀ, (m, m).
        too_fast: l̇ − l̇₀ of every cable, m/s.
        touching: which cables are at their length.
    """
    impulses = np.zeros(len(too_fast))
    at = np.flatnonzero(touching)
    if at.size:
        impulses[at] = pushes(condensed[np.ix_(at, at)], too_fast[at])
    return impulses


def taut(condensed: np.ndarray, excess: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Which of the touching cables pull (m,), from the excess of l̈ that the platform would have without tensions."""
    pulling = np.zeros(len(excess), dtype=bool)
    at = np.flatnonzero(touching)
    if at.size:
        pulling[at] = pushes(condensed[np.ix_(at, at)], excess[at]) > 0
    return pulling
