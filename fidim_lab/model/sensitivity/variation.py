"""How trajectories depend on their initial states and on the shared parameters: the variational equation, collocated.

δp and δφ follow from δv and δω by quadrature alone (δφ̇ = Rᵀ δω), so only the six of δν = [δv; δω] at each node are
unknown: one linear solve of 6 k for each block. One evaluation of the derivatives a node, however many columns.
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


@dataclass(frozen=True, eq=False)
class _Linear:
    """δν̇ = by_pose δq + by_twist δν + by_shared δχ at all nodes; δq̇ = [δv; Rᵀ δω]."""

    by_pose: Float[np.ndarray, "W N 6 6"]
    by_twist: Float[np.ndarray, "W N 6 6"]
    forcing: Float[np.ndarray, "W N 6 shared"]
    turn: Float[np.ndarray, "W N 3 3"]
    """Rᵀ"""

    def block(self, first: int, last: int) -> "_Linear":
        chosen = np.s_[:, first : last + 1]
        return _Linear(self.by_pose[chosen], self.by_twist[chosen], self.forcing[chosen], self.turn[chosen])

    def pose_rates(self, twists: Float[np.ndarray, "W K 6 P"]) -> Float[np.ndarray, "W K 6 P"]:
        return np.concatenate([twists[..., :3, :], self.turn @ twists[..., 3:, :]], axis=-2)


def variations(
    mechanism: Mechanism,
    trajectories: Trajectories,
    shared: Float[np.ndarray, " shared"],
    starts: Float[np.ndarray, "W 12 P"],
    further: Float[np.ndarray, "W N 6 Q"] | None = None,
    unstretched: Float[np.ndarray, "W springs P"] | None = None,
) -> Variations:
    """Carry the derivatives of the initial states, [δp; δφ; δv; δω] by P columns, along the trajectories.

    The last columns of the P are the shared parameters, and get their part of the motion here. `further`: what Q more
    parameters, whose columns follow those, add to v̇ at the nodes (`model.forcing`). unstretched: derivatives of the
    springs' lengths by the same columns as `starts`. NaN where the trajectories are.
    """
    linear = _linearised(mechanism, trajectories, shared, unstretched)
    if further is not None:
        linear = replace(linear, forcing=np.concatenate([linear.forcing, further], axis=-1))
    count, nodes = trajectories.positions.shape[:2]
    poses, twists = (np.empty((count, nodes, 6, starts.shape[2])) for _ in range(2))
    poses[:, 0], twists[:, 0] = starts[:, :6], starts[:, 6:]
    quadrature, k = trajectories.grid.quadrature, trajectories.grid.resolution.intervals
    for first in range(0, nodes - 1, k):
        chosen = np.s_[:, first + 1 : first + k + 1]
        poses[chosen], twists[chosen] = _across(
            linear.block(first, first + k), quadrature, poses[:, first], twists[:, first]
        )
    accelerations = linear.by_pose @ poses + linear.by_twist @ twists
    accelerations[..., -linear.forcing.shape[-1] :] += linear.forcing
    return Variations(poses=poses, twists=twists, accelerations=accelerations)


def _linearised(
    mechanism: Mechanism, trajectories: Trajectories, shared: np.ndarray, unstretched: np.ndarray | None
) -> _Linear:
    count, nodes = trajectories.positions.shape[:2]
    samples = count * nodes
    _, flat = evaluate(
        mechanism.compiled(f"sensitivity: {samples} derivatives", lambda made: derivatives(made).map(samples)),
        node_times(trajectories),
        trajectories.positions,
        trajectories.rotations,
        trajectories.twists,
        trajectories.constants_at_nodes(shared),
    )
    table = flat.reshape(count, nodes, 6, -1)
    forcing = table[..., 12:]
    if unstretched is not None:
        springs, columns = unstretched.shape[1:]
        own = columns - len(shared)
        by_lengths = table[..., 12 : 12 + springs] @ unstretched[:, np.newaxis]
        by_lengths[..., own:] += table[..., 12 + springs :]
        forcing = by_lengths
    return _Linear(
        by_pose=table[..., :6],
        by_twist=table[..., 6:12],
        forcing=forcing,
        turn=np.swapaxes(trajectories.rotations, -1, -2),
    )


def _across(
    linear: _Linear,
    quadrature: Float[np.ndarray, "k+1 k+1"],
    pose: Float[np.ndarray, "W 6 P"],
    twist: Float[np.ndarray, "W 6 P"],
) -> tuple[Float[np.ndarray, "W k 6 P"], Float[np.ndarray, "W k 6 P"]]:
    """Poses and twists at the nodes 1…k of a block from those at its first node.

    ν_i = ν_0 + Σ_j Q_ij (D_j q_j + E_j ν_j + b_j) and q_j = q_0 + Σ_l Q_jl T_l ν_l, hence (1 − H) ν = right-hand side
    with H_il = Σ_j Q_ij Q_jl D_j T_l + Q_il E_l.
    """
    count, points = linear.turn.shape[:2]
    k, later = points - 1, quadrature[1:]
    twice = later[:, np.newaxis, :] * quadrature.T  # (i, l, j): Q_ij Q_jl
    by_pose = twice.reshape(k * points, points) @ linear.by_pose.reshape(count, points, 36)
    by_pose = by_pose.reshape(count, k, points, 6, 6)
    turned = by_pose[..., 3:] @ linear.turn[:, np.newaxis]
    feedback = np.concatenate([by_pose[..., :3], turned], axis=-1)  # H
    feedback += later[:, :, np.newaxis, np.newaxis] * linear.by_twist[:, np.newaxis]
    source = linear.by_pose @ pose[:, np.newaxis]
    source[..., -linear.forcing.shape[-1] :] += linear.forcing
    right = np.tensordot(source, later, axes=(1, 1)).transpose(0, 3, 1, 2)
    right += twist[:, np.newaxis] + feedback[:, :, 0] @ twist[:, np.newaxis]
    system = np.eye(6 * k) - feedback[:, :, 1:].transpose(0, 1, 3, 2, 4).reshape(count, 6 * k, 6 * k)
    columns = pose.shape[-1]
    twists = np.linalg.solve(system, right.reshape(count, 6 * k, columns)).reshape(count, k, 6, columns)
    rates = linear.pose_rates(np.concatenate([twist[:, np.newaxis], twists], axis=1))
    moved = np.tensordot(rates, later, axes=(1, 1)).transpose(0, 3, 1, 2)
    return pose[:, np.newaxis] + moved, twists
