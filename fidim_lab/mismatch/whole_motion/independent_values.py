"""The number of independent values in a residual that is not white.

A sum of squares of correlated normal values with covariance eigenvalues λ has the mean and the variance of (Σλ)²/Σλ²
independent ones (Satterthwaite, Biometrics Bulletin 2, 1946). A stationary residual has its spectrum as eigenvalues.
"""

import numpy as np
from jaxtyping import Float


def independent_values(residual: Float[np.ndarray, "T M 3"]) -> float:
    """How many values of the same size, independent of each other, say as much as this residual.

    NaN counts as 0. At least 1; of white noise half of what there is, because a periodogram scatters as much as it is
    large; of a tone 2, amplitude and phase.
    """
    columns = np.nan_to_num(residual.reshape(len(residual), -1))
    _, axes = np.linalg.eigh(columns.T @ columns)
    power = np.abs(np.fft.rfft(columns @ axes, axis=0)) ** 2
    power[1:] *= 2.0  # both signs of the frequency
    total = float(power.sum())
    return max(1.0, 2.0 * total**2 / float((power**2).sum())) if total > 0 else float(columns.size)
