"""Full pose from markers: rigid registration of every sample, and derivatives of a rotation that are exact.

The rotation is filtered and differentiated in *one* chart per window, the rotation vector from the window's mean
rotation, and the chart's own derivatives turn the result into angular velocity and acceleration without approximation
(differentiating matrix entries or Euler angles would not). Valid while the platform stays within 150° of its mean.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Matrix3, Positions, Rotations, Series
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import InfeasibleError

Markers = Float[np.ndarray, "N M 3"]
Weights = Float[np.ndarray, "N M"]

MIN_SPREAD = 0.02
"""m; three markers within this of one line do not give a rotation"""
MAX_ANGLE = np.deg2rad(150)


def spread(body_markers: Float[np.ndarray, "M 3"]) -> float:
    """How far the markers are from lying on one line: the second singular value of their scatter, m."""
    if len(body_markers) < 3:
        return 0.0
    return float(np.linalg.svd(body_markers - body_markers.mean(axis=0), compute_uv=False)[1])


def visibility(markers: Markers, ramp: int) -> Weights:
    """Weight of every marker and sample: 0 where it is missing, rising to 1 within `ramp` samples of a gap.

    A marker that enters or leaves at full weight would make the pose jump by its misfit, and differentiation would
    turn that into an acceleration.
    """
    seen = np.asarray(np.isfinite(markers).all(axis=2))
    weights = np.empty(seen.shape)
    index = np.arange(len(seen))
    for m in range(seen.shape[1]):
        gone = np.flatnonzero(~seen[:, m])
        if len(gone) == 0:
            weights[:, m] = 1.0
            continue
        at = np.searchsorted(gone, index)
        before = np.abs(index - gone[np.clip(at - 1, 0, len(gone) - 1)])
        after = np.abs(index - gone[np.clip(at, 0, len(gone) - 1)])
        weights[:, m] = np.minimum(np.minimum(before, after) / ramp, 1.0)
    return weights


def register(
    markers: Markers, body_markers: Float[np.ndarray, "M 3"], weights: Weights
) -> tuple[Positions, Rotations, Series]:
    """`fit_pose` for what is differentiated afterwards: a rotation about a nearly straight line is refused too.

    Samples whose visible markers do not fix a rotation (fewer than three, or within 7 mm of a line) are NaN.
    """
    positions, rotations, rms = fit_pose(markers, body_markers, weights)
    share = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    about = body_markers[None] - (share @ body_markers)[:, None]
    lost = np.linalg.svd(np.sqrt(share)[..., None] * about, compute_uv=False)[:, 1] < MIN_SPREAD / 3
    for values in (positions, rotations, rms):
        values[lost] = np.nan
    return positions, rotations, rms


def distances_off(
    markers: Float[np.ndarray, "N M 3"], body_markers: Float[np.ndarray, "M 3"]
) -> Float[np.ndarray, "N pairs"]:
    """By how much the markers are farther apart than on the body, m; NaN where one of a pair is missing."""
    first, second = np.triu_indices(len(body_markers), 1)
    nominal = np.linalg.norm(body_markers[first] - body_markers[second], axis=1)
    return np.linalg.norm(markers[:, first] - markers[:, second], axis=2) - nominal


def mean_rotation(rotations: Rotations) -> Matrix3:
    """The rotation nearest to the mean of the matrices (chordal mean); NaN samples are left out."""
    whole = rotations[np.isfinite(rotations).all(axis=(1, 2))]
    U, _, Vt = np.linalg.svd(whole.mean(axis=0))
    return U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt


def rotation_vectors(rotations: Rotations, reference: Matrix3) -> Positions:
    """φ with R = exp([φ]×) R_ref, world frame, rad; NaN where R is. Raises InfeasibleError beyond 150°."""
    whole = np.isfinite(rotations).all(axis=(1, 2))
    out = np.full((len(rotations), 3), np.nan)
    if whole.any():
        out[whole] = Rotation.from_matrix(rotations[whole] @ reference.T).as_rotvec()
    largest = float(np.nanmax(np.linalg.norm(out, axis=1), initial=0.0))
    if largest > MAX_ANGLE:
        raise InfeasibleError(
            f"The platform turns by {np.rad2deg(largest):.0f}° from its mean pose: this is not a free oscillation.",
            hint="Check marker labels (two swapped markers look like this), or cut the window.",
        )
    return out


def from_rotation_vectors(
    phi: Positions, rate: Positions, acceleration: Positions, reference: Matrix3
) -> tuple[Rotations, Positions, Positions]:
    """R, ω (rad/s) and α (rad/s²) in the world frame from φ, φ̇, φ̈.

    ω = J(φ) φ̇ with the left Jacobian J = 1 + a [φ]× + b [φ]×², a = (1 − cos θ)/θ², b = (θ − sin θ)/θ³;
    α = J φ̈ + J̇ φ̇.
    """
    theta = np.linalg.norm(phi, axis=1)
    a, b, a_rate, b_rate = _jacobian_coefficients(theta)
    turning = np.einsum("ni,ni->n", phi, rate)  # θ θ̇
    omega = _left(phi, rate, a, b)
    double = np.cross(phi, np.cross(phi, rate))
    drift = (
        (a_rate * turning)[:, None] * np.cross(phi, rate)
        + (b_rate * turning)[:, None] * double
        + b[:, None] * np.cross(rate, np.cross(phi, rate))
    )
    return Rotation.from_rotvec(phi).as_matrix() @ reference, omega, _left(phi, acceleration, a, b) + drift


def _left(phi: Positions, v: Positions, a: Series, b: Series) -> Positions:
    first = np.cross(phi, v)
    return v + a[:, None] * first + b[:, None] * np.cross(phi, first)


def _jacobian_coefficients(theta: Series) -> tuple[Series, Series, Series, Series]:
    """a, b, and a′/θ, b′/θ; by their series where θ is small (cancellation)."""
    small = theta < 0.05
    t = np.where(small, 1.0, theta)
    sine, cosine, t2 = np.sin(t), np.cos(t), t * t
    q = theta**2
    a = np.where(small, 1 / 2 - q / 24 + q**2 / 720, (1 - cosine) / t2)
    b = np.where(small, 1 / 6 - q / 120 + q**2 / 5040, (t - sine) / (t2 * t))
    a_rate = np.where(small, -1 / 12 + q / 180 - q**2 / 6720, (t * sine - 2 * (1 - cosine)) / t2**2)
    b_rate = np.where(small, -1 / 60 + q / 1260 - q**2 / 60480, (3 * sine - t * cosine - 2 * t) / (t2**2 * t))
    return a, b, a_rate, b_rate
