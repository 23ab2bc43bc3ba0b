"""A few poses of a campaign, fitted to markers, lengths and an upright platform: whether files and recording agree."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.records import Robot, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.many_robots import ManyRobots
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
    mechanism: Mechanism,
    lengths: np.ndarray,
    markers: np.ndarray,
    near: Rotations | None = None,
    body: Float[np.ndarray, "M 3"] | None = None,
) -> tuple[Positions, Rotations]:
    """The best poses near these orientations, upright ones unless given; body: of the markers, unless the robot's.

    Raises InfeasibleError or LinAlgError where the model has none.
    """
    body = mechanism.robot.markers[: markers.shape[1]] if body is None else body
    looked = _Looked.near(lengths, markers, body, near)
    p, turned = looked.begin()
    for _ in range(DATA_CHECKS.robot_mistakes_rounds):
        made = mechanism.lengths(p, turned), mechanism.structure_matrix(p, turned)
        p, turned = looked.moved(looked.step(*made, p, turned), p, turned)
    return p, turned


def misfit(mechanism: Mechanism, lengths: np.ndarray, markers: np.ndarray, near: Rotations | None = None) -> float:
    """Median over the poses of the rms misfit of markers and lengths, m; inf where there are no poses."""
    looked = _Looked.near(lengths, markers, mechanism.robot.markers[: markers.shape[1]], near)
    try:
        p, R = fit_poses(mechanism, lengths, markers, near)
        each = looked.misses(mechanism.lengths(p, R), p, R)
    except (FidimError, np.linalg.LinAlgError):
        return np.inf
    return _median(each)


def misfits(
    robots: Sequence[Robot], lengths: Float[np.ndarray, "C S n"], markers: Float[np.ndarray, "C S M 3"]
) -> Float[np.ndarray, " C"]:
    """`misfit` of many robots that are `alike`, each with lengths and markers of its own, near upright poses."""
    try:
        return _together(robots, lengths, markers)
    except np.linalg.LinAlgError:  # says not of which
        each = zip(robots, lengths, markers, strict=True)
        return np.array([misfit(Mechanism(robot), held, seen) for robot, held, seen in each])


def _together(robots: Sequence[Robot], lengths: np.ndarray, markers: np.ndarray) -> np.ndarray:
    count, poses, several = markers.shape[:3]
    body = np.repeat([robot.markers[:several] for robot in robots], poses, axis=0)
    looked = _Looked.near(lengths.reshape(count * poses, -1), markers.reshape(body.shape), body, None)
    every, (p, turned) = ManyRobots(robots, poses), looked.begin()
    lost = np.zeros(len(body), dtype=bool)
    with np.errstate(all="ignore"):
        for _ in range(DATA_CHECKS.robot_mistakes_rounds):
            held, structure, singular = every.at(p, turned)
            lost |= singular
            held[lost], structure[lost] = 0.0, 0.0
            step = looked.step(held, structure, p, turned)
            lost |= ~np.isfinite(step).all(axis=1)
            p, turned = looked.moved(np.where(lost[:, np.newaxis], 0.0, step), p, turned)
        held, _, singular = every.at(p, turned)
        each = looked.misses(held, p, turned)
    each[lost | singular] = np.inf
    return np.array([_median(one) for one in each.reshape(count, poses)])


def _median(each: np.ndarray) -> float:
    return float(np.median(each)) if np.isfinite(each).all() else np.inf


@dataclass(frozen=True, eq=False)
class _Looked:
    """What poses are fitted to: lengths, markers, and orientations near which the platform is thought to be."""

    lengths: Float[np.ndarray, "N n"]
    markers: Float[np.ndarray, "N M 3"]
    body: Float[np.ndarray, "N M 3"]
    orientations: Rotations
    upright: bool
    """whether these are the identity"""

    @staticmethod
    def near(lengths: np.ndarray, markers: np.ndarray, body: np.ndarray, near: Rotations | None) -> "_Looked":
        """Upright unless given; body: of each pose, or the same of all."""
        orientations = np.tile(np.eye(3), (len(markers), 1, 1)) if near is None else near
        return _Looked(lengths, markers, np.broadcast_to(body, markers.shape), orientations, near is None)

    def begin(self) -> tuple[Positions, Rotations]:
        """As they are thought to be turned, the markers in the middle of their places."""
        return (self.markers - self._arms(self.orientations)).mean(axis=1), self.orientations

    @staticmethod
    def moved(step: np.ndarray, p: Positions, R: Rotations) -> tuple[Positions, Rotations]:
        """After a step."""
        return p + step[:, :3], Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R

    def misses(self, held: np.ndarray, p: Positions, R: Rotations) -> np.ndarray:
        """rms of markers and lengths of each pose, m; more where it leans farther than a platform does."""
        left = np.concatenate([self._off(p, R), self.lengths - held], axis=1)
        lean = np.linalg.norm(self._leaning(R), axis=1)
        return np.sqrt((left**2).sum(axis=1) / max(1, left.shape[1] - 6)) + 0.01 * np.maximum(
            0.0, lean - 2 * DATA_CHECKS.robot_mistakes_upright
        )

    def step(self, held: np.ndarray, structure: np.ndarray, p: Positions, R: Rotations) -> np.ndarray:
        """One Gauss–Newton step of all poses, (N, 6), from what the cables are there."""
        prior = np.zeros((len(p), 3, 6))
        prior[:, :, 3:] = np.eye(3)
        rows = np.concatenate(
            [
                surface.jacobian_of_arms(self._arms(R)) / DATA_CHECKS.robot_mistakes_close,
                structure / DATA_CHECKS.robot_mistakes_close,
                prior / DATA_CHECKS.robot_mistakes_upright,
            ],
            axis=1,
        )
        right = np.concatenate(
            [
                self._off(p, R) / DATA_CHECKS.robot_mistakes_close,
                (self.lengths - held) / DATA_CHECKS.robot_mistakes_close,
                -self._leaning(R) / DATA_CHECKS.robot_mistakes_upright,
            ],
            axis=1,
        )
        across = np.swapaxes(rows, 1, 2)
        step = np.linalg.solve(across @ rows, (across @ right[..., np.newaxis]))[..., 0]
        size = np.abs(step).max(axis=1, keepdims=True)
        return step * np.minimum(1.0, DATA_CHECKS.robot_mistakes_longest / np.maximum(size, 1e-300))

    def _arms(self, R: Rotations) -> np.ndarray:
        return np.einsum("nij,nmj->nmi", R, self.body)

    def _off(self, p: Positions, R: Rotations) -> np.ndarray:
        return (self.markers - p[:, np.newaxis] - self._arms(R)).reshape(len(p), -1)

    def _leaning(self, R: Rotations) -> np.ndarray:
        """Rotation vectors from the orientations near which the platform is thought to be, rad."""
        return Rotation.from_matrix(R if self.upright else R @ np.swapaxes(self.orientations, 1, 2)).as_rotvec()
