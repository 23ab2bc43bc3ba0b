"""A window predicted from its initial state alone: a test that no regression can pass by chance.

The identified body is let go where the platform was at the window's first usable sample; only that state (λ positions
along the free directions, λ rates) is fitted, first on a short stretch, then on longer ones, so that a wrong frequency
cannot lock in a slipped cycle. What is left is compared with the marker noise: rms and χ²/dof.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import motion_rms
from fidim_lab.data.records import Body, Motion, Pose, Robot
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.identification.motion.measured import MeasuredMotion, held_lengths
from fidim_lab.identification.motion.surface import ARM, free_directions, marker_jacobian, tied_least_squares
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.motion.dynamics import STEP

HORIZONS = ((1.0, np.inf), (0.5, 1.5, 4.0, np.inf))
"""s; the initial state is fitted on ever longer stretches: in two strides, and where that loses the phase in four"""
COARSE = 0.01
"""s; integration step for derivatives alone: off by up to 0.07 mm after 10 s, where 5 ms is off by 1 µm"""
NUDGES = (1e-4, 1e-3)
"""m and m/s of the finite differences"""
ROUNDS = 4
"""Gauss–Newton steps on each stretch, at most"""
SETTLED = 1e-3
"""share of the squares below which another step is not worth a simulation"""
LENGTH_TOLERANCE = 1e-11
"""m"""
LOST = 0.7
"""of the motion's own rms: an error beyond is a slipped phase, not a fit"""


@dataclass(frozen=True, eq=False)
class Prediction:
    """How well one window is predicted from its fitted initial state."""

    rms: float
    """m, over all marker coordinates"""
    chi2_per_dof: float
    """against the marker noise of the robot file"""
    residuals: np.ndarray
    """(N, M, 3) measured − predicted, m; NaN where nothing was measured"""
    t: np.ndarray
    """(N,) s, from the window's first usable sample to its end"""
    markers: np.ndarray
    """(N, M, 3) predicted, m"""
    motion: Motion
    """predicted, at the same times"""


@dataclass(frozen=True, eq=False)
class _Start:
    """The surface of initial states around the measured one."""

    mechanism: Mechanism
    lengths: np.ndarray
    pose: Pose
    twist: np.ndarray
    directions: np.ndarray
    """(6, λ)"""

    def state(self, x: np.ndarray) -> tuple[Pose, np.ndarray]:
        """Pose and twist for x = [λ displacements; λ rates], both obeying the held lengths."""
        free = self.directions.shape[1]
        pose = to_surface(self.mechanism, self.lengths, _moved(self.pose, self.directions @ x[:free]))
        twist = self.twist + self.directions @ x[free:]
        xi = self.mechanism.structure_matrix(pose.position[None], pose.rotation[None])
        return pose, _nearest(xi, -xi @ twist, twist)


def predict(mechanism: Mechanism, body: Body, measured: MeasuredMotion) -> Prediction | None:
    """Fit the initial state and compare; None where that fails (no lengths, a slack cable, a lost phase)."""
    window, robot = measured.window, mechanism.robot
    if window.lengths is None:
        return None
    begin = measured.motion.t[0] - 1e-9
    rows = np.flatnonzero(window.t >= begin)
    t, markers = window.t[rows], window.markers[rows]
    try:
        start = _start(mechanism, measured)
    except (InfeasibleError, SetupError):
        return None
    for horizons in HORIZONS:
        found = _grow(start, robot, body, t, markers, horizons)
        verdict = None if found is None else _judge(robot, markers, found, 2 * start.directions.shape[1])
        if verdict is not None:
            return verdict
    return None


def _grow(
    start: _Start, robot: Robot, body: Body, t: np.ndarray, markers: np.ndarray, horizons: tuple[float, ...]
) -> Motion | None:
    """The predicted motion after fitting on growing horizons; None where the physics ends."""
    x = np.zeros(2 * start.directions.shape[1])
    found = None
    try:
        for horizon in horizons:
            use = t - t[0] <= horizon
            x, found = _fit(start, robot, body, t[use], markers[use], x)
    except InfeasibleError:
        return None
    return found


def _judge(robot: Robot, markers: np.ndarray, motion: Motion, fitted: int) -> Prediction | None:
    predicted = _seen(robot, motion, markers.shape[1])
    residuals = markers - predicted
    rms = float(np.sqrt(np.nanmean(residuals**2)))
    if not rms < LOST * motion_rms(markers):
        return None
    dof = int(np.isfinite(residuals).sum()) - fitted
    chi2 = float(np.nansum((residuals / robot.sensors.marker_noise) ** 2)) / dof
    return Prediction(rms, chi2, residuals, motion.t, predicted, motion)


