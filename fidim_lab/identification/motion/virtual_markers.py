"""A campaign as if cameras had seen it: poses from the robot's own sensors written as markers of a virtual cluster.

Every estimator reads markers. Four of them at the corners of a regular tetrahedron carry, with equal noise, exactly the
information of a pose with isotropic covariance: 4/σ² per axis of position and (8/3) ρ²/σ² of rotation. σ and ρ
are chosen to match the poses' mean covariance, so that the stated uncertainty means what it says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.data.own_sensors import OwnSensors, own_sensors
from fidim_lab.data.records import Campaign, Window
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.motion import rigid
from fidim_lab.identification.motion.pose_sources import MarkerReadings, PoseSource, SensedPoses, predicted, sense_poses
from fidim_lab.identification.motion.sensor_zeros import Compared, SensorZeros, calibrated, corrected, stated
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
"""of a regular tetrahedron of radius 1"""
RADII = (0.05, 1.0)
"""m, of the virtual cluster"""


@dataclass(frozen=True, eq=False)
class PoseDifference:
    """One window's poses against those of the motion capture, rms over samples that have both."""

    window: str
    samples: int
    position: float
    """m, of one coordinate of P"""
    rotation: float
    """rad, of one component of the rotation vector"""


@dataclass(frozen=True, eq=False)
class Sensed:
    """A campaign with poses from elsewhere."""

    campaign: Campaign
    """its markers are virtual ones"""
    zeros: SensorZeros
    calibrated: bool
    """zeros come from the markers of this campaign; otherwise they are taken as zero"""
    differences: tuple[PoseDifference, ...]
    """for windows that the motion capture saw whole"""
    unused: Mapping[str, str]
    """window id → why it has no poses"""
    chi2_per_dof: float
    """median over the windows: how well the sensors of a sample agree"""


def with_poses_from(campaign: Campaign, source: PoseSource) -> Sensed:
    """The campaign as seen by the robot's own sensors (SWIVEL) or by these and the markers (BOTH).

    Raises SetupError where columns are missing, RefusedError where no window gets a pose.
    """
    mechanism = Mechanism(campaign.robot)
    readings = {window.id: own_sensors(window, campaign.robot.n) for window in campaign.windows}
    seen = {window.id: _by_markers(campaign, window) for window in campaign.windows}
    found = calibrated(_compared(mechanism, campaign, readings, seen), campaign.robot.sensors.encoder_resolution)
    zeros = found or stated(campaign.robot.sensors.encoder_resolution)
    poses: dict[str, SensedPoses] = {}
    unused: dict[str, str] = {}
    for window in campaign.windows:
        try:
            poses[window.id] = _sensed(mechanism, campaign, window, readings[window.id], zeros, source)
        except FidimError as error:
            unused[window.id] = str(error)
    if not poses:
        raise RefusedError(f"No window gives poses: {'; '.join(dict.fromkeys(unused.values()))}")
    return Sensed(
        campaign=_virtual(campaign, poses),
        zeros=zeros,
        calibrated=found is not None,
        differences=tuple(_difference(id_, poses[id_], seen[id_]) for id_ in poses if seen[id_] is not None),
        unused=unused,
        chi2_per_dof=float(np.median([found.chi2_per_dof for found in poses.values()])),
    )


Seen = tuple[np.ndarray, np.ndarray]
"""positions (N, 3), rotations (N, 3, 3) by the markers; NaN where they do not show a pose"""


def _by_markers(campaign: Campaign, window: Window) -> Seen | None:
    body = campaign.robot.markers[: window.markers.shape[1]]
    if rigid.spread(body) < rigid.MIN_SPREAD:
        return None
    positions, rotations, _ = fit_pose(window.markers, body)
    return (positions, rotations) if np.isfinite(positions).any() else None


