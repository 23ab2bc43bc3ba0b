"""A prior on the body that keeps a search among bodies that can exist: the geodesic distance of pseudo-inertias.

    distance² = ‖log(J₀^-½ J J₀^-½)‖²    (Lee & Park 2018, A geometric algorithm for robust multibody inertial
                                           parameter identification; J as in `equations.consistency`)

It is the same in every frame and unit, grows without bound towards bodies that cannot exist, and near J₀ counts a
second moment by its ratio. Short recordings determine less than nine parameters: without it a search may run to where
the mass matrix is singular, and no step leads on from there.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import pseudo_inertia

FACTOR = 1.3
"""by which a second moment of the body may differ from its start: one standard deviation, on the way. Of 36 fits (2 to
4 cables, half of them from moments off by a factor of 2 and a centre of mass off by 30 mm) one fails; with 1.15 two,
with 1.5 five, with independent priors on the nine parameters five"""
EQUAL = 1e-6
"""of an eigenvalue: nearer ones count as equal, where a quotient of differences would be rounding alone"""


class NearBody:
    """The distance to one body that can exist, in standard deviations."""

    def __init__(self, body: Body) -> None:
        values, axes = np.linalg.eigh(pseudo_inertia(body))
        self._root = (axes / np.sqrt(values)) @ axes.T
        nothing = pseudo_inertia(Body.from_vector(np.zeros(9)))
        units = [pseudo_inertia(Body.from_vector(unit)) - nothing for unit in np.eye(9)]
        self._units = [self._root @ unit @ self._root for unit in units]

    def residual(self, vector: Float[np.ndarray, "9"]) -> Float[np.ndarray, "16"]:
        """Its square is the squared distance; infinite for a body that cannot exist."""
        values, axes = self._along(vector)
        if not values[0] > 0:
            return np.full(16, np.inf)
        return ((axes * np.log(values)) @ axes.T).ravel() / np.log(FACTOR)

    def rows(self, vector: Float[np.ndarray, "9"]) -> Float[np.ndarray, "16 10"]:
        """[J r] of the residual r at a body that can exist."""
        values, axes = self._along(vector)
        apart = np.subtract.outer(values, values)
        close = np.abs(apart) < EQUAL * values
        logs = np.log(values)
        # Daleckii and Krein: the derivative of a function of a matrix, in the matrix's own axes
        slopes = np.where(close, 1 / values, np.subtract.outer(logs, logs) / np.where(close, 1.0, apart))
        by_vector = [axes @ (slopes * (axes.T @ unit @ axes)) @ axes.T for unit in self._units]
        derivatives = np.column_stack([one.ravel() for one in by_vector]) / np.log(FACTOR)
        return np.column_stack([derivatives, self.residual(vector)])

    def _along(self, vector: Float[np.ndarray, "9"]) -> tuple[Float[np.ndarray, "4"], Float[np.ndarray, "4 4"]]:
        """Eigenvalues and axes of J₀^-½ J J₀^-½."""
        values, axes = np.linalg.eigh(self._root @ pseudo_inertia(Body.from_vector(vector)) @ self._root)
        return values, axes
