"""One simulated take, for all tests of `fidim import`."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

RATE = 100.0
BODY = np.array([[0.0, 0.0, 0.2], [0.2, 0.02, 0.21], [-0.18, 0.09, 0.2], [0.03, -0.09, 0.27], [-0.1, -0.05, 0.14]])
"""m, places of the markers on the platform"""
FROM_Z_UP = {"z": np.eye(3), "y": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}
EPOCH = 1.75e9


class Swing:
    """A platform let go, in the robot's frame, with a little noise."""

    def __init__(self, robot, positions: np.ndarray, rotations: np.ndarray) -> None:
        self.robot = replace(robot, marker=BODY[0], extra_markers=tuple(BODY[1:]))
        self.p, self.R = positions, rotations
        noise = 2e-5 * np.random.default_rng(3).normal(size=(len(positions), *BODY.shape))
        self.markers = positions[:, None] + np.einsum("nij,mj->nmi", rotations, BODY) + noise
        self.t = np.arange(len(positions)) / RATE
        self.quaternions = Rotation.from_matrix(rotations).as_quat()

    def seen(self, up: str) -> np.ndarray:
        """Markers as a motion capture with this axis upwards sees them, in another order."""
        return (self.markers @ FROM_Z_UP[up].T)[:, [2, 0, 1, 4, 3]]


@pytest.fixture(scope="module")
def swing(lab_recording) -> Swing:
    return Swing(lab_recording.robot, lab_recording.positions, lab_recording.rotations)
