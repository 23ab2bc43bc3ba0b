"""Where a robot can rest: places below its anchors, and the equilibrium at a place, for any number of cables.

`Workspace.place` turns numbers in [−1, 1] into places; `rest_near` finds the equilibrium there; `displaced` is the pose
from which the platform is let go. Used to draw plans and to judge robot files.
"""

import numpy as np

from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Pose, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.equilibria import equilibrium_at, pose_from_lengths
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import marker_selector
from fidim_lab.model.statics import Equilibrium, balance

STRETCH = 1e-6
"""m of cable by which a displaced pose may miss the held lengths"""
HAND_STIFFNESS = 1e6
"""N/m for each kg, with which a hand holds the marker aside: it misses by some micrometres"""
ADVANCE = 0.02
"""m by which the hand moves between two solutions"""
MOST_NEWTON = 20
CLOSED = 1e-9
"""m and rad: the last Newton step to a held pose"""
DEEPEST_LEVER = 3.0
"""attachments that lie far above the marker need room under the anchors: so many times their height"""


class Workspace:
    """The room under a robot's anchors, for the main marker; world frame, m."""

    def __init__(self, robot: Robot) -> None:
        anchors = np.array([cable.d for cable in robot.cables])
        attachments = np.array([cable.a for cable in robot.cables])
        self._down = robot.gravity / np.linalg.norm(robot.gravity)
        self._middle = anchors.mean(axis=0)
        self._half = np.maximum(np.ptp(anchors, axis=0) / 2.0, 0.05)
        height = float(np.abs((attachments.mean(axis=0) - robot.marker) @ self._down))
        self.scale = max(float(np.linalg.norm(self._half)), DEEPEST_LEVER * height)
        """m: depths are counted in it"""

    def place(self, aside: Vector3, depth: float) -> Vector3:
        """The place `depth` scales under the middle of the anchors, `aside` (−1…1 in their box) from there."""
        sideways = aside * self._half
        sideways -= self._down * (sideways @ self._down)
        return self._middle + sideways + depth * self.scale * self._down


def rest_near(mechanism: Mechanism, place: Vector3, *, hung: bool = False) -> Equilibrium:
    """The nominal body's equilibrium with its marker at a place, m.

    With one or two cables the platform cannot rest at any place: there, with the lengths that the upright platform
    would need at the place. So with more of them if it is hung: three nearly parallel cords reach few places, all of
    them far below. Raises InfeasibleError without such a rest.
    """
    robot = mechanism.robot
    if robot.n > 2 and not hung:
        return equilibrium_at(mechanism, robot.nominal, place)
    upright = Pose(place - robot.marker, np.eye(3))
    lengths = mechanism.lengths(upright.position[np.newaxis], upright.rotation[np.newaxis])[0]
    return pose_from_lengths(mechanism, robot.nominal, lengths)


def displaced(mechanism: Mechanism, rest: Equilibrium, displacement: np.ndarray) -> Pose:
    """Where the platform is when a hand holds its main marker `displacement` (x, y; m) aside, cables at their lengths.

    The rest under gravity and a stiff spring at the marker: unique for any number of freedoms. With a single freedom
    the spring acts along the displacement alone; sideways the marker goes where the cables lead it. Raises
    InfeasibleError where no such pose is found.
    """
    size = float(np.linalg.norm(displacement))
    if size == 0:
        return rest.pose
    grip = np.eye(2) if mechanism.freedoms > 1 else displacement[np.newaxis] / size
    steps = int(np.ceil(size / ADVANCE))
    pose, held = rest.pose, rest.tensions
    start = rest.marker_position(mechanism.robot.marker)[:2]
    for part in np.arange(1, steps + 1) / steps:
        pose, held = _held(mechanism, rest, grip, start + part * displacement, pose, held)
    return pose


def _held(
    mechanism: Mechanism, rest: Equilibrium, grip: np.ndarray, target: np.ndarray, pose: Pose, held: np.ndarray
) -> tuple[Pose, np.ndarray]:
    """Newton's method on the stationary Lagrangian V/m + τᵀ(l − l₀)/m + k/2 |grip (marker − target)|²."""
    robot, n = mechanism.robot, mechanism.n
    for _ in range(MOST_NEWTON):
        gradient, hessian, xi, lengths = balance(mechanism, robot.nominal, pose, held)
        rows = grip @ marker_selector(pose.rotation[np.newaxis], robot.marker, (0, 1))[0]
        miss = grip @ ((pose.position + pose.rotation @ robot.marker)[:2] - target)
        residual = np.concatenate([gradient + HAND_STIFFNESS * rows.T @ miss, lengths - rest.lengths])
        if not np.isfinite(residual).all():
            break
        system = np.block([[hessian + HAND_STIFFNESS * rows.T @ rows, xi.T], [xi, np.zeros((n, n))]])
        step = np.linalg.lstsq(system, -residual, rcond=1e-12)[0]
        pose = Pose(pose.position + step[:3], rotation_matrix(step[3:6] / 2) @ pose.rotation)
        held = held + step[6:]
        if np.abs(step[:6]).max() < CLOSED and np.abs(residual[6:]).max() < STRETCH:
            return pose, held
    x, y = target
    raise InfeasibleError(f"The platform cannot be held with its marker at x = {x:.3f}, y = {y:.3f} m by these cables.")
