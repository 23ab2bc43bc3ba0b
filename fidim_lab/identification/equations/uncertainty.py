"""Uncertainty from the spread between windows: jackknife and block bootstrap.

The nominal covariance (Eq. 32) assumes independent errors of one size in all of W. Model error is neither independent
nor of one size, but it differs from window to window, so leaving windows out (jackknife) or drawing them anew (block
bootstrap) shows it. Both work on each window's triangular factor and cost next to nothing.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.errors import RefusedError

MIN_WINDOWS = 3
"""with fewer the spread says nothing"""
DRAWS = 400
SEED = 20211
"""fixed: the same campaign gives the same numbers"""

Block = Float[np.ndarray, "rows 10"]
Solver = Callable[[Block, int], np.ndarray]
"""stacked equations and their number of independent rows → nine parameters"""


def leave_one_out(blocks: Sequence[Block], rows: Sequence[int], solve: Solver) -> Float[np.ndarray, "W 9"] | None:
    """The estimate without each window in turn; None with fewer than three windows.

    Raises RefusedError when what is left without one window no longer identifies a body.
    """
    if len(blocks) < MIN_WINDOWS:
        return None
    everything = range(len(blocks))
    return np.array([_solve_subset(blocks, rows, [k for k in everything if k != out], solve) for out in everything])


def jackknife_sd(replicates: Float[np.ndarray, "W ..."]) -> np.ndarray:
    """Delete-one standard deviation √((W − 1)/W Σ (θ_k − θ̄)²) of anything computed from each replicate."""
    count = len(replicates)
    return np.sqrt((count - 1) / count * ((replicates - replicates.mean(axis=0)) ** 2).sum(axis=0))


def bootstrap_sd(
    blocks: Sequence[Block], rows: Sequence[int], solve: Solver, *, draws: int = DRAWS, seed: int = SEED
) -> Float[np.ndarray, "9"] | None:
    """Standard deviation over `draws` campaigns of as many windows, drawn with replacement; None below three windows.

    Draws that do not identify a body (one window drawn nearly every time) are left out; None when that is half of them.
    """
    if len(blocks) < MIN_WINDOWS:
        return None
    random = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    for _ in range(draws):
        chosen = random.integers(0, len(blocks), len(blocks)).tolist()
        try:
            found.append(_solve_subset(blocks, rows, chosen, solve))
        except RefusedError:
            continue
    return np.std(found, axis=0, ddof=1) if len(found) > draws / 2 else None


def _solve_subset(blocks: Sequence[Block], rows: Sequence[int], chosen: Sequence[int], solve: Solver) -> np.ndarray:
    return solve(np.concatenate([blocks[k] for k in chosen]), sum(rows[k] for k in chosen))
