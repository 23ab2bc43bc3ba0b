"""Finding poses: from free coordinates at locked lengths (Eq. 44), from lengths alone, and from a wanted place.

dependent_pose      a measured marker and locked lengths → pose at every sample
allowed_places      measured markers → the nearest ones that locked lengths allow
pose_from_lengths   lengths → the pose in which the platform rests
equilibrium_at      a marker position → lengths and pose in which the platform rests there (planning)
"""

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable, Positions, Rotations, Vector3
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.batch import evaluate, from_rows, function, rows
from fidim_lab.model.equilibria import equilibrium_at, pose_from_lengths
from fidim_lab.model.geometry import rotation_from_gibbs, rotation_matrix
from fidim_lab.model.making import MAKING
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import built

__all__ = ["allowed_places", "dependent_pose", "equilibrium_at", "pose_from_lengths"]

NEWTON_STEPS = 5
"""for each sample; from 10 mm away three are enough, a badly conditioned chart takes more"""

LARGEST_STEP = 1e-2
"""m (or rad) of a free coordinate from one solved pose to the next; farther samples get stepping stones"""

NEARING_STEPS = 8
"""from 0.1 m away they leave 3 µm"""

DAMPING = 0.03
"""m/rad (and m/m): turns that move the marker by less are taken slowly, as on three parallel cables"""

STIFF = 100.0
"""weight of a metre of cable against one of the marker: lengths give way by 1e-4 of what the marker is off"""

TOLERANCE = 1e-9
"""m (or rad) of the largest residual"""


def dependent_pose(
    mechanism: Mechanism,
    lengths: PerCable,
    marker: Vector3,
    axes: tuple[int, ...],
    values: Float[np.ndarray, "N free"],
    start: Pose,
) -> tuple[Positions, Rotations]:
    """Poses (N, 3), (N, 3, 3) at which the cables have `lengths` and the free coordinates `values` (Eq. 44).

    axes: 0, 1, 2 for the marker's x, y, z in the world (m); 3, 4, 5 for the components of 2 g, g the Gibbs vector of
    R Rᵀ_start, that is the rotation (rad, for small ones) away from the start about the world's x, y, z.
    Newton's method, each sample started from the one before, the first from `start`; the branch of solutions is the
    start's. Raises InfeasibleError with the sample's number where it does not converge, and for a missing value.
    """
    begin = _coordinates(start, marker, axes)
    path, samples = _stepping_stones(begin, values)
    newton = mechanism.compiled(f"dependent pose {axes}", lambda made: _compile_newton(made, axes))
    count = len(path)
    with MAKING:
        newton = newton.mapaccum(count)
    states, residuals = evaluate(
        newton,
        np.concatenate([start.position, start.rotation.ravel()]),
        path,
        *(np.tile(constant, (count, 1)) for constant in (lengths, marker, start.rotation.ravel(), mechanism.theta)),
    )
    failed = ~(residuals[:, 0] < TOLERANCE)
    if failed.any():
        first = int(np.searchsorted(samples, np.argmax(failed)))
        raise InfeasibleError(
            f"No pose of the platform fits the locked lengths and the free coordinates {axes} at sample {first + 1} "
            f"of {len(values)} (residual {residuals[int(np.argmax(failed)), 0]:.1e} m).",
            hint="The coordinates may be badly conditioned there (see conditioning, best_axes), or a sample is wrong.",
        )
    chosen = states[samples]
    return chosen[:, :3], chosen[:, 3:].reshape(-1, 3, 3)


