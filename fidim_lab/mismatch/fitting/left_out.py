"""Every window as the others foretell it: those that were fitted with each left out in turn, the held-out ones besides.

A fitted window is left out to first order: its table is taken out of the normal equations, and the shared parameters
move to where the others have them; its own unknowns are then those that fit it best.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.spread import leave_one_out
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.fitting.refit import Completed


def left_out(completed: Completed, held: HeldOut) -> HeldOut | None:
    """Figures of all windows, each foretold by a fit without it.

    held: those of the held-out windows, by the same model. None where it was not fitted to whole windows, or to fewer
    than three.
    """
    moved = _foretold(completed) if completed.whole else None
    if moved is None:
        return None
    likelihood, lefts = completed.fit.likelihood, completed.fit.remainders
    found = HeldOut(
        chi2=float(moved.sum()),
        dof=sum(left.dof for left in lefts),
        rms=_mean_rms([(left.rms**2 * chi2 / left.chi2, left.dof) for left, chi2 in zip(lefts, moved, strict=True)]),
        refused={},
        of_window={
            recording.window.id: float(chi2) / left.dof
            for recording, left, chi2 in zip(likelihood.recordings, lefts, moved, strict=True)
        },
    )
    return found if not held.dof else _together(found, held)


def _together(one: HeldOut, other: HeldOut) -> HeldOut:
    return HeldOut(
        chi2=one.chi2 + other.chi2,
        dof=one.dof + other.dof,
        rms=_mean_rms([(one.rms**2, one.dof), (other.rms**2, other.dof)]),
        refused=other.refused,
        of_window={**one.of_window, **other.of_window},
    )


def _mean_rms(squares: Sequence[tuple[float, int]]) -> float:
    """m, of parts with their squares (m²) and numbers of values."""
    return float(np.sqrt(sum(square * count for square, count in squares) / sum(count for _, count in squares)))


def _foretold(completed: Completed) -> Float[np.ndarray, " W"] | None:
    """χ² of each fitted window with the parameters that the others have; None with fewer than three."""
    fit, free = completed.fit, completed.free
    columns = np.append(free, True)
    tables, nothing = fit.tables[:, :, columns], np.zeros(int(free.sum()))
    steps = leave_one_out(tables, fit.prior_rows[:, columns], nothing)
    if steps is None:
        return None
    ends = np.column_stack([steps, np.ones(len(steps))])
    return (np.einsum("wij,wj->wi", tables, ends) ** 2).sum(axis=1)
