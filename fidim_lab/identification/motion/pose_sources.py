"""The pose from the robot's own sensors: lengths, swivel angles and inclination, sample by sample (paper, footnote 6).

    readings of a sample   l_i(p, R), σ_i(p, R) + zero_i, roll pitch (yaw)(R) + zero      2n + 2 or 3, for 6 unknowns

Weighted least squares gives every sample's pose with its covariance. `markers` may join (`PoseSource.BOTH`), weighted
by their own noise. Zeros, delays and noise of the sensors come from `sensor_zeros`; `virtual_markers` turns poses into
what every estimator reads.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Mask, Positions, Rotations
from fidim_lab.data.own_sensors import OwnSensors
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError, RefusedError
from fidim_lab.identification.motion.sensor_zeros import SensorZeros
from fidim_lab.identification.motion.surface import marker_jacobian
from fidim_lab.model.mechanism import Mechanism

NUDGE = 1e-6
"""m and rad, of central differences"""
MOST_STEPS = 40
SETTLED = 1e-9
"""m and rad"""
LARGEST_STEP = 0.2
"""m or rad: farther in one step leaves the region in which the readings are nearly linear"""
UNSEEN = 1e10
"""condition number of the scaled information beyond which a sample's readings leave a motion open"""
ARM = 0.2
"""m; turns radians into metres where one unit is needed"""

Readings = Float[np.ndarray, "N K"]


class PoseSource(StrEnum):
    """Where poses come from."""

    MOCAP = "mocap"
    """the markers of the motion capture"""
    SWIVEL = "swivel"
    """cable lengths, swivel angles and inclination: no camera"""
    BOTH = "both"
    """all of them, each weighted by its noise"""


