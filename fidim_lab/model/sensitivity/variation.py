"""How trajectories depend on their initial states and on the shared parameters: the variational equation, collocated.

δp and δφ follow from δv and δω by quadrature alone (δφ̇ = Rᵀ δω), so only the m = 6 + E of δν = [δv; δω; δξ] at each
node are unknown (ξ: the E states that effects have of their own): one linear solve of m k for each block. One
evaluation of the derivatives a node, however many columns.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.model.batch import evaluate
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import derivatives
from fidim_lab.model.sensitivity.integrate import Trajectories, node_times


@dataclass(frozen=True, eq=False)
class Variations:
    """Derivatives of trajectories by P columns: first each window's own unknowns, last the shared parameters."""

    poses: Float[np.ndarray, "W N 6 P"]
    """[δp; δφ]"""
    twists: Float[np.ndarray, "W N 6 P"]
    """[δv; δω]"""
    accelerations: Float[np.ndarray, "W N 6 P"]
    extra: Float[np.ndarray, "W N extra P"]
    """of effects' own states"""


@dataclass(frozen=True, eq=False)
class _Linear:
    """δν̇ = by_pose δq + by_twist δν + by_shared δχ at all nodes; δq̇ = [δv; Rᵀ δω]."""

    by_pose: Float[np.ndarray, "W N m 6"]
    by_moving: Float[np.ndarray, "W N m m"]
    forcing: Float[np.ndarray, "W N m shared"]
    turn: Float[np.ndarray, "W N 3 3"]
    """Rᵀ"""

    def block(self, first: int, last: int) -> "_Linear":
        chosen = np.s_[:, first : last + 1]
        return _Linear(self.by_pose[chosen], self.by_moving[chosen], self.forcing[chosen], self.turn[chosen])

    def pose_rates(self, moving: Float[np.ndarray, "W K m P"]) -> Float[np.ndarray, "W K 6 P"]:
        return np.concatenate([moving[..., :3, :], self.turn @ moving[..., 3:6, :]], axis=-2)


def variations(
    mechanism: Mechanism,
    trajectories: Trajectories,
    shared: Float[np.ndarray, " shared"],
    starts: Float[np.ndarray, "W 6+m P"],
    further: Float[np.ndarray, "W N 6 Q"] | None = None,
    unstretched: Float[np.ndarray, "W springs P"] | None = None,
) -> Variations:
    """Carry the derivatives of the initial states, [δp; δφ; δv; δω; δξ] by P columns, along the trajectories.

    The last columns of the P are the shared parameters, and get their part of the motion here. `further`: what Q more
    parameters, whose columns follow those, add to v̇ at the nodes (`model.forcing`). unstretched: derivatives of the
    springs' lengths by the same columns as `starts`. NaN where the trajectories are.
    """
    linear = _linearised(mechanism, trajectories, shared, unstretched)
    if further is not None:
        forced = np.zeros((*further.shape[:2], linear.forcing.shape[2], further.shape[3]))
        forced[:, :, :6] = further
        linear = replace(linear, forcing=np.concatenate([linear.forcing, forced], axis=-1))
    count, nodes = trajectories.positions.shape[:2]
    poses = np.empty((count, nodes, 6, starts.shape[2]))
    moving = np.empty((count, nodes, starts.shape[1] - 6, starts.shape[2]))
    poses[:, 0], moving[:, 0] = starts[:, :6], starts[:, 6:]
    quadrature, k = trajectories.grid.quadrature, trajectories.grid.resolution.intervals
    for first in range(0, nodes - 1, k):
        chosen = np.s_[:, first + 1 : first + k + 1]
        poses[chosen], moving[chosen] = _across(
            linear.block(first, first + k), quadrature, poses[:, first], moving[:, first]
        )
    accelerations = linear.by_pose[:, :, :6] @ poses + linear.by_moving[:, :, :6] @ moving
    accelerations[..., -linear.forcing.shape[-1] :] += linear.forcing[:, :, :6]
    return Variations(poses=poses, twists=moving[:, :, :6], accelerations=accelerations, extra=moving[:, :, 6:])