def _compared(
    mechanism: Mechanism, campaign: Campaign, readings: Mapping[str, OwnSensors], seen: Mapping[str, Seen | None]
) -> Sequence[Compared]:
    """Zeros are no inertial parameters, so held-out windows may take part."""
    out: list[Compared] = []
    n = campaign.robot.n
    for window in campaign.windows:
        pose, read = seen[window.id], readings[window.id]
        if pose is None:
            continue
        known = np.isfinite(pose[0]).all(axis=1)
        K = read.inclination.shape[1]
        expected = np.full((len(window.t), 2 * n + K), np.nan)
        expected[known] = predicted(mechanism, pose[0][known], pose[1][known], K)
        part = OwnSensors(expected[:, :n], expected[:, n : 2 * n], expected[:, 2 * n :])
        out.append(Compared(window.t, read, part))
    return out


def _sensed(
    mechanism: Mechanism, campaign: Campaign, window: Window, read: OwnSensors, zeros: SensorZeros, source: PoseSource
) -> SensedPoses:
    robot = campaign.robot
    start = pose_from_lengths(mechanism, robot.nominal, np.nanmean(read.lengths, axis=0)).pose
    markers = None
    if source is PoseSource.BOTH:
        body = robot.markers[: window.markers.shape[1]]
        markers = MarkerReadings(window.markers, body, robot.sensors.marker_noise)
    return sense_poses(mechanism, corrected(window.t, read, zeros), zeros, start, markers)


def _difference(window: str, sensed: SensedPoses, seen: Seen | None) -> PoseDifference:
    if seen is None:
        return PoseDifference(window, 0, float("nan"), float("nan"))
    both = sensed.known & np.isfinite(seen[0]).all(axis=1)
    if not both.any():
        return PoseDifference(window, 0, float("nan"), float("nan"))
    apart = sensed.positions[both] - seen[0][both]
    turn = Rotation.from_matrix(sensed.rotations[both] @ np.swapaxes(seen[1][both], 1, 2)).as_rotvec()
    rms = (float(np.sqrt(np.mean(values**2))) for values in (apart, turn))
    return PoseDifference(window, int(both.sum()), *rms)


def _virtual(campaign: Campaign, poses: Mapping[str, SensedPoses]) -> Campaign:
    robot = campaign.robot
    centre = np.mean([cable.a for cable in robot.cables], axis=0)
    place, turn = _mean_variances(poses, centre)
    noise = float(2.0 * np.sqrt(place))
    radius = float(np.clip(np.sqrt(1.5 * place / turn), *RADII))
    body = centre + radius * CORNERS
    windows = tuple(_placed(window, poses[window.id], body) for window in campaign.windows if window.id in poses)
    sensors = replace(robot.sensors, marker_noise=noise)
    virtual = replace(robot, marker=body[0], extra_markers=tuple(body[1:]), sensors=sensors)
    return replace(campaign, robot=virtual, windows=windows)


def _mean_variances(poses: Mapping[str, SensedPoses], centre: np.ndarray) -> tuple[float, float]:
    """Variance of one coordinate of the body's point `centre` (m²), and of one component of the rotation (rad²)."""
    place: list[float] = []
    turn: list[float] = []
    for found in poses.values():
        at = found.known
        lever = np.einsum("nij,j->ni", found.rotations[at], centre)
        move = np.tile(np.eye(3, 6), (len(lever), 1, 1))
        move[:, :, 3:] = np.cross(lever[:, None], np.eye(3)[None])
        covariance = move @ found.covariances[at] @ np.swapaxes(move, 1, 2)
        place.append(float(np.trace(covariance, axis1=1, axis2=2).mean()) / 3)
        turn.append(float(np.trace(found.covariances[at][:, 3:, 3:], axis1=1, axis2=2).mean()) / 3)
    return float(np.mean(place)), float(np.mean(turn))


def _placed(window: Window, found: SensedPoses, body: np.ndarray) -> Window:
    """The window with virtual markers, from its first known pose to its last."""
    known = np.flatnonzero(found.known)
    markers = found.positions[:, None] + np.einsum("nij,mj->nmi", found.rotations, body)
    return replace(window, markers=markers, equilibrium=None).of_rows(slice(known[0], known[-1] + 1))
