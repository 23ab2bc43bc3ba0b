"""A capture frame other than the robot frame, or markers elsewhere than in the robot file, by any amount.

`robot_changes` tries what people mix up; here the change itself is fitted (`placement`). The frame begins where the
nominal body would hang with the lengths of each window: windows at one place say nothing of a frame.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Pose, Robot
from fidim_lab.errors import FidimError
from fidim_lab.identification.data_checks.placement import Free, Placement, place
from fidim_lab.identification.data_checks.poses import PoseSamples
from fidim_lab.identification.data_checks.robot_changes import Change
from fidim_lab.identification.markers.finding import marker_name
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

FLAT = 0.02
"""of the largest spread of places, below which they lie on a line and turn no frame"""


def placed(robot: Robot, sample: PoseSamples) -> tuple[Change, ...]:
    """The best frame and the best marker places, each as a sentence; one that cannot be computed is left out."""
    mechanism = Mechanism(robot)
    noise = (robot.sensors.marker_noise, max(robot.sensors.encoder_resolution, robot.sensors.marker_noise))
    found = (_frame(mechanism, sample, noise), _markers(mechanism, sample, noise))
    return tuple(one for one in found if one is not None)


def _frame(mechanism: Mechanism, sample: PoseSamples, noise: tuple[float, float]) -> Change | None:
    robot = mechanism.robot
    start = Placement.of(robot, sample.markers.shape[1])
    try:
        turn, shift = aligned(sample.markers, resting(mechanism, sample))
        found = place(mechanism, sample, Free(frame=True), replace(start, turn=turn, shift=shift), noise).placement
    except (FidimError, np.linalg.LinAlgError):
        return None
    words = f"The motion capture's frame is not the robot's: {moved_in_words(found.turn, found.shift)}"
    return Change(words, robot, turn=found.turn, shift=found.shift)


def _markers(mechanism: Mechanism, sample: PoseSamples, noise: tuple[float, float]) -> Change | None:
    robot = mechanism.robot
    start = Placement.of(robot, sample.markers.shape[1])
    try:
        found = place(mechanism, sample, Free(markers=True), start, noise).placement
    except (FidimError, np.linalg.LinAlgError):
        return None
    by = found.body - start.body
    worst = int(np.argmax(np.linalg.norm(by, axis=1)))
    which = "The marker" if len(by) == 1 else f"{marker_name(sample.numbers[worst]).capitalize()}"
    words = f"{which} is not where the robot file has it on the body, but {millimetres(by[worst])} away"
    return Change(words, replace(robot, marker=found.body[0], extra_markers=tuple(found.body[1:])))


def resting(mechanism: Mechanism, sample: PoseSamples) -> Float[np.ndarray, "S M 3"]:
    """Where the nominal body's markers would rest with the lengths of each pose, m."""
    body = mechanism.robot.markers[: sample.markers.shape[1]]
    return np.array([pose.position + body @ pose.rotation.T for pose in rests(mechanism, sample)])


def rests(mechanism: Mechanism, sample: PoseSamples) -> list[Pose]:
    """Where the nominal body would rest with the lengths of each pose. Raises InfeasibleError where it would not."""
    known: dict[bytes, Pose] = {}
    for lengths in sample.lengths:
        if lengths.tobytes() not in known:
            known[lengths.tobytes()] = pose_from_lengths(mechanism, mechanism.robot.nominal, lengths).pose
    return [known[lengths.tobytes()] for lengths in sample.lengths]


def aligned(places: np.ndarray, wanted: np.ndarray) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation and shift (m) that bring places (…, 3) nearest to others. LinAlgError where they lie on one line."""
    a, b = places.reshape(-1, 3), wanted.reshape(-1, 3)
    middle, goal = a.mean(axis=0), b.mean(axis=0)
    left, size, right = np.linalg.svd((a - middle).T @ (b - goal))
    if size[1] < FLAT**2 * size[0]:
        raise np.linalg.LinAlgError("places on one line turn no frame")
    turn = right.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(right.T @ left.T))]) @ left.T
    return turn, goal - turn @ middle


def moved_in_words(turn: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, "3"]) -> str:
    """Of the frame in words: what was done to robot coordinates."""
    back = Rotation.from_matrix(turn.T).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(back))
    if angle < 0.05:
        turned = "it is not turned"
    else:
        axis = ", ".join(f"{x:.3f}" for x in back / angle)
        turned = f"it is turned by {angle:.1f}° about ({axis})"
    return f"{turned} and shifted by {millimetres(-turn.T @ shift)}"


def millimetres(by: Float[np.ndarray, "3"]) -> str:
    """A shift in m as words."""
    return f"({', '.join(f'{1e3 * x:.0f}' for x in by)}) mm"
