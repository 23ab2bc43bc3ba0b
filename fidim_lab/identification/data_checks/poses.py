"""A few poses of a campaign, fitted to markers, lengths and an upright platform: whether files and recording agree."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.records import Robot, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.motion import surface
from fidim_lab.model.mechanism import Mechanism

MOSTLY = 0.5
"""of all samples: at an instant that shows few markers the others would be left out with them"""


@dataclass(frozen=True, eq=False)
class PoseSamples:
    """Markers at some instants (m), with the lengths that are held then (m)."""

    robot: Robot
    """with these markers alone"""
    numbers: tuple[int, ...]
    """which of the robot file's markers they are, from 0"""
    markers: Float[np.ndarray, "S M 3"]
    lengths: Float[np.ndarray, "S n"]

    def with_markers(self, robot: Robot, body: Float[np.ndarray, "M 3"]) -> Robot:
        """The robot file's robot with these markers elsewhere on the body (m), the others where they are."""
        every = robot.markers
        every[list(self.numbers)] = body
        return replace(robot, marker=every[0], extra_markers=tuple(every[1:]))


def sampled(
    robot: Robot,
    windows: tuple[Window, ...],
    *,
    each: int = DATA_CHECKS.robot_mistakes_samples,
    most_windows: int = DATA_CHECKS.robot_mistakes_windows,
) -> PoseSamples | None:
    """Markers at so many places of each of so many windows; None without lengths or markers.

    Markers that are seen in less than half of all samples are left out.
    """
    numbers = _seen(windows)
    if not numbers:
        return None
    markers, lengths = [], []
    for window in windows[:: max(1, len(windows) // most_windows)]:
        if window.lengths is None or not np.isfinite(window.lengths).any(axis=0).all():
            continue
        held = np.nanmean(window.lengths, axis=0)
        columns = even_grid(window.t).spread(window.markers[:, numbers].reshape(len(window.t), -1))
        rows = np.flatnonzero(np.isfinite(columns).all(axis=1))
        if len(rows) < each:
            continue
        for row in rows[np.linspace(0, len(rows) - 1, each + 2).astype(int)[1:-1]]:
            markers.append(columns[row].reshape(-1, 3))
            lengths.append(held)
    if not markers or len(lengths[0]) != robot.n:
        return None
    marker, *further = robot.markers[numbers]
    alone = replace(robot, marker=marker, extra_markers=tuple(further))
    return PoseSamples(alone, tuple(numbers), np.array(markers), np.array(lengths))


def _seen(windows: tuple[Window, ...]) -> list[int]:
    """Numbers of the markers that are there in more than half of all samples."""
    most = min((w.markers.shape[1] for w in windows), default=0)
    seen = [np.isfinite(w.markers[:, :most]).all(axis=2) for w in windows]
    return np.flatnonzero(np.concatenate(seen).mean(axis=0) > MOSTLY).tolist() if most else []


def fit_poses(
    mechanism: Mechanism, lengths: np.ndarray, markers: np.ndarray, near: Rotations | None = None
) -> tuple[Positions, Rotations]:
    """The best poses near these orientations, upright ones unless given.

    Raises InfeasibleError or LinAlgError where the model has none.
    """
    body = mechanism.robot.markers[: markers.shape[1]]
    near = np.tile(np.eye(3), (len(markers), 1, 1)) if near is None else near
    turned = near
    p = (markers - np.einsum("nij,mj->nmi", near, body)).mean(axis=1)
    for _ in range(DATA_CHECKS.robot_mistakes_rounds):
        step = _step(mechanism, lengths, markers, body, p, turned, near)
        p = p + step[:, :3]
        turned = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ turned
    return p, turned


def misfit(mechanism: Mechanism, lengths: np.ndarray, markers: np.ndarray, near: Rotations | None = None) -> float:
    """Median over the poses of the rms misfit of markers and lengths, m; inf where there are no poses."""
    try:
        p, R = fit_poses(mechanism, lengths, markers, near)
        body = mechanism.robot.markers[: markers.shape[1]]
        left = np.concatenate([_off(markers, body, p, R), lengths - mechanism.lengths(p, R)], axis=1)
    except (FidimError, np.linalg.LinAlgError):
        return np.inf
    lean = np.linalg.norm(_leaning(R, near), axis=1)
    each = np.sqrt((left**2).sum(axis=1) / max(1, left.shape[1] - 6)) + 0.01 * np.maximum(
        0.0, lean - 2 * DATA_CHECKS.robot_mistakes_upright
    )
    return float(np.median(each)) if np.isfinite(each).all() else np.inf


def _leaning(R: np.ndarray, near: np.ndarray | None) -> np.ndarray:
    """Rotation vectors from the orientations near which the platform is thought to be, rad."""
    return Rotation.from_matrix(R if near is None else R @ np.swapaxes(near, 1, 2)).as_rotvec()


def _off(markers: np.ndarray, body: np.ndarray, p: np.ndarray, R: np.ndarray) -> np.ndarray:
    return (markers - p[:, np.newaxis] - np.einsum("nij,mj->nmi", R, body)).reshape(len(p), -1)


def _step(
    made: Mechanism,
    lengths: np.ndarray,
    markers: np.ndarray,
    body: np.ndarray,
    p: np.ndarray,
    R: np.ndarray,
    near: np.ndarray,
) -> np.ndarray:
    """One Gauss–Newton step of all poses, (S, 6)."""
    prior = np.zeros((len(p), 3, 6))
    prior[:, :, 3:] = np.eye(3)
    rows = np.concatenate(
        [
            surface.marker_jacobian(R, body) / DATA_CHECKS.robot_mistakes_close,
            made.structure_matrix(p, R) / DATA_CHECKS.robot_mistakes_close,
            prior / DATA_CHECKS.robot_mistakes_upright,
        ],
        axis=1,
    )
    turned = _leaning(R, near)
    right = np.concatenate(
        [
            _off(markers, body, p, R) / DATA_CHECKS.robot_mistakes_close,
            (lengths - made.lengths(p, R)) / DATA_CHECKS.robot_mistakes_close,
            -turned / DATA_CHECKS.robot_mistakes_upright,
        ],
        axis=1,
    )
    across = np.swapaxes(rows, 1, 2)
    step = np.linalg.solve(across @ rows, (across @ right[..., np.newaxis]))[..., 0]
    size = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, DATA_CHECKS.robot_mistakes_longest / np.maximum(size, 1e-300))
