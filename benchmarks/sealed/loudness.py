"""How much a secret changes, told by the model that knows nothing of it: the excess of χ², and millimetres.

A campaign is recorded again with a tenth of its marker noise and fitted by the model as it is, parameters and initial
states free. What this fit misses is the secret, hardly the noise: an excess of χ² that is expected in the sealed
campaign, whatever its noise happened to be, and a size in millimetres that effects of all kinds share.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Campaign
from fidim_lab.mismatch.fitting.baseline import fit_baseline

QUIET = 0.1
"""of the stated marker noise; less would make the baseline fit give up what is a fair fit at full noise"""

GROSS = 30.0
"""χ²/dof of the first seconds, for a tenth of the noise, from which on they alone are loud enough; a fit that explains
gives up sooner, at what is a faint misfit in such noise"""


@dataclass(frozen=True)
class Loudness:
    """What the model without the secret cannot follow."""

    chi2_excess: float
    """of the windows to identify from, at the stated noise, beyond 1 for each degree of freedom"""
    rms_mm: float
    """of a marker component"""
    whole: bool
    """False: of the first seconds of each window alone, because whole windows are missed grossly"""


def loudness(quiet: Campaign) -> Loudness:
    """Measure a campaign that was recorded with `QUIET` of the noise which its robot file states.

    Raises RefusedError where no window can be fitted at all.
    """
    baseline = fit_baseline(quiet, native=True, say=_nothing, hopeless=GROSS)
    sigma = quiet.robot.sensors.marker_noise
    markers = len(quiet.robot.markers)
    counts = np.array([3.0 * markers * len(left.t) for left in baseline.fit.remainders])
    squares = np.array([left.rms**2 for left in baseline.fit.remainders]) - (QUIET * sigma) ** 2
    missed = max(0.0, float(counts @ squares))
    return Loudness(
        chi2_excess=round(missed / sigma**2, 3),
        rms_mm=float(1e3 * np.sqrt(missed / counts.sum())),
        whole=baseline.whole is not None,
    )


def _nothing(sentence: str) -> None:
    del sentence
