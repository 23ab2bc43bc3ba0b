"""The likelihood of recordings by a gyroscope: angular rates instead of marker coordinates.

A gyroscope has a bias that is another in each window and drifts slowly. Both are normal beforehand, so they are noise
that all samples of an axis share, and whitening takes them out: with Q an orthonormal basis of (1, t) over the samples
and Q S Qᵀ what bias and drift add to a white noise of one, the noise has the inverse root 1 + Q ((1 + S)^−½ − 1) Qᵀ. No
window gets unknowns for them.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.errors import OurBugError
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, SensorWords
from fidim_lab.model.sensitivity.rates import RateMeasurement

BIAS, DRIFT = 0.05, 1e-3
"""rad/s and rad/s², one standard deviation of each axis: phones have up to 0.02 rad/s, and drift by less in a minute;
ten times as much moves nothing by a tenth of its ± (docs/benchmarks/sensitivity.md)"""

SWING = (0.3, 1.0)
"""m and rad, m/s and rad/s: one standard deviation of a window's begin about the first guess, which has the modes that
no rate shows at rest. Swings of a few cm are a tenth of it; without it such modes have any amplitude"""


@dataclass(frozen=True, eq=False)
class RateLikelihood(Likelihood):
    """The same for recordings whose `markers` hold one triple of angular rates a sample; noise is in rad/s."""

    sensor: ClassVar[SensorWords] = SensorWords("rate", "mrad/s", "gyro_noise")

    def measurement(self, theta: Float[np.ndarray, " theta"]) -> RateMeasurement:
        """The gyroscope at one θ."""
        return RateMeasurement(self.mechanism, theta)

    def loose(self, count: int) -> Float[np.ndarray, " count"]:
        """As a hand lets a pendulum go."""
        return np.concatenate([np.full(6, SWING[0]), np.full(count - 6, SWING[1])])

    def whitened(
        self, w: int, rows: Float[np.ndarray, "K ..."], seen: Bool[np.ndarray, "T 1 3"]
    ) -> Float[np.ndarray, "K ..."]:
        """Rows of recording `w` over their noise, without what bias and drift explain."""
        if not seen.all():
            raise OurBugError("RateLikelihood: whole samples are needed.")
        t = self.recordings[w].t[: len(seen)]
        about = t - t.mean()
        basis, sizes = np.linalg.qr(np.column_stack([np.ones(len(t)), about]))
        spread = sizes @ np.diag([BIAS**2, DRIFT**2]) @ sizes.T / self.noise**2
        values, axes = np.linalg.eigh(spread)
        less = (axes * ((1 + values) ** -0.5 - 1)) @ axes.T
        columns = rows.reshape(len(t), -1)
        return ((columns + basis @ (less @ (basis.T @ columns))) / self.noise).reshape(rows.shape)

    def coloured(
        self, w: int, rows: Float[np.ndarray, " K"], seen: Bool[np.ndarray, "T 1 3"]
    ) -> Float[np.ndarray, " K"]:
        """What is left beside bias and drift, rad/s."""
        return rows * self.noise
