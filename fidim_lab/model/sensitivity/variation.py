"""How trajectories depend on their initial states and on the shared parameters: the variational equation, collocated.

δp and δφ follow from δv and δω by quadrature alone (δφ̇ = Rᵀ δω), so only the m = 6 + E of δν = [δv; δω; δξ] at each
node are unknown (ξ: the E states that effects have of their own): one linear solve of m k for each block. One
evaluation of the derivatives a node, however many columns.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float

from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import derivatives
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import Trajectories, node_times

TOGETHER = 60_000
"""entries of the systems that are solved at a time: they stay in a core's cache"""


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
    """δν̇ = by_pose δq + by_moving δν + by_shared δχ at all nodes; δq̇ = [δv; Rᵀ δω]."""

    by_pose: Float[np.ndarray, "W N m 6"]
    by_moving: Float[np.ndarray, "W N m m"]
    forcing: Float[np.ndarray, "W N m shared"]
    turn: Float[np.ndarray, "W N 3 3"]
    """Rᵀ"""


def variations(
    mechanism: Mechanism,
    trajectories: Trajectories,
    shared: Float[np.ndarray, " shared"],
    starts: Float[np.ndarray, "W 6+m P"],
    further: Float[np.ndarray, "W N 6 Q"] | None = None,
    unstretched: Float[np.ndarray, "W springs P"] | None = None,
    *,
    held: bool = False,
) -> Variations:
    """Carry the derivatives of the initial states, [δp; δφ; δv; δω; δξ] by P columns, along the trajectories.

    The last columns of the P are the shared parameters, and get their part of the motion here. `further`: what Q more
    parameters, whose columns follow those, add to v̇ at the nodes (`motion.forcing`). unstretched: derivatives of the
    springs' lengths by the same columns as `starts`. held: no column of the P is a shared parameter. NaN where the
    trajectories are.
    """
    linear = _linearised(mechanism, trajectories, shared, unstretched, held=held)
    if further is not None:
        forced = np.zeros((*further.shape[:2], linear.forcing.shape[2], further.shape[3]))
        forced[:, :, :6] = further
        linear = replace(linear, forcing=np.concatenate([linear.forcing, forced], axis=-1))
    poses, moving = _carried(linear, trajectories.grid, starts)
    accelerations = linear.by_pose[:, :, :6] @ poses + linear.by_moving[:, :, :6] @ moving
    accelerations[..., accelerations.shape[-1] - linear.forcing.shape[-1] :] += linear.forcing[:, :, :6]
    return Variations(poses=poses, twists=moving[:, :, :6], accelerations=accelerations, extra=moving[:, :, 6:])


def _linearised(
    mechanism: Mechanism,
    trajectories: Trajectories,
    shared: np.ndarray,
    unstretched: np.ndarray | None,
    *,
    held: bool,
) -> _Linear:
    count, nodes = trajectories.positions.shape[:2]
    _, flat = over_samples(
        derivatives(mechanism).now(),
        count * nodes,
        node_times(trajectories),
        trajectories.positions,
        trajectories.rotations,
        trajectories.moving,
        trajectories.constants_at_nodes(shared),
    )
    m = trajectories.moving.shape[-1]
    table = flat.reshape(count, nodes, m, -1)
    last = table.shape[-1] - len(shared)
    forcing = table[..., last : last if held else None]
    if unstretched is not None:
        by_lengths = table[..., 6 + m : last] @ unstretched[:, np.newaxis]
        by_lengths[..., by_lengths.shape[-1] - forcing.shape[-1] :] += forcing
        forcing = by_lengths
    return _Linear(
        by_pose=table[..., :6],
        by_moving=table[..., 6 : 6 + m],
        forcing=forcing,
        turn=np.swapaxes(trajectories.rotations, -1, -2),
    )