def allowed_places(
    mechanism: Mechanism, lengths: PerCable, marker: Vector3, places: Positions, start: Pose
) -> Positions:
    """(N, 3) places (m, world) of the marker, nearest to `places`, in poses at which the cables have `lengths` (m).

    Four cables leave the marker a surface, five a curve; fewer forbid at most what only a large turn would reach.
    Damped Gauss-Newton, each from `start`. Raises InfeasibleError at a singular pose.
    """
    positions, rotations = (np.repeat(one[np.newaxis], len(places), 0) for one in (start.position, start.rotation))
    axes = np.eye(3)
    for _ in range(NEARING_STEPS):
        arms = rotations @ marker
        turns = -np.cross(arms[:, np.newaxis, :], axes).transpose(0, 2, 1)  # of the marker, by a small rotation
        moves = np.concatenate([np.broadcast_to(axes, turns.shape), turns], axis=2)
        jacobian = np.concatenate([mechanism.structure_matrix(positions, rotations) * STIFF, moves], axis=1)
        stretched = (lengths - mechanism.lengths(positions, rotations)) * STIFF
        missed = np.concatenate([stretched, places - positions - arms], axis=1)
        across = jacobian.transpose(0, 2, 1)
        steps = np.linalg.solve(across @ jacobian + DAMPING**2 * np.eye(6), across @ missed[:, :, np.newaxis])[:, :, 0]
        positions = positions + steps[:, :3]
        rotations = np.array([rotation_matrix(step / 2) for step in steps[:, 3:]]) @ rotations
    return positions + rotations @ marker


def _coordinates(pose: Pose, marker: Vector3, axes: tuple[int, ...]) -> Float[np.ndarray, " free"]:
    place = pose.position + pose.rotation @ marker
    return np.array([place[axis] if axis < 3 else 0.0 for axis in axes])


def _stepping_stones(
    begin: Float[np.ndarray, " free"], values: Float[np.ndarray, "N free"]
) -> tuple[Float[np.ndarray, "K free"], np.ndarray]:
    """The values with points in between where they lie far apart, and the indices of the values among them."""
    known = np.vstack([begin, values])
    jumps = np.nan_to_num(np.abs(np.diff(known, axis=0)).max(axis=1))
    pieces = np.maximum(1, np.ceil(jumps / LARGEST_STEP)).astype(int)
    samples = np.cumsum(pieces) - 1
    at = np.concatenate([[0], samples + 1]).astype(float)
    steps = np.arange(1, samples[-1] + 2)
    path = np.column_stack([np.interp(steps, at, column) for column in known.T])
    return path, samples


def _compile_newton(mechanism: Mechanism, axes: tuple[int, ...]) -> ca.Function:
    """(pose, values, lengths, marker, reference rotation, θ) → (pose, residual): NEWTON_STEPS of Newton's method."""
    state, values = ca.SX.sym("pose", 12), ca.SX.sym("values", len(axes))
    lengths, marker = ca.SX.sym("lengths", mechanism.n), ca.SX.sym("marker", 3)
    reference, theta = ca.SX.sym("reference", 9), ca.SX.sym("theta", mechanism.theta.size)
    step = ca.SX.sym("step", 6)
    position = state[:3] + step[:3]
    rotation = rotation_from_gibbs(step[3:] / 2) @ from_rows(state[3:], 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    place = position + rotation @ marker
    turned = _twice_gibbs(rotation @ from_rows(reference, 3, 3).T)
    coordinates = ca.vertcat(*(place[axis] if axis < 3 else turned[axis - 3] for axis in axes))
    residual = ca.vertcat(coordinates - values, mechanism.lengths_at(cables, theta) - lengths)
    here = ca.SX.zeros(6)
    jacobian = ca.substitute(ca.jacobian(residual, step), step, here)
    missed = ca.substitute(residual, step, here)
    given = [state, values, lengths, marker, reference, theta]
    system = ca.Function("system", given, [ca.solve(jacobian, missed), ca.mmax(ca.fabs(missed))])
    move = ca.Function("move", [state, step], [ca.vertcat(position, rows(rotation))])
    pose, rest = state, given[1:]
    for _ in range(NEWTON_STEPS):
        pose = move(pose, -system(pose, *rest)[0])
    compiled = function("dependent_pose", given, [pose, system(pose, *rest)[1]])
    return built(compiled) if mechanism.native else compiled


def _twice_gibbs(rotation: ca.SX) -> ca.SX:
    """2 g of a rotation matrix: twice the axial part of R over 1 + trace R."""
    axial = ca.vertcat(
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    )
    return 2 * axial / (1 + ca.trace(rotation))
