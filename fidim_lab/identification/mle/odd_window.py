"""One window that moves as another body, or under another force, than all others: without it the rest is explained.

A payload left on the platform, a cable that touched, a window of another robot. Where the fit misses, each window is
left out in turn to first order; where the others then come down to their noise without one of them, and at least three
others agree on it, the fit is made again without it. Missing physics is in every window, and leaves none to blame. The
geometry is asked afterwards: opened wide it bends around such a window. A fit that misses by little is left as it is: a
wrong clock, too, is explained better by fewer windows.
"""

import numpy as np

from fidim_lab.identification.mle.findings import MISFIT
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.spread import Quadratic

FEWEST = 3
"""windows that must agree without it: two of three may be two that are alike in their error"""
SHARE = 0.5
"""of what is left above noise that must go with it, to first order, so that the fit is made again"""


def odd_window(found: Fit) -> str | None:
    """The id of a window that most of what is left goes with; None where the fit is good, or there is none such."""
    count = len(found.remainders)
    if count <= FEWEST or found.excess < MISFIT:
        return None
    left = np.array([_foretold(found, out) for out in range(count)])
    best = int(np.argmin(left))
    return found.likelihood.recordings[best].window.id if left[best] - 1 < SHARE * (found.excess - 1) else None


def _foretold(found: Fit, out: int) -> float:
    """χ²/dof of the other windows for their noise, after one step without this one."""
    kept = np.delete(np.arange(len(found.remainders)), out)
    quadratic = Quadratic.of(found.tables[kept], found.prior_rows)
    step = quadratic.step(np.ones(len(quadratic.gradient), dtype=bool), np.zeros(len(quadratic.gradient)))
    chi2 = sum(found.remainders[k].chi2 for k in kept) + float(quadratic.gradient @ step)
    dof = sum(found.remainders[k].dof for k in kept) - len(found.values)
    return max(chi2, 0.0) / max(1, dof) / found.noise_ratio**2


def contradicts(window: str, before: Fit, after: Fit) -> str:
    """A sentence for a person."""
    return (
        f"Window {window}: its motion contradicts that of the other {len(after.remainders)}, which one body explains "
        f"(χ²/dof {after.chi2_per_dof:.2f}, with it {before.chi2_per_dof:.3g}). Another body or payload, a touch, or a "
        "cable that slipped there."
    )
