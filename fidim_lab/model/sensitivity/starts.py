"""Initial states that obey the locked cables: Ξ v = 0, and how lengths and twist depend on pose and parameters.

A window's own unknowns are [δp; δφ; δu]: a change of pose and λ rates along the free twists at that pose. Ξ is tied to
the pose, so the twist follows it: v(pose) is the projection of the old twist on the new free twists.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism, structure_expression
from fidim_lab.model.sensitivity.equations import BODY, shared_count, turned
from fidim_lab.model.sensitivity.integrate import States


@dataclass(frozen=True, eq=False)
class Starts:
    """Derivatives at the initial states of W windows."""

    lengths: Float[np.ndarray, "W n"]
    """m, as an encoder without error would read them"""
    lengths_by: Float[np.ndarray, "W n P"]
    """by [δp; δφ; δu; shared]"""
    states_by: Float[np.ndarray, "W 12 P"]
    """[δp; δφ; δv; δω] by the same columns"""
    free_twists: Float[np.ndarray, "W 6 free"]
    """N: orthonormal, Ξ N = 0"""


def tied(mechanism: Mechanism, shared: np.ndarray, states: States) -> States:
    """The same poses with the nearest twists that stretch no cable: v − Ξ⁺ Ξ v."""
    xi = _quantities(mechanism, shared, states)[1]
    off = xi @ states.twists[..., np.newaxis]
    twists = states.twists - (np.linalg.pinv(xi) @ off)[..., 0]
    return States(states.positions, states.rotations, twists)


def moved(
    mechanism: Mechanism,
    shared: np.ndarray,
    states: States,
    starts: Starts,
    steps: Float[np.ndarray, "W own"],
) -> States:
    """States after a step [δp; δφ; δu] of each window's own unknowns, for the (new) shared parameters."""
    rates = (starts.free_twists @ steps[:, 6:, np.newaxis])[..., 0]
    changed = States(
        positions=states.positions + steps[:, :3],
        rotations=states.rotations @ Rotation.from_rotvec(steps[:, 3:6]).as_matrix(),
        twists=states.twists + rates,
    )
    return tied(mechanism, shared, changed)


def linearised_starts(mechanism: Mechanism, shared: np.ndarray, states: States) -> Starts:
    """Lengths, free twists and derivatives at tied states (Ξ v = 0)."""
    lengths, xi, rates_by_pose, rates_by_shared, lengths_by_shared = _quantities(mechanism, shared, states)
    count, n = lengths.shape
    free = np.swapaxes(np.linalg.svd(xi)[2][:, n:], 1, 2)
    back = np.linalg.pinv(xi)
    none = np.zeros((count, n, free.shape[2]))
    own = 6 + free.shape[2]
    by = np.zeros((count, 12, own + len(shared)))
    by[:, :6, :6] = np.eye(6)
    by[:, 6:, :6] = -back @ rates_by_pose
    by[:, 6:, 6:own] = free
    by[:, 6:, own:] = -back @ rates_by_shared
    lengths_by = np.concatenate([_body_turned(xi, states.rotations), none, lengths_by_shared], axis=2)
    return Starts(lengths=lengths, lengths_by=lengths_by, states_by=by, free_twists=free)


def _body_turned(rows_: Float[np.ndarray, "W n 6"], rotations: Float[np.ndarray, "W 3 3"]) -> np.ndarray:
    """Derivatives by [δp; δφ] from those by [δp; δθ], θ in the world: δθ = R δφ."""
    return np.concatenate([rows_[..., :3], rows_[..., 3:] @ rotations], axis=2)


def _quantities(mechanism: Mechanism, shared: np.ndarray, states: States) -> tuple[np.ndarray, ...]:
    """l (W n), Ξ (W n 6), d(Ξ v)/d[δp; δφ] (W n 6), d(Ξ v)/dshared, dl/dshared (W n shared)."""
    count, n = len(states.positions), mechanism.n
    found = over_samples(
        mechanism.compiled("sensitivity: starts", _compile_starts),
        count,
        states.positions,
        states.rotations,
        states.twists,
        shared,
    )
    return (found[0], *(values.reshape(count, n, -1) for values in found[1:]))


def _compile_starts(mechanism: Mechanism) -> ca.Function:
    position, flat, twist = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9), ca.SX.sym("twist", 6)
    shared = ca.SX.sym("shared", shared_count(mechanism))
    theta = shared[BODY:]
    cables = mechanism.cables_at(position, from_rows(flat, 3, 3), theta)
    xi, lengths = structure_expression(cables), mechanism.lengths_at(cables, theta)
    speeds = xi @ twist
    by_pose = ca.horzcat(ca.jacobian(speeds, position), ca.jacobian(speeds, flat) @ turned(flat))
    outputs = [rows(xi), rows(by_pose), rows(ca.jacobian(speeds, shared)), rows(ca.jacobian(lengths, shared))]
    return function("starts", [position, flat, twist, shared], [lengths, *outputs])
