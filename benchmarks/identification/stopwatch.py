"""A person with a stopwatch beside a simulated pendulum: what is timed of a push, and what a level says at rest.

The plant integrates the whole motion; a swing is from one passage through rest to the next in the same direction, of
what an eye follows of it: an angle of the platform, or the place of P.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import PerCable
from fidim_lab.errors import InfeasibleError
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World

STEP = 0.01
"""s between two looks; passages are between them"""
WATCHED = 6
"""swings that are simulated: the noise of more of them is the hand's alone"""


@dataclass(frozen=True)
class TimedPush:
    """Of one push."""

    period: float
    """s, mean"""
    amplitude: float
    """of what is watched, rad or m"""


class WatchedPendulum:
    """A body on cords of fixed lengths (m)."""

    def __init__(self, world: World, lengths: PerCable) -> None:
        self._world, self._plant, self._lengths = world, Plant(world), np.asarray(lengths, dtype=float)
        self._rest = self._plant.rest(self._lengths)

    @property
    def tilt(self) -> tuple[float, float]:
        """rad at rest about the body's x, then y, as a perfect inclinometer reads it."""
        self._plant.place(self._rest, self._lengths)
        up = -self._world.gravity / np.linalg.norm(self._world.gravity) @ self._plant.pose.rotation
        return float(np.arctan2(up[1], up[2])), float(-np.arcsin(up[0]))

    def timed(self, motion: str, twist: np.ndarray, most: float) -> TimedPush:
        """Of a push (as `Plant.place` takes it) that makes it yaw, rock, or sway along x or across; most: s to wait.

        Raises InfeasibleError where it does not swing so often in that time.
        """
        self._plant.place(self._rest, self._lengths, twist=twist)
        times = np.arange(0.0, most, STEP)
        seen = np.zeros(len(times))
        for k, t in enumerate(times):
            self._plant.advance(float(t))
            pose = self._plant.pose
            angles = {"yaw": pose.rotation[1, 0], "rock": pose.rotation[2, 1]}
            seen[k] = angles.get(motion, pose.position[0 if motion == "along" else 1])
        seen -= seen[0]
        k = np.flatnonzero((seen[:-1] < 0) & (seen[1:] >= 0))
        if len(k) <= WATCHED:
            raise InfeasibleError(f"It swung {len(k)} times in {most:.3g} s, not {WATCHED + 1} times.")
        passages = times[k] - seen[k] * STEP / (seen[k + 1] - seen[k])
        return TimedPush(float(passages[WATCHED] - passages[0]) / WATCHED, float(np.abs(seen).max()))
