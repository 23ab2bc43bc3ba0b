"""Where the platform rests at given cable lengths, by the robot file: marker and tensions, cached."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable, Positions, Vector3
from fidim_lab.data.records import Pose, Robot
from fidim_lab.model.kinematics import allowed_places, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium
from procedures.steps import Lengths


@dataclass(frozen=True, eq=False)
class ExpectedRest:
    """The platform at rest, by the robot file's geometry, nominal body and mass."""

    marker: Vector3
    """the main one, robot frame, m"""
    tensions: PerCable
    """N"""


class NominalRest:
    """Answers for lengths (m), each once (some 3 ms)."""

    def __init__(self, robot: Robot) -> None:
        self.n = robot.n
        self._robot = robot
        self._mechanism = Mechanism(robot)
        self._known: dict[Lengths, ExpectedRest] = {}

    def at(self, lengths: Lengths) -> ExpectedRest:
        """The rest at these lengths. Raises InfeasibleError where the platform cannot rest."""
        if lengths not in self._known:
            found = self._equilibrium(lengths)
            marker = found.pose.position + found.pose.rotation @ self._robot.marker
            self._known[lengths] = ExpectedRest(marker, found.tensions_in_newton(self._robot.mass))
        return self._known[lengths]

    def pose(self, lengths: Lengths) -> Pose:
        """The pose of that rest. Raises InfeasibleError where the platform cannot rest."""
        return self._equilibrium(lengths).pose

    def frequencies(self, lengths: Lengths) -> Float[np.ndarray, " free"]:
        """Of free motion about that rest, Hz, ascending. Raises InfeasibleError where the platform cannot rest."""
        from fidim_lab.model.modes import modes  # scipy: `run_procedure` has imported it

        return modes(self._mechanism, self._robot.nominal, self._equilibrium(lengths)).frequencies

    def allowed(self, lengths: Lengths, places: Positions) -> Positions:
        """(N, 3) places of the main marker (m) nearest to `places` that cables of these lengths allow.

        Raises InfeasibleError where the platform cannot rest, or not be there.
        """
        start = self._equilibrium(lengths).pose
        return allowed_places(self._mechanism, np.array(lengths), self._robot.marker, places, start)

    def _equilibrium(self, lengths: Lengths) -> Equilibrium:
        return pose_from_lengths(self._mechanism, self._robot.nominal, np.array(lengths))

    def tensions(self, lengths: PerCable) -> PerCable:
        """Tensions (N) at rest, as `limits.RestLimits` asks for them. Raises InfeasibleError."""
        return self.at(tuple(float(length) for length in lengths)).tensions
