"""The regressor that is linear in the inertial parameters: W_EE of Eq. 19 and W′ = Ξ⊥ᵀ W_EE of Eq. 21–22.

Columns [1, s_x, s_y, s_z, I_xx, I_yy, I_zz, I_xy, I_xz, I_yz], so that W χ′ = −Ξᵀ τ/m and W′ χ′ = 0 in free motion.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Vector3, skew
from fidim_lab.data.records import Body, Motion


def platform_regressor(motion: Motion, gravity: Vector3) -> Float[np.ndarray, "N 6 10"]:
    """W_EE (Eq. 19) per unit mass: rows are force (N/kg) and torque about P (N m/kg) in the world frame."""
    spins, spin_rates = motion.twists[:, 3:], motion.accelerations[:, 3:]
    felt = motion.accelerations[:, :3] - gravity
    across = skew(spins)
    regressor = np.zeros((len(motion.t), 6, 10))
    regressor[:, :3, 0] = felt
    regressor[:, :3, 1:4] = (skew(spin_rates) + across @ across) @ motion.rotations
    regressor[:, 3:, 1:4] = -skew(felt) @ motion.rotations
    inverse = motion.rotations.transpose(0, 2, 1)
    body_spins = (inverse @ spins[..., np.newaxis])[..., 0]
    body_rates = (inverse @ spin_rates[..., np.newaxis])[..., 0]
    regressor[:, 3:, 4:] = motion.rotations @ _inertia_columns(body_rates) + across @ (
        motion.rotations @ _inertia_columns(body_spins)
    )
    return regressor


def free_regressor(
    motion: Motion, gravity: Vector3, basis: Float[np.ndarray, "N 6 free"]
) -> Float[np.ndarray, "N free 10"]:
    """W′ = Ξ⊥ᵀ W_EE (Eq. 21–22), for any basis Ξ⊥ of the free twists: without cable tensions."""
    return basis.transpose(0, 2, 1) @ platform_regressor(motion, gravity)


def parameter_vector(body: Body) -> Float[np.ndarray, "10"]:
    """χ′ = [1, s′, I′] (Eq. 22)."""
    return np.concatenate([[1.0], body.vector])


def _inertia_columns(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3 6"]:
    """v̄ with I v = v̄ Ǐ (Eq. 14–16)."""
    columns = np.zeros((len(vectors), 3, 6))
    x, y, z = vectors.T
    columns[:, 0, 0], columns[:, 0, 3], columns[:, 0, 4] = x, y, z
    columns[:, 1, 1], columns[:, 1, 3], columns[:, 1, 5] = y, x, z
    columns[:, 2, 2], columns[:, 2, 4], columns[:, 2, 5] = z, x, y
    return columns