def _linearised(
    mechanism: Mechanism, trajectories: Trajectories, shared: np.ndarray, unstretched: np.ndarray | None
) -> _Linear:
    count, nodes = trajectories.positions.shape[:2]
    samples = count * nodes
    _, flat = evaluate(
        derivatives(mechanism).over(samples),
        node_times(trajectories),
        trajectories.positions,
        trajectories.rotations,
        trajectories.moving,
        trajectories.constants_at_nodes(shared),
    )
    m = trajectories.moving.shape[-1]
    table = flat.reshape(count, nodes, m, -1)
    forcing = table[..., 6 + m :]
    if unstretched is not None:
        springs, columns = unstretched.shape[1:]
        own = columns - len(shared)
        by_lengths = forcing[..., :springs] @ unstretched[:, np.newaxis]
        by_lengths[..., own:] += forcing[..., springs:]
        forcing = by_lengths
    return _Linear(
        by_pose=table[..., :6],
        by_moving=table[..., 6 : 6 + m],
        forcing=forcing,
        turn=np.swapaxes(trajectories.rotations, -1, -2),
    )


def _across(
    linear: _Linear,
    quadrature: Float[np.ndarray, "k+1 k+1"],
    pose: Float[np.ndarray, "W 6 P"],
    moving: Float[np.ndarray, "W m P"],
) -> tuple[Float[np.ndarray, "W k 6 P"], Float[np.ndarray, "W k m P"]]:
    """Poses and ν = [twist; ξ] at the nodes 1…k of a block from those at its first node.

    ν_i = ν_0 + Σ_j Q_ij (D_j q_j + E_j ν_j + b_j) and q_j = q_0 + Σ_l Q_jl T_l ν_l, hence (1 − H) ν = right-hand side
    with H_il = Σ_j Q_ij Q_jl D_j T_l + Q_il E_l.
    """
    count, points = linear.turn.shape[:2]
    k, later, m = points - 1, quadrature[1:], moving.shape[1]
    twice = later[:, np.newaxis, :] * quadrature.T  # (i, l, j): Q_ij Q_jl
    by_pose = twice.reshape(k * points, points) @ linear.by_pose.reshape(count, points, 6 * m)
    by_pose = by_pose.reshape(count, k, points, m, 6)
    turned = by_pose[..., 3:] @ linear.turn[:, np.newaxis]
    feedback = later[:, :, np.newaxis, np.newaxis] * linear.by_moving[:, np.newaxis]  # H
    feedback[..., :3] += by_pose[..., :3]
    feedback[..., 3:6] += turned
    source = linear.by_pose @ pose[:, np.newaxis]
    source[..., -linear.forcing.shape[-1] :] += linear.forcing
    right = np.tensordot(source, later, axes=(1, 1)).transpose(0, 3, 1, 2)
    right += moving[:, np.newaxis] + feedback[:, :, 0] @ moving[:, np.newaxis]
    system = np.eye(m * k) - feedback[:, :, 1:].transpose(0, 1, 3, 2, 4).reshape(count, m * k, m * k)
    columns = pose.shape[-1]
    known = np.isfinite(system).all(axis=(1, 2))
    system[~known] = np.eye(m * k)  # LAPACK may call a table of NaN singular: what was to follow it is NaN anyhow
    found = np.linalg.solve(system, right.reshape(count, m * k, columns)).reshape(count, k, m, columns)
    found[~known] = np.nan
    rates = linear.pose_rates(np.concatenate([moving[:, np.newaxis], found], axis=1))
    moved = np.tensordot(rates, later, axes=(1, 1)).transpose(0, 3, 1, 2)
    return pose[:, np.newaxis] + moved, found
