"""Redundant channels: do they contradict the kinematics, without any dynamics?

    markers-lengths    markers off the surface of poses that the held lengths allow (z against x, y, lengths)
    rigid-markers      distances between markers
    pose-lengths       cable lengths of the pose that three markers give, against the encoders
    currents-statics   what the motor currents lift on average, against the weight

What enters as a force leaves the first three at their noise; what enters as geometry or stretch does not. Noise is
taken down by local smoothing first (to about a half), with samples `redundancy_every` seconds apart that are then
independent.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import CableSeries, Series
from fidim_lab.data.records import Campaign, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.neighbours import half_width, look
from fidim_lab.identification.motion import rigid, surface
from fidim_lab.identification.motion.measured import held_lengths, rest_pose
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True)
class Redundancy:
    """One comparison of channels."""

    name: str
    contradicts: bool
    rms: float
    """of the difference, in `unit`"""
    expected: float
    """what noise and resolution alone give"""
    unit: str
    windows: tuple[tuple[str, float], ...]
    """rms of each window that could be compared"""
    says: str

    @property
    def ratio(self) -> float:
        """How many times the noise."""
        return self.rms / self.expected if self.expected > 0 else float("inf")


@dataclass(frozen=True, eq=False)
class PosedMarkers:
    """Smoothed markers of one window with the poses on the surface of its held lengths."""

    window: Window
    lengths: np.ndarray
    t: Series
    markers: Float[np.ndarray, "S M 3"]
    noise: Float[np.ndarray, "S M 3"]
    """standard deviation of the smoothed markers, m"""
    poses: surface.SurfacePoses
    jacobian: Float[np.ndarray, "S K 6"]
    structure: Float[np.ndarray, "S n 6"]
    good: Bool[np.ndarray, " S"]


def pose_window(mechanism: Mechanism, window: Window, sigma: Float[np.ndarray, "M 3"]) -> PosedMarkers | str:
    """Poses of one window; a sentence where they cannot be had."""
    try:
        lengths = held_lengths(window)
        t, markers, noise = smoothed(window, sigma)
        if len(t) < DATA_CHECKS.redundancy_fewest:
            needed = DATA_CHECKS.redundancy_fewest
            return f"Window {window.id}: {len(t)} samples have whole neighbourhoods, {needed} are needed."
        body_markers = mechanism.robot.markers[: markers.shape[1]]
        poses = surface.poses(mechanism, lengths, body_markers, markers, rest_pose(mechanism, window))
        jacobian = surface.marker_jacobian(poses.rotations, body_markers)
        structure = mechanism.structure_matrix(poses.positions, poses.rotations)
        good = poses.settled & (surface.conditioning(structure, jacobian) < DATA_CHECKS.worst_condition)
        return PosedMarkers(window, lengths, t, markers, noise, poses, jacobian, structure, good)
    except (FidimError, np.linalg.LinAlgError) as error:
        return f"Window {window.id}: {error}"


def smoothed(
    window: Window, sigma: Float[np.ndarray, "M 3"]
) -> tuple[Series, Float[np.ndarray, "S M 3"], Float[np.ndarray, "S M 3"]]:
    """Times, markers and their noise (m) every `redundancy_every` seconds, where all markers have their neighbours."""
    grid = even_grid(window.t)
    columns = grid.spread(window.markers.reshape(len(window.t), -1))
    half = half_width(1 / grid.step)
    local = look(columns, half)
    every = max(1, round(DATA_CHECKS.redundancy_every / grid.step))
    rows = np.arange(half, len(columns) - half, every)
    rows = rows[np.isfinite(local.value_norm[rows]).all(axis=1)]
    shape = (len(rows), window.markers.shape[1], 3)
    noise = local.value_norm[rows].reshape(shape) * sigma[: window.markers.shape[1]]
    return window.t[0] + rows * grid.step, local.value[rows].reshape(shape), noise


def markers_against_lengths(mechanism: Mechanism, posed: list[PosedMarkers]) -> Redundancy | None:
    """Distance of the markers from the surface, per coordinate; None where they are not redundant."""
    name, resolution = "markers-lengths", mechanism.robot.sensors.encoder_resolution
    rows = [
        one
        for one in posed
        if one.good.sum() >= DATA_CHECKS.redundancy_fewest and one.jacobian.shape[1] > mechanism.freedoms
    ]
    if not rows:
        return None
    found, expected = [], []
    for one in rows:
        good, count = one.good, one.jacobian.shape[1]
        found.append(float(np.mean(one.poses.misfit[good] ** 2)))
        noise = float(np.mean(one.noise[good] ** 2)) * (count - mechanism.freedoms) / count
        expected.append(noise + resolution**2 * _by_lengths(one))
    return _compared(
        name, rows, found, expected, "the distance between the markers and the poses that the cable lengths allow is"
    )


def _by_lengths(one: PosedMarkers) -> float:
    """Mean square of ∂(marker coordinate)/∂(length) left after the pose has followed, summed over the cables."""
    J, xi = one.jacobian[one.good], one.structure[one.good]
    nothing, total = np.zeros(J.shape[:2]), 0.0
    for unit in np.eye(xi.shape[1]):
        step = surface.tied_least_squares(J, xi, nothing, np.broadcast_to(unit, (len(J), len(unit))))
        total += float(np.mean(np.einsum("nki,ni->nk", J, step) ** 2))
    return total


def rigid_markers(campaign: Campaign, windows: list[tuple[Window, np.ndarray, np.ndarray]]) -> Redundancy | None:
    """Distances between markers against the robot file; `windows` with smoothed markers and their noise."""
    rows, found, expected = [], [], []
    for window, markers, noise in windows:
        count = markers.shape[1]
        if count < 2 or len(markers) < DATA_CHECKS.redundancy_fewest:
            continue
        rows.append(window)
        found.append(float(np.mean(rigid.distances_off(markers, campaign.robot.markers[:count]) ** 2)))
        expected.append(2 * float(np.mean(noise**2)))
    if not rows:
        return None
    return _compared(
        "rigid-markers", rows, found, expected, "the difference of marker distances from the robot file is"
    )


def pose_against_lengths(mechanism: Mechanism, posed: list[PosedMarkers]) -> Redundancy | None:
    """Cable lengths of the pose from the markers alone, against the encoders; None with fewer than three markers."""
    rows, found, expected = [], [], []
    for one in posed:
        body_markers = mechanism.robot.markers[: one.markers.shape[1]]
        if rigid.spread(body_markers) < rigid.MIN_SPREAD:
            continue
        p, R, _ = rigid.register(one.markers, body_markers, np.ones(one.markers.shape[:2]))
        J = surface.marker_jacobian(R, body_markers)
        xi = mechanism.structure_matrix(p, R)
        spread = xi @ np.linalg.solve(np.swapaxes(J, 1, 2) @ J, np.swapaxes(xi, 1, 2))
        noise = float(np.mean(one.noise**2) * np.mean(np.einsum("nii->ni", spread)))
        rows.append(one)
        found.append(float(np.mean((mechanism.lengths(p, R) - one.lengths) ** 2)))
        expected.append(noise + mechanism.robot.sensors.encoder_resolution**2)
    if not rows:
        return None
    return _compared(
        "pose-lengths", rows, found, expected, "the difference between cable lengths by markers and by encoders is"
    )


def currents_against_statics(mechanism: Mechanism, posed: list[PosedMarkers]) -> Redundancy | None:
    """Mean vertical force by the currents against the weight; None without currents or winches."""
    robot = mechanism.robot
    if robot.winches is None:
        return None
    scale = np.array([winch.newton_per_ampere for winch in robot.winches])
    g = float(np.linalg.norm(robot.gravity))
    lifts: list[tuple[str, float]] = []
    for one in posed:
        tension = _tensions(one, scale)
        if tension is None or one.good.sum() < DATA_CHECKS.redundancy_fewest:
            continue
        up = one.structure[one.good, :, :3] @ robot.gravity / g
        lifts.append((one.window.id, float(np.mean((up * tension[one.good]).sum(axis=1)))))
    if not lifts:
        return None
    weight = robot.mass * g
    away = np.array([lift for _, lift in lifts]) - weight
    mean, rms = float(away.mean()), float(np.sqrt(np.mean(away**2)))
    contradicts = abs(mean) > DATA_CHECKS.redundancy_lift * weight
    verdict = "mass, winch constants or losses are not as the robot file says" if contradicts else "they agree"
    says = (
        f"By the motor currents the cables lift {weight + mean:.1f} N on average, the weight is {weight:.1f} N "
        f"({mean / weight:+.1%}): {verdict}."
    )
    return Redundancy(
        "currents-statics", contradicts, rms, DATA_CHECKS.redundancy_lift * weight, "N", tuple(lifts), says
    )


def _tensions(one: PosedMarkers, scale: np.ndarray) -> CableSeries | None:
    currents = one.window.currents
    if currents is None or not np.isfinite(currents).all():
        return None
    summed = np.vstack([np.zeros(currents.shape[1]), np.cumsum(currents, axis=0)])
    rows = np.searchsorted(one.window.t, one.t)
    first, last = np.maximum(rows - 5, 0), np.minimum(rows + 6, len(currents))
    return (summed[last] - summed[first]) / (last - first)[:, np.newaxis] * scale


def _compared(
    name: str, rows: list[PosedMarkers] | list[Window], found: list[float], expected: list[float], what: str
) -> Redundancy:
    """The figures of all windows as one; what is found and expected are mean squares, m²."""
    rms, noise = float(np.sqrt(np.mean(found))), float(np.sqrt(np.mean(expected)))
    contradicts = rms > DATA_CHECKS.redundancy_contradicts * noise
    ids = [row.id if isinstance(row, Window) else row.window.id for row in rows]
    worst = int(np.argmax(found))
    says = f"In {len(rows)} windows {what} {rms * 1e3:.3g} mm rms, {rms / noise:.1f} times that of noise"
    says += f" (most in {ids[worst]}, {np.sqrt(found[worst]) * 1e3:.3g} mm)" if contradicts else ""
    says += ": the kinematics disagree, whatever the dynamics." if contradicts else ": the kinematics agree."
    windows = tuple((each, float(np.sqrt(value))) for each, value in zip(ids, found, strict=True))
    return Redundancy(name, contradicts, rms, noise, "m", windows, says)
