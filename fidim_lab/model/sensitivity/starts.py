"""Initial states that obey the locked cables, Ξ v = l̇ (0 but for effects), and what they and the lengths depend on.

A window's own unknowns are [δp; δφ; δu]: a change of pose and λ rates along the free twists at that pose. Ξ is tied to
the pose, so the twist follows it: v(pose) is the projection of the old twist on the new free twists.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.model.batch import evaluate, function, rows
from fidim_lab.model.contributions import seen_compliances_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import Sample, turned
from fidim_lab.model.sensitivity.integrate import States

Begins = Float[np.ndarray, " W"]
"""s on each window's own clock"""


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


def tied(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> States:
    """The same poses with the nearest twists at which the cables do as they must: v − Ξ⁺ (Ξ v − l̇)."""
    found = _quantities(mechanism, shared, states, begins)
    off = np.linalg.pinv(found.structure) @ found.speeds[..., np.newaxis]
    return States(states.positions, states.rotations, states.twists - off[..., 0])


def moved(
    mechanism: Mechanism,
    shared: np.ndarray,
    states: States,
    starts: Starts,
    steps: Float[np.ndarray, "W own"],
    begins: Begins,
) -> States:
    """States after a step [δp; δφ; δu] of each window's own unknowns, for the (new) shared parameters."""
    rates = (starts.free_twists @ steps[:, 6:, np.newaxis])[..., 0]
    changed = States(
        positions=states.positions + steps[:, :3],
        rotations=states.rotations @ Rotation.from_rotvec(steps[:, 3:6]).as_matrix(),
        twists=states.twists + rates,
    )
    return tied(mechanism, shared, changed, begins)


def linearised_starts(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> Starts:
    """Lengths, free twists and derivatives at tied states."""
    found = _quantities(mechanism, shared, states, begins)
    count, n = found.lengths.shape
    free = np.swapaxes(np.linalg.svd(found.structure)[2][:, n:], 1, 2)
    back = np.linalg.pinv(found.structure)
    own = 6 + free.shape[2]
    by = np.zeros((count, 12, own + len(shared)))
    by[:, :6, :6] = np.eye(6)
    by[:, 6:, :6] = -back @ found.speeds_by_pose
    by[:, 6:, 6:own] = free
    by[:, 6:, own:] = -back @ found.speeds_by_shared
    by_pose = np.concatenate([found.structure[..., :3], found.structure[..., 3:] @ states.rotations], axis=2)
    lengths_by = np.concatenate([by_pose, np.zeros((count, n, own - 6)), found.lengths_by_shared], axis=2)
    return Starts(lengths=found.lengths, lengths_by=lengths_by, states_by=by, free_twists=free)


@dataclass(frozen=True, eq=False)
class _Quantities:
    lengths: Float[np.ndarray, "W n"]
    """less what the cables have grown by since the window's start"""
    structure: Float[np.ndarray, "W n 6"]
    speeds: Float[np.ndarray, "W n"]
    """Ξ v − l̇, which must vanish"""
    speeds_by_pose: Float[np.ndarray, "W n 6"]
    """by [δp; δφ]"""
    speeds_by_shared: Float[np.ndarray, "W n shared"]
    lengths_by_shared: Float[np.ndarray, "W n shared"]


def _quantities(mechanism: Mechanism, shared: np.ndarray, states: States, begins: Begins) -> _Quantities:
    count, n = len(states.positions), mechanism.n
    compiled = mechanism.compiled("sensitivity: starts", _compile_starts)
    found = evaluate(
        mechanism.compiled(f"sensitivity: {count} starts", lambda _: compiled.map(count)),
        begins,
        states.positions,
        states.rotations,
        states.twists,
        np.broadcast_to(shared, (count, len(shared))),
    )
    return _Quantities(found[0], found[1].reshape(count, n, 6), found[2], *(x.reshape(count, n, -1) for x in found[3:]))


def _compile_starts(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    equations = sample.equations
    symbols = equations.symbols
    drift, rate = equations.length_constraint(sample.solver)
    lengths, speeds = equations.lengths - drift, equations.structure @ symbols.twist - rate
    if not equations.compliance.is_zero():
        seen = seen_compliances_at(mechanism, equations.state.cables, symbols.theta)
        lengths += seen * sample.solver(equations.wrench, equations.pull)[6:]
    by_pose = ca.horzcat(
        ca.jacobian(speeds, symbols.position), ca.jacobian(speeds, symbols.flat) @ turned(symbols.flat)
    )
    tables = [by_pose, ca.jacobian(speeds, sample.shared), ca.jacobian(lengths, sample.shared)]
    outputs = [lengths, rows(equations.structure), speeds, *(rows(table) for table in tables)]
    return function("starts", sample.inputs, outputs)
