"""Sensors on the robot itself that see its pose without cameras: swivel encoders and an inclinometer with yaw.

Angles are those of the true geometry (hidden offsets of anchors and attachments are in it), with white noise.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Cable, Pose
from sim_backends.plant.world import World


@dataclass(frozen=True)
class OwnNoise:
    """Standard deviations of a reading, rad; 0 is ideal."""

    swivel: float = 2e-3
    inclination: float = 5e-3


class OwnPoseSensors:
    """What swivel encoders and inclinometer read.

    Does not simulate: zeros, delays, play of the swivels, an inclinometer that takes acceleration for gravity.
    """

    def __init__(self, world: World, noise: OwnNoise, rng: np.random.Generator) -> None:
        self._cables, self._noise, self._rng = world.cables, noise, rng

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of a window file: s1 … sn and incl_x, incl_y, incl_z."""
        return (*(f"s{k + 1}" for k in range(len(self._cables))), "incl_x", "incl_y", "incl_z")

    def read(self, pose: Pose) -> np.ndarray:
        """(n + 3,) rad: swivel angles from each cable's x axis; rotations about the world's x, then y, then z."""
        swivels = [_swivel_angle(cable, pose) for cable in self._cables]
        angles = np.array([*swivels, *Rotation.from_matrix(pose.rotation).as_euler("xyz")])
        sd = np.array([self._noise.swivel] * len(swivels) + [self._noise.inclination] * 3)
        return angles + sd * self._rng.normal(size=len(angles))


def _swivel_angle(cable: Cable, pose: Pose) -> float:
    to = pose.position + pose.rotation @ cable.a - cable.d
    return float(np.arctan2(to @ cable.y, to @ cable.x))
