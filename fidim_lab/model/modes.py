"""Small oscillations about an equilibrium (Eq. 37–39), and how near the mechanism is to having further freedoms.

`modes` for frequencies and shapes; `scaled_singular_values` first: where the smallest is far below the next, cables
that stretch by tenths of a millimetre let the platform turn by degrees, and rigid cables are the wrong model
(spec/model.md §6).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import eigh

from fidim_lab.arrays import Series, skew
from fidim_lab.data.records import Body
from fidim_lab.errors import SetupError
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import NEUTRAL_STIFFNESS, Equilibrium, balance

SLOWEST = 0.3
"""rad/s, which neutral freedoms are taken to have in time"""
ROTATION_SCALE = 0.2
"""m: the lever that makes a rotation comparable with a displacement"""


@dataclass(frozen=True, eq=False)
class Modes:
    """M⊥ ÿ + K⊥ y = 0 and its solutions, ascending in frequency; per unit mass, world frame."""

    frequencies: Float[np.ndarray, " free"]
    """f_j, Hz; 0 for a neutral freedom"""
    shapes: Float[np.ndarray, "6 free"]
    """γ_j as twists [ṗ; ω], each with γᵀ M γ = 1"""
    basis: Float[np.ndarray, "6 free"]
    """Ξ⊥ over whose coordinates M⊥ and K⊥ are meant"""
    mass: Float[np.ndarray, "free free"]
    """M⊥ = Ξ⊥ᵀ M Ξ⊥"""
    stiffness: Float[np.ndarray, "free free"]
    """K⊥, the free-motion stiffness"""

    def pulsations(self, faster: float | Float[np.ndarray, " free"] = 1.0) -> Float[np.ndarray, " free"]:
        """2π f_j, rad/s, times `faster`; at least `SLOWEST`."""
        return np.maximum(2 * np.pi * self.frequencies * faster, SLOWEST)


def modes(
    mechanism: Mechanism, body: Body, equilibrium: Equilibrium, basis: Float[np.ndarray, "6 free"] | None = None
) -> Modes:
    """Frequencies and mode shapes of free motion about an equilibrium (Eq. 37–39).

    basis: Ξ⊥ of the wanted free coordinates (`free_twist_basis`); orthonormal twists without it. Frequencies and shapes
    do not depend on it. Raises SetupError where M⊥ is not positive definite: such a body cannot exist.
    """
    pose = equilibrium.pose
    _, hessian, xi, _ = balance(mechanism, body, pose, equilibrium.tensions)
    free = np.linalg.svd(xi)[2][mechanism.n :].T if basis is None else basis
    mass = free.T @ mass_matrix(body, pose.rotation) @ free
    stiffness = free.T @ hessian @ free
    try:
        squares, vectors = eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise SetupError(
            "Modes: the mass matrix is not positive definite, no body has this inertia.",
            hint="Check nominal_com and nominal_inertia (about P, per unit mass) in the robot file.",
        ) from error
    squares = np.where(np.abs(squares) <= NEUTRAL_STIFFNESS * squares.max(), 0.0, squares)
    return Modes(
        frequencies=np.sqrt(squares) / (2 * np.pi),
        shapes=free @ vectors,
        basis=free,
        mass=mass,
        stiffness=stiffness,
    )


def swing_rates(
    turns: Float[np.ndarray, "3 K"], pulsations: Float[np.ndarray, " K"], t: Series
) -> Float[np.ndarray, "T3 columns"]:
    """A gyroscope's readings at times t (s), sample by sample, of K modes that turn it so: cosines, sines, its bias."""
    phases = pulsations * t[:, np.newaxis]
    waves = [turns * wave[:, np.newaxis] for wave in (np.cos(phases), np.sin(phases))]
    bias = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    return np.concatenate([*waves, bias], axis=2).reshape(3 * len(t), -1)


def mass_matrix(body: Body, rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "6 6"]:
    """M/m of Eq. 9 at a rotation, world frame."""
    cross = skew(rotation @ body.com)
    return np.block([[np.eye(3), -cross], [cross, rotation @ body.inertia_matrix @ rotation.T]])


def scaled_singular_values(xi: Float[np.ndarray, "N n 6"], lever: float = ROTATION_SCALE) -> Float[np.ndarray, "N n"]:
    """Singular values of Ξ over [ṗ; ω · lever], descending: dimensionless, about 1 where cables hold firmly.

    lever in m. The last below a tenth of the one before it means a soft mode: do not trust rigid cables there.
    """
    return np.linalg.svd(xi / np.array([1, 1, 1, lever, lever, lever]), compute_uv=False)
