"""Where a window rests and where it is released, as functions of the unknowns z = [l; Δζ_f] of each window.

The rest follows from the lengths (static equilibrium), the start from lengths and displaced marker (Eq. 44). Both have
exact derivatives by the implicit function theorem. Poses change by [δp; δφ], R → R exp([δφ]×).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import marker_selector
from fidim_lab.model.statics import balance

NEWTON = 12
CLOSED = 1e-10
"""m, rad: the last Newton step to a rest"""
FARTHEST = 0.3
"""m, rad: a rest farther than that from the last one known is another branch"""


Neighbour = tuple[Pose, Float[np.ndarray, " n"]]
"""a rest and its tensions, N/kg"""


@dataclass(frozen=True, eq=False)
class ReleasedWindow:
    """One window at rest and let go."""

    rest: Pose
    held: Float[np.ndarray, " n"]
    """tensions at rest per unit mass, N/kg"""
    start: Pose
    rest_by: Float[np.ndarray, "6+n z"]
    """derivative of the rest, [world twist; tensions per unit mass]"""
    marker_by: Float[np.ndarray, "free z"]
    """derivative of the marker's free coordinates at rest"""
    start_by: Float[np.ndarray, "6 z"]
    """derivative of the start, [δp; δφ]"""

    @property
    def resting(self) -> Neighbour:
        """From where a neighbour's rest is found."""
        return self.rest, self.held

    def marker_at(self, marker: Vector3) -> tuple[Vector3, Float[np.ndarray, "2"]]:
        """Where a marker (m, of the platform) rests, and how far it is displaced along x and y, as plans have it.

        With one free coordinate the other follows; with more the rest do.
        """
        there = self.rest.position + self.rest.rotation @ marker
        return there, (self.start.position + self.start.rotation @ marker - there)[:2]


def rest_beside(mechanism: Mechanism, task: DesignTask, lengths: Float[np.ndarray, " n"], near: Neighbour) -> Neighbour:
    """The stable rest at these lengths (m) on the branch of a neighbour; cheap beside a search from anywhere.

    Raises InfeasibleError where Newton's method does not get there, or a cable would have to push.
    """
    found = _newton(mechanism, task, lengths, *near)
    if found is None:
        raise InfeasibleError("The platform finds no rest near this one.")
    pose, held = _taut(*found)
    _, hessian, xi, _ = balance(mechanism, task.robot.nominal, pose, held)
    free = np.linalg.svd(xi)[2][len(xi) :]
    if np.linalg.eigvalsh(free @ hessian @ free.T).min() <= 0:
        raise InfeasibleError("The rest near this one is unstable.")
    return pose, held


def place(
    mechanism: Mechanism, task: DesignTask, z: Float[np.ndarray, " z"], near: Neighbour | None = None
) -> ReleasedWindow:
    """Rest and start of one window; `near`: rest and tensions of a neighbour, from which Newton's method starts.

    Raises InfeasibleError where it cannot rest with taut cables, or not be displaced so.
    """
    n = task.robot.n
    lengths, displacement = z[:n], z[n:]
    rest, held = _rest(mechanism, task, lengths, near)
    marker, axes = task.robot.marker, task.axes
    at_rest = (rest.position + rest.rotation @ marker)[list(axes)]
    positions, rotations = dependent_pose(mechanism, lengths, marker, axes, (at_rest + displacement)[np.newaxis], rest)
    start = Pose(positions[0], rotations[0])
    rest_by = _rest_by(mechanism, task, rest, held)
    marker_by = _selector(task, rest) @ rest_by[:6]
    lengths_by = np.hstack([np.eye(n), np.zeros((n, len(axes)))])
    wanted = marker_by + np.hstack([np.zeros((len(axes), n)), np.eye(len(axes))])
    xi = mechanism.structure_matrix(start.position[np.newaxis], start.rotation[np.newaxis])[0]
    twist_by = np.linalg.solve(np.vstack([_selector(task, start), xi]), np.vstack([wanted, lengths_by]))
    start_by = np.vstack([twist_by[:3], start.rotation.T @ twist_by[3:]])
    return ReleasedWindow(rest, held, start, rest_by, marker_by, start_by)


def _rest(
    mechanism: Mechanism, task: DesignTask, lengths: np.ndarray, near: Neighbour | None
) -> tuple[Pose, Float[np.ndarray, " n"]]:
    """Newton's method from a neighbour, else downhill from anywhere."""
    found = None if near is None else _newton(mechanism, task, lengths, *near)
    if found is not None:
        return _taut(*found)
    rest = pose_from_lengths(mechanism, task.robot.nominal, lengths, None if near is None else near[0])
    return rest.pose, rest.tensions


def _newton(
    mechanism: Mechanism, task: DesignTask, lengths: np.ndarray, pose: Pose, held: np.ndarray
) -> tuple[Pose, Float[np.ndarray, " n"]] | None:
    """Newton's method on the stationary Lagrangian; None where it strays."""
    for _ in range(NEWTON):
        gradient, hessian, xi, actual = balance(mechanism, task.robot.nominal, pose, held)
        step = _solve(hessian, xi, -np.concatenate([gradient, actual - lengths]))
        if not np.isfinite(step).all() or np.abs(step[:6]).max() > FARTHEST:
            return None
        pose, held = _moved(pose, step[:6]), held + step[6:]
        if np.abs(step[:6]).max() < CLOSED:
            return pose, held
    return None


def _taut(pose: Pose, held: np.ndarray) -> tuple[Pose, np.ndarray]:
    if held.min() <= 0:
        raise InfeasibleError(f"Cable {int(np.argmin(held)) + 1} would have to push at rest.")
    return pose, held


def _rest_by(mechanism: Mechanism, task: DesignTask, rest: Pose, held: np.ndarray) -> Float[np.ndarray, "6+n z"]:
    """Derivative of the rest."""
    n = task.robot.n
    _, hessian, xi, _ = balance(mechanism, task.robot.nominal, rest, held)
    by_lengths = _solve(hessian, xi, np.vstack([np.zeros((6, n)), np.eye(n)]))
    return np.hstack([by_lengths, np.zeros((6 + n, len(task.axes)))])


def _solve(hessian: np.ndarray, xi: np.ndarray, right: np.ndarray) -> np.ndarray:
    n = len(xi)
    system = np.zeros((6 + n, 6 + n))
    system[:6, :6], system[:6, 6:], system[6:, :6] = hessian, xi.T, xi
    try:
        return np.linalg.solve(system, right)
    except np.linalg.LinAlgError as error:
        raise InfeasibleError("The platform rests nowhere near: a freedom is neutral.") from error


def _moved(pose: Pose, twist: Float[np.ndarray, "6"]) -> Pose:
    # Rodrigues' vector of half the step: a rotation matrix to rounding, and Newton converges all the same
    g = twist[3:] / 2
    cross = np.array([[0.0, -g[2], g[1]], [g[2], 0.0, -g[0]], [-g[1], g[0], 0.0]])
    turn = np.linalg.solve(np.eye(3) - cross, np.eye(3) + cross)
    return Pose(pose.position + twist[:3], turn @ pose.rotation)


def _selector(task: DesignTask, pose: Pose) -> Float[np.ndarray, "free 6"]:
    return marker_selector(pose.rotation[np.newaxis], task.robot.marker, task.axes)[0]
