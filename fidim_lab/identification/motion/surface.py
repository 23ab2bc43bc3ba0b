"""Poses, twists and accelerations on the surface of poses that the held lengths allow, from all markers.

Least squares of the marker coordinates under the constraints l(p, R) = l_0, Ξ v = 0, Ξ v̇ + Ξ̇ v = 0. It is Eq. 44–45
without choosing free coordinates: no chart that turns singular inside a recording, and the marker's third coordinate,
which Eq. 44 throws away, is used. With λ coordinates given in `axes` it *is* Eq. 44–45.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Mask, PerCable, Positions, Rotations, Series, Twists
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.mechanism import Mechanism

Jacobian = Float[np.ndarray, "N K 6"]

MAX_STEPS = 80
MAX_TURN = 0.3
"""rad in one Gauss–Newton step"""
TOLERANCE = 1e-9
"""m and rad"""
ASTRAY, PASSES = 10.0, 6
"""times the median misfit beyond which a sample has ended in another valley; how often such are begun anew"""


@dataclass(frozen=True, eq=False)
class SurfacePoses:
    """Poses on the surface, with what the markers say against it."""

    positions: Positions
    rotations: Rotations
    misfit: Series
    """rms of marker − model over the marker coordinates of a sample, m"""
    settled: Mask
    """False where the pose was not found"""

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All of it, each with the sample as its first index."""
        return self.positions, self.rotations, self.misfit, self.settled


def marker_jacobian(rotations: Rotations, body_markers: Float[np.ndarray, "M 3"]) -> Jacobian:
    """∂(marker velocities)/∂(twist), (N, 3M, 6): rows [1, −[R m]×] of every marker."""
    return jacobian_of_arms(np.einsum("nij,mj->nmi", rotations, body_markers))


def jacobian_of_arms(arms: Float[np.ndarray, "N M 3"]) -> Jacobian:
    """`marker_jacobian` of markers that are there from P, in the world frame (m)."""
    out = np.zeros((*arms.shape, 6))
    out[..., :3] = np.eye(3)
    x, y, z = arms[..., 0], arms[..., 1], arms[..., 2]
    out[..., 0, 4], out[..., 0, 5] = z, -y
    out[..., 1, 3], out[..., 1, 5] = -z, x
    out[..., 2, 3], out[..., 2, 4] = y, -x
    return out.reshape(len(arms), -1, 6)


def poses(
    mechanism: Mechanism,
    lengths: PerCable,
    body_markers: Float[np.ndarray, "M 3"],
    markers: Float[np.ndarray, "N M 3"],
    start: Pose,
) -> SurfacePoses:
    """The pose of every sample: nearest to its markers, with the held lengths (m).

    Gauss–Newton from `start`'s rotation; samples that end in another valley begin again beside a neighbour. Where it
    does not settle (the markers hardly see one of the free motions) `settled` is False and the pose is not to be used.
    Raises InfeasibleError when it settles nowhere: the lengths do not fit these markers at all.
    """
    found = _descended(mechanism, lengths, body_markers, markers, np.tile(start.rotation, (len(markers), 1, 1)))
    if not found.settled.any():
        raise InfeasibleError(
            "No pose fits both the held lengths and the markers.",
            hint="Check cable order, lengths and marker position in the robot file.",
        )
    for _ in range(PASSES):
        astray = ~found.settled | (found.misfit > ASTRAY * np.median(found.misfit))
        sure = np.flatnonzero(~astray)
        if not astray.any() or len(sure) == 0:
            break
        rows = np.flatnonzero(astray)
        nearest = sure[np.abs(rows[:, np.newaxis] - sure).argmin(axis=1)]
        again = _descended(mechanism, lengths, body_markers, markers[rows], found.rotations[nearest])
        if not (better := again.settled & (again.misfit < 0.5 * found.misfit[rows])).any():
            break
        for old, new in zip(found.arrays, again.arrays, strict=True):
            old[rows[better]] = new[better]
    return found


def _descended(
    mechanism: Mechanism, lengths: PerCable, body_markers: np.ndarray, markers: np.ndarray, begins: Rotations
) -> SurfacePoses:
    """Gauss–Newton of each sample from a rotation of its own, its markers in the middle of their places."""
    R = begins.copy()
    p = (markers - np.einsum("nij,mj->nmi", R, body_markers)).mean(axis=1)
    open_ = np.arange(len(markers))
    for _ in range(MAX_STEPS):
        step = _step(mechanism, lengths, body_markers, markers[open_], p[open_], R[open_])
        p[open_] += step[:, :3]
        R[open_] = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R[open_]
        open_ = open_[np.abs(step).max(axis=1) > TOLERANCE]
        if len(open_) == 0:
            break
    settled = np.ones(len(markers), dtype=bool)
    settled[open_] = False
    rest = markers - p[:, None] - np.einsum("nij,mj->nmi", R, body_markers)
    return SurfacePoses(p, R, np.sqrt((rest**2).mean(axis=(1, 2))), settled)