def _start(mechanism: Mechanism, measured: MeasuredMotion) -> _Start:
    motion, lengths = measured.motion, held_lengths(measured.window)
    pose = to_surface(mechanism, lengths, Pose(motion.positions[0], motion.rotations[0]))
    xi = mechanism.structure_matrix(pose.position[None], pose.rotation[None])
    N = free_directions(xi)
    # Metres of marker motion as unknowns: the singular vectors of J N make them comparable.
    J = marker_jacobian(pose.rotation[None], mechanism.robot.markers[: measured.window.markers.shape[1]])
    _, s, Vt = np.linalg.svd((J @ N)[0], full_matrices=False)
    directions = N[0] @ (Vt.T / np.maximum(s, 1e-2 * s[0]))
    twist = _nearest(xi, -xi @ motion.twists[0], motion.twists[0])
    return _Start(mechanism, lengths, pose, twist, directions)


def _fit(
    start: _Start, robot: Robot, body: Body, t: np.ndarray, markers: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, Motion]:
    """Gauss–Newton with one finite-difference Jacobian: near the solution it hardly changes. Also the prediction."""
    count = markers.shape[1]
    seen = np.isfinite(markers)
    coarse = _seen(robot, _simulate(start, body, t, x, COARSE), count)
    nudges = np.repeat(NUDGES, len(x) // 2)
    nudged = [_seen(robot, _simulate(start, body, t, x + step, COARSE), count) for step in np.diag(nudges)]
    J = np.stack([(there - coarse)[seen] for there in nudged], axis=1) / nudges
    found = _simulate(start, body, t, x)
    best = _seen(robot, found, count)
    cost = float(((markers - best)[seen] ** 2).sum())
    for _ in range(ROUNDS):
        trial = x + np.linalg.lstsq(J, (markers - best)[seen], rcond=None)[0]
        tried = _simulate(start, body, t, trial)
        there = _seen(robot, tried, count)
        now = float(((markers - there)[seen] ** 2).sum())
        if not now < cost:
            break
        settled = now > cost * (1 - SETTLED)
        x, found, best, cost = trial, tried, there, now
        if settled:
            break
    return x, found


def _simulate(start: _Start, body: Body, t: np.ndarray, x: np.ndarray, step: float = STEP) -> Motion:
    """The free motion. Raises InfeasibleError when a cable goes slack before the end."""
    pose, twist = start.state(x)
    found = simulate_free_motion(start.mechanism, body, pose, twist, t, step)
    if found.slack_time is not None:
        raise InfeasibleError(f"Cable {found.slack_cable} goes slack at t = {found.slack_time:.2f} s.")
    return found.motion


def _seen(robot: Robot, motion: Motion, count: int) -> np.ndarray:
    """(N, M, 3) positions of the first `count` markers, m."""
    return motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, robot.markers[:count])


def to_surface(mechanism: Mechanism, lengths: np.ndarray, pose: Pose) -> Pose:
    """The nearest pose with these lengths (m), by Newton steps that move least; rotations count 0.2 m per radian.

    Raises InfeasibleError when it is not reached.
    """
    off = np.inf
    for _ in range(20):
        p, R = pose.position[None], pose.rotation[None]
        short = lengths - mechanism.lengths(p, R)
        off = float(np.abs(short).max())
        if off < LENGTH_TOLERANCE:
            return pose
        pose = _moved(pose, _nearest(mechanism.structure_matrix(p, R), short, np.zeros(6)))
    raise InfeasibleError(f"No pose near the measured one has the held lengths (off by {off:.1e} m).")


def _nearest(xi: np.ndarray, exact: np.ndarray, target: np.ndarray) -> np.ndarray:
    """target + the least correction y with Ξ y = exact; xi (1, n, 6)."""
    scale = np.diag([1.0, 1.0, 1.0, ARM, ARM, ARM])[None]
    return target + tied_least_squares(scale, xi, np.zeros((1, 6)), exact.reshape(1, -1))[0]


def _moved(pose: Pose, step: np.ndarray) -> Pose:
    return Pose(pose.position + step[:3], Rotation.from_rotvec(step[3:]).as_matrix() @ pose.rotation)