@dataclass(frozen=True, eq=False)
class SensedPoses:
    """Poses of one window with their uncertainty; NaN where readings were missing or did not fix a pose."""

    positions: Positions
    rotations: Rotations
    covariances: Float[np.ndarray, "N 6 6"]
    """of [p; rotation vector], world frame, m and rad"""
    chi2_per_dof: float
    """of all readings against their noise; 1 says that they agree as they should, NaN with exactly six readings"""

    @property
    def known(self) -> Mask:
        """Samples with a pose."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))


@dataclass(frozen=True, eq=False)
class MarkerReadings:
    """Markers that join the fit."""

    seen: Float[np.ndarray, "N M 3"]
    body: Float[np.ndarray, "M 3"]
    noise: float
    """m"""


def sense_poses(
    mechanism: Mechanism,
    readings: OwnSensors,
    zeros: SensorZeros,
    start: Pose,
    markers: MarkerReadings | None = None,
) -> SensedPoses:
    """The pose of every sample from readings that are already on the window's clock (`sensor_zeros.corrected`).

    start: a pose near all of them, from which Gauss–Newton begins. A marker that is missing in a sample is left out; a
    missing length, angle or inclination leaves the sample without a pose.
    Raises RefusedError where no sample has a pose, InfeasibleError at a singular pose of the geometry.
    """
    count, n = readings.swivels.shape
    sd = zeros.noise(n, readings.inclination.shape[1])
    measured = np.column_stack([readings.lengths, readings.swivels, readings.inclination])
    rows = np.flatnonzero(np.isfinite(measured).all(axis=1))
    fit = _Fit(mechanism, measured[rows], sd, None if markers is None else _rows(markers, rows))
    p = np.tile(start.position, (len(rows), 1))
    R = np.tile(start.rotation, (len(rows), 1, 1))
    settled = fit.solve(p, R)
    if not settled.any():
        raise RefusedError(
            "Lengths, swivel angles and inclination fix no pose in any sample.",
            hint="Check their zeros and signs, and the swivel axes in the robot file.",
        )
    information, chi2, dof = fit.judge(p[settled], R[settled], settled)
    positions, rotations = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    covariances = np.full((count, 6, 6), np.nan)
    at = rows[settled]
    positions[at], rotations[at], covariances[at] = p[settled], R[settled], np.linalg.inv(information)
    return SensedPoses(positions, rotations, covariances, chi2 / dof if dof > 0 else float("nan"))


def _rows(markers: MarkerReadings, rows: np.ndarray) -> MarkerReadings:
    return MarkerReadings(markers.seen[rows], markers.body, markers.noise)


def predicted(mechanism: Mechanism, positions: Positions, rotations: Rotations, inclinations: int) -> Readings:
    """[l; σ; rotations about x, y, z] (N, 2n + inclinations) of poses: the readings of sensors with zero at zero."""
    angles = Rotation.from_matrix(rotations).as_euler("xyz")[:, :inclinations]
    return np.column_stack([
        mechanism.lengths(positions, rotations), mechanism.swivel_angles(positions, rotations), angles
    ])  # fmt: skip


def wrapped(differences: Readings, lengths: int) -> Readings:
    """Differences of readings, those of angles (after the first `lengths` columns) within ±π."""
    out = differences.copy()
    out[:, lengths:] -= 2 * np.pi * np.rint(out[:, lengths:] / (2 * np.pi))
    return out


def turned(p: Positions, R: Rotations, step: Float[np.ndarray, "N 6"]) -> tuple[Positions, Rotations]:
    """Poses moved by [dp; rotation vector], world frame."""
    return p + step[:, :3], Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R


@dataclass(frozen=True, eq=False)
class _Fit:
    mechanism: Mechanism
    measured: Readings
    sd: Float[np.ndarray, " K"]
    markers: MarkerReadings | None

    def solve(self, p: Positions, R: Rotations) -> Mask:
        """Gauss–Newton on all samples at once, in place; which have settled."""
        open_ = np.arange(len(p))
        settled = np.zeros(len(p), dtype=bool)
        for _ in range(MOST_STEPS):
            if len(open_) == 0:
                break
            try:
                r, J = self._equations(p[open_], R[open_], open_)
            except InfeasibleError:
                break
            H = np.swapaxes(J, 1, 2) @ J
            good = _fixed(H)
            open_ = open_[good]
            step = np.linalg.solve(H[good], np.einsum("nki,nk->ni", J[good], r[good])[..., None])[..., 0]
            size = np.abs(step).max(axis=1)
            step *= np.minimum(1.0, LARGEST_STEP / np.maximum(size, 1e-300))[:, None]
            p[open_], R[open_] = turned(p[open_], R[open_], step)
            settled[open_[size <= SETTLED]] = True
            open_ = open_[size > SETTLED]
        return settled

    def judge(self, p: Positions, R: Rotations, which: Mask) -> tuple[np.ndarray, float, int]:
        """Information matrices (N, 6, 6), χ² and degrees of freedom at the solution."""
        r, J = self._equations(p, R, np.flatnonzero(which))
        used = int(np.abs(J).max(axis=2).astype(bool).sum())
        return np.swapaxes(J, 1, 2) @ J, float((r**2).sum()), used - 6 * len(p)

    def _equations(self, p: Positions, R: Rotations, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whitened residual (N, K) and Jacobian (N, K, 6)."""
        n, inclinations = self.mechanism.robot.n, self.measured.shape[1] - 2 * self.mechanism.robot.n
        r = wrapped(self.measured[which] - predicted(self.mechanism, p, R, inclinations), n)
        columns: list[np.ndarray] = []
        for direction in np.eye(6) * NUDGE:
            there, back = (
                predicted(self.mechanism, *turned(p, R, np.tile(sign * direction, (len(p), 1))), inclinations)
                for sign in (1.0, -1.0)
            )
            columns.append(wrapped(there - back, n) / (2 * NUDGE))
        r, J = r / self.sd, np.stack(columns, axis=2) / self.sd[:, None]
        if self.markers is None:
            return r, J
        seen = self.markers.seen[which]
        miss = (seen - p[:, None] - np.einsum("nij,mj->nmi", R, self.markers.body)).reshape(len(p), -1)
        here = np.isfinite(miss)
        rows = np.where(here[..., None], marker_jacobian(R, self.markers.body), 0.0) / self.markers.noise
        return (
            np.concatenate([r, np.where(here, miss, 0.0) / self.markers.noise], axis=1),
            np.concatenate([J, rows], axis=1),
        )


def _fixed(H: np.ndarray) -> Mask:
    """Where the information (N, 6, 6) leaves no motion open."""
    scale = np.array([1.0, 1.0, 1.0, 1 / ARM, 1 / ARM, 1 / ARM])
    return np.linalg.cond(H * scale * scale[:, None]) < UNSEEN