def _carried(
    linear: _Linear, grid: Grid, starts: Float[np.ndarray, "W 6+m P"]
) -> tuple[Float[np.ndarray, "W N 6 P"], Float[np.ndarray, "W N m P"]]:
    """Poses and ν = [twist; ξ] at all nodes, from what each block does to what it begins with.

    Blocks are solved some at a time, each for itself; from block to block there is only a product then.
    """
    count, size, columns = starts.shape
    k, shared = grid.resolution.intervals, linear.forcing.shape[-1]
    inside = np.arange(grid.blocks)[:, np.newaxis] * k + np.arange(k + 1)
    spun = _spun(linear)
    found = np.empty((count, grid.nodes, size, columns))
    found[:, 0] = starts
    found[:, 0, 9:12] = linear.turn[:, 0] @ starts[:, 9:12]
    together = max(1, TOGETHER // ((size - 6) * k) ** 2)
    many = max(1, together // grid.blocks)
    for first, begun in product(range(0, count, many), range(0, grid.blocks, together)):
        some, chosen = np.s_[first : first + many], inside[begun : begun + together]
        tables = (spun.by_pose[some], spun.by_moving[some], spun.forcing[some], spun.turn[some])
        blocks = _Linear(*(np.concatenate(table[:, chosen]) for table in tables))
        responses = _across(blocks, grid.quadrature).reshape(-1, len(chosen), k * size, size + shared)
        for nodes, response in zip(chosen, responses.swapaxes(0, 1), strict=True):
            moved = response[..., :size] @ found[some, nodes[0]]
            moved[..., columns - shared :] += response[..., size:]
            found[some, nodes[1:]] = moved.reshape(-1, k, size, columns)
    found[:, :, 9:12] = np.swapaxes(linear.turn, -1, -2) @ found[:, :, 9:12]
    return found[:, :, :6], found[:, :, 6:]


def _spun(linear: _Linear) -> _Linear:
    """The same for δω in the body frame, as δφ is, on the right; rates stay as they are."""
    by_moving = linear.by_moving.copy()
    by_moving[..., 3:6] = linear.by_moving[..., 3:6] @ np.swapaxes(linear.turn, -1, -2)
    return replace(linear, by_moving=by_moving)


def _across(linear: _Linear, quadrature: Float[np.ndarray, "k+1 k+1"]) -> Float[np.ndarray, "B k 6+m 6+m+shared"]:
    """[q; μ] at the nodes 1…k of each of B blocks, by q and μ at its first node and by the shared parameters.

    μ is ν with δω in the body frame, ν_i = S_i μ_i, so that q̇ = μ but for ξ. With ν_i = ν_0 + Σ_j Q_ij (D_j q_j +
    E_j μ_j + b_j) and q_j = q_0 + Σ_l Q_jl μ_l the unknowns follow from Σ_l (S_i δ_il − H_il) μ_l = right-hand side,
    H_il = Σ_j Q_ij Q_jl D_j + Q_il E_l.
    """
    count, points, m = linear.by_pose.shape[:3]
    k, later, shared = points - 1, quadrature[1:], linear.forcing.shape[-1]
    turned_back = np.zeros((count, points, m, m))  # S
    turned_back[..., range(m), range(m)] = 1.0
    turned_back[..., 3:6, 3:6] = np.swapaxes(linear.turn, -1, -2)
    flat = linear.by_pose.reshape(count, points, 6 * m)
    twice = (later[:, np.newaxis, :] * quadrature.T).reshape(k * points, points)  # (i, l; j): Q_ij Q_jl
    by_pose = (twice @ flat).reshape(count, k, points, m, 6)
    system = np.multiply(-later[:, np.newaxis, 1:, np.newaxis], linear.by_moving[:, np.newaxis, 1:].swapaxes(2, 3))
    system[..., :6] -= by_pose[:, :, 1:].swapaxes(2, 3)
    every = np.arange(k)
    system[:, every, :, every] += turned_back[:, 1:].swapaxes(0, 1)
    system = system.reshape(count, k * m, k * m)
    right = np.empty((count, k, m, 6 + m + shared))
    right[..., :6] = (later @ flat).reshape(count, k, m, 6)
    right[..., 6 : 6 + m] = turned_back[:, :1] + later[:, :1, np.newaxis] * linear.by_moving[:, :1]
    right[..., 6:12] += by_pose[:, :, 0]
    right[..., 6 + m :] = (later @ linear.forcing.reshape(count, points, m * shared)).reshape(count, k, m, shared)
    known = np.isfinite(system).all(axis=(1, 2))
    system[~known] = np.eye(m * k)  # LAPACK may call a table of NaN singular: what was to follow it is NaN anyhow
    found = np.linalg.solve(system, right.reshape(count, k * m, -1)).reshape(right.shape)
    found[~known] = np.nan
    response = np.empty((count, k, 6 + m, right.shape[-1]))
    response[:, :, 6:] = found
    rates = np.ascontiguousarray(found[:, :, :6]).reshape(count, k, -1)
    response[:, :, :6] = (later[:, 1:] @ rates).reshape(count, k, 6, -1)
    response[:, :, range(6), range(6)] += 1.0
    response[:, :, range(6), range(6, 12)] += later[:, :1]
    return response