def _step(
    mechanism: Mechanism,
    lengths: np.ndarray,
    body_markers: np.ndarray,
    markers: np.ndarray,
    p: Positions,
    R: Rotations,
) -> Twists:
    """One Gauss–Newton step [δp; δθ], limited in its turn."""
    rest = (markers - p[:, None] - np.einsum("nij,mj->nmi", R, body_markers)).reshape(len(p), -1)
    short = lengths - mechanism.lengths(p, R)
    step = tied_least_squares(marker_jacobian(R, body_markers), mechanism.structure_matrix(p, R), rest, short)
    turn = np.linalg.norm(step[:, 3:], axis=1, keepdims=True)
    return step * np.minimum(1.0, MAX_TURN / np.maximum(turn, 1e-300))


def tied_least_squares(
    J: Jacobian, Xi: Float[np.ndarray, "N n 6"], wanted: Float[np.ndarray, "N K"], exact: Float[np.ndarray, "N n"]
) -> Twists:
    """x of min |J x − wanted|² with Ξ x = exact, at every sample (its KKT system).

    Raises InfeasibleError where J and Ξ together do not fix all six: too few markers for this many freedoms.
    """
    n = Xi.shape[1]
    K = np.zeros((len(J), 6 + n, 6 + n))
    K[:, :6, :6] = np.swapaxes(J, 1, 2) @ J
    K[:, :6, 6:] = np.swapaxes(Xi, 1, 2)
    K[:, 6:, :6] = Xi
    right = np.concatenate([np.einsum("nki,nk->ni", J, wanted), exact], axis=1)
    try:
        return np.linalg.solve(K, right[..., None])[:, :6, 0]
    except np.linalg.LinAlgError as error:
        raise InfeasibleError(
            f"The markers and {n} held lengths together do not fix the platform's pose.",
            hint="Use more markers, or check the robot file for cables that coincide.",
        ) from error


def rates(
    mechanism: Mechanism,
    found: SurfacePoses,
    J: Jacobian,
    velocities: Float[np.ndarray, "N K"],
) -> Twists:
    """The twist with Ξ v = 0 nearest to the marker velocities (m/s); world frame (Eq. 6)."""
    Xi = mechanism.structure_matrix(found.positions, found.rotations)
    return tied_least_squares(J, Xi, velocities, np.zeros(Xi.shape[:2]))


def accelerations(
    mechanism: Mechanism,
    found: SurfacePoses,
    J: Jacobian,
    twists: Twists,
    wanted: Float[np.ndarray, "N K"],
) -> Twists:
    """v̇ with Ξ v̇ = −Ξ̇ v nearest to the marker accelerations without their centripetal part (m/s²) (Eq. 7, 45)."""
    Xi = mechanism.structure_matrix(found.positions, found.rotations)
    Xi_rate = mechanism.structure_matrix_rate(found.positions, found.rotations, twists)
    return tied_least_squares(J, Xi, wanted, -np.einsum("nij,nj->ni", Xi_rate, twists))


def centripetal(rotations: Rotations, twists: Twists, body_markers: Float[np.ndarray, "M 3"]) -> np.ndarray:
    """ω × (ω × R m) of every marker, (N, 3M), m/s²."""
    omega = twists[:, None, 3:]
    arms = np.einsum("nij,mj->nmi", rotations, body_markers)
    return np.cross(omega, np.cross(omega, arms)).reshape(len(twists), -1)


ARM = 0.2
"""m; turns rotations into lengths where a condition number needs one unit"""


def conditioning(Xi: Float[np.ndarray, "N n 6"], J: Jacobian) -> Series:
    """How unevenly the marker coordinates see the free motions: condition number of J over the null space of Ξ.

    Rotations are scaled by 0.2 m. 1 is ideal; where it is large one free motion hardly moves the markers.
    """
    values = np.linalg.svd(J @ free_directions(Xi), compute_uv=False)
    with np.errstate(divide="ignore"):
        return values[:, 0] / values[:, -1]


def free_directions(Xi: Float[np.ndarray, "N n 6"]) -> Float[np.ndarray, "N 6 free"]:
    """A basis of the free twists (Ξ N = 0), orthonormal after scaling rotations by 0.2 m; no chart, no order."""
    scale = np.array([1.0, 1.0, 1.0, ARM, ARM, ARM])
    Vt = np.linalg.svd(Xi / scale)[2]
    return np.swapaxes(Vt[:, Xi.shape[1] :, :], 1, 2) / scale[:, None]
