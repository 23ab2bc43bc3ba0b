"""The result of every estimator: one `Estimate`, whatever the method."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body

Nine = Float[np.ndarray, "9"]


@dataclass(frozen=True, eq=False)
class WindowAlone:
    """What one window says without the others."""

    window: str
    values: Nine


@dataclass(frozen=True, eq=False)
class Estimate:
    """Nine parameters (order of PARAMETER_NAMES; m, m² per unit mass, about P) and what is known of their error."""

    values: Nine
    covariance: Float[np.ndarray, "9 9"]
    """nominal, from the method's own noise model"""
    leave_one_out: Float[np.ndarray, "W 9"] | None
    """estimates with one window left out each; None with fewer than three windows"""
    sd_bootstrap: Nine | None
    """block bootstrap over windows; None with fewer than three windows"""
    weights: Body
    """the body that weighted the equations: residuals must be formed with the same"""
    reduced: Nine | None = None
    """the re-fit without the non-essential parameters (those are 0); None when all are essential"""
    non_essential: tuple[str, ...] = ()
    alone: tuple[WindowAlone, ...] = ()
    """windows that identify a body by themselves"""
    sigma_W: float | None = None
    """Eq. 31"""
    noise_ratio: float | None = None
    """rms of ε = W χ over what marker noise alone explains: 1 says the model is right; None where that is unknown"""
    C: float | None = None
    """Eq. 40"""
    scaling_effect: Nine | None = None
    """change of the parameters by an equilibrating column scaling"""
    doubtful: tuple[str, ...] = ()
    """parameters with σ% over 10 that are not near zero (§3.2)"""
    notes: tuple[str, ...] = ()

    @property
    def body(self) -> Body:
        """The identified body."""
        return Body.from_vector(self.values)

    @property
    def sd(self) -> Nine:
        """Nominal standard deviations (Eq. 33)."""
        return np.sqrt(np.diag(self.covariance))
