"""The paper's Eq. 46, 47, 49 and Fig. 3 from its own recordings, in the form that gives the printed digits.

That form is not quite the one in print: Eq. 47 counts all samples of fifteen windows (not 100 of each of twelve),
gravity along the calibrated axis, and 1 + ‖χ‖ in Eq. 32 where 1 + ‖χ‖² is printed. Nothing here reads files.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from benchmarks.reproduce.processed import Processed
from fidim_lab.data.records import Body, Pose, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.equations import tls
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import conditioning, free_twist_basis, marker_selector, motion_from_free
from fidim_lab.model.regressor import free_regressor, parameter_vector

AXES = (0, 1)
"""x and y of P: the paper's free coordinates"""
SAMPLES = 100
"""of each window in the paper's decimated form (§5.2)"""
USABLE = 40.0
"""condition number of x, y beyond which a window tells nothing in free coordinates; between 35 and 46 it takes the same
twelve of the fifteen takes that the paper fitted"""

Regressor = Float[np.ndarray, "N free 10"]


@dataclass(frozen=True, eq=False)
class TakesIdentified:
    """Total least squares on some takes."""

    solution: tls.TlsSolution
    takes: tuple[int, ...]
    left_out: Mapping[int, str]
    """take → why"""

    @property
    def printed_percent(self) -> Float[np.ndarray, "9"]:
        """σ% as the paper printed it: with 1 + ‖χ‖ for 1 + ‖χ‖² in Eq. 32."""
        size = float(np.linalg.norm(self.solution.values))
        return self.solution.percent * np.sqrt((1 + size) / (1 + size**2))


def full_pose(mechanism: Mechanism, take: Processed) -> Regressor:
    """W of one take, its whole pose measured, Ξ⊥ in x and y (Eq. 22)."""
    motion = take.motion
    xi = mechanism.structure_matrix(motion.positions, motion.rotations)
    selector = marker_selector(motion.rotations, mechanism.robot.marker, AXES)
    return free_regressor(motion, mechanism.robot.gravity, free_twist_basis(xi, selector))


def free_pose(mechanism: Mechanism, take: Processed) -> tuple[Regressor, float]:
    """W of one take from x and y of P and the held lengths (Eq. 44, 45), and the worst condition number of x, y.

    Lengths are the median of what the poses say. Raises InfeasibleError where x and y do not determine the pose.
    """
    motion, robot = take.motion, mechanism.robot
    lengths = np.median(mechanism.lengths(motion.positions, motion.rotations), axis=0)
    start = Pose(motion.positions[0], motion.rotations[0])
    poses = dependent_pose(mechanism, lengths, robot.marker, AXES, motion.positions[:, :2], start)
    rates, accelerations = take.rates[:, :2], take.accelerations[:, :2]
    found = motion_from_free(mechanism, motion.t, poses, robot.marker, AXES, rates, accelerations)
    xi = mechanism.structure_matrix(found.positions, found.rotations)
    selector = marker_selector(found.rotations, robot.marker, AXES)
    regressor = free_regressor(found, robot.gravity, free_twist_basis(xi, selector))
    return regressor, float(conditioning(xi, selector).max())


def by_full_pose(robot: Robot, takes: Sequence[Processed], samples: int | None = None) -> TakesIdentified:
    """Eq. 47: so many samples of every take, or all. Raises RefusedError where they do not identify a body."""
    mechanism = Mechanism(robot)
    return _solved({take.number: _decimated(full_pose(mechanism, take), samples) for take in takes}, {})


def by_free_coordinates(robot: Robot, takes: Sequence[Processed]) -> TakesIdentified:
    """Eq. 46: 100 samples of each take in which x and y determine the pose. Raises RefusedError as `by_full_pose`."""
    mechanism = Mechanism(robot)
    used: dict[int, Regressor] = {}
    left_out: dict[int, str] = {}
    for take in takes:
        try:
            regressor, condition = free_pose(mechanism, take)
        except InfeasibleError as error:
            left_out[take.number] = str(error)
            continue
        if condition > USABLE:
            left_out[take.number] = f"condition number of x, y up to {condition:.0f}; {USABLE:.0f} is allowed"
            continue
        used[take.number] = _decimated(regressor, SAMPLES)
    return _solved(used, left_out)


def _decimated(regressor: Regressor, samples: int | None) -> Regressor:
    return regressor if samples is None else regressor[:: max(1, len(regressor) // samples)][:samples]


def _solved(used: Mapping[int, Regressor], left_out: Mapping[int, str]) -> TakesIdentified:
    stacked = np.concatenate([np.zeros((0, 10)), *(each.reshape(-1, 10) for each in used.values())])
    return TakesIdentified(tls.solve(tls.compress(stacked), rows=len(stacked)), tuple(used), left_out)


@dataclass(frozen=True, eq=False)
class Checked:
    """One take of Fig. 3."""

    number: int
    sigma: float
    """σ⊥ of Eq. 50 as printed: root of the squares over the samples"""
    mean_square: float
    """mean of ε² over all its numbers: what gives the paper's count"""


def cross_validated(robot: Robot, takes: Sequence[Processed], body: Body) -> tuple[Checked, ...]:
    """Fig. 3: ε = W χ of takes with their whole pose measured, for one body."""
    mechanism, chi = Mechanism(robot), parameter_vector(body)
    found: list[Checked] = []
    for take in takes:
        epsilon = full_pose(mechanism, take) @ chi
        sigma = float(np.sqrt((epsilon**2).sum() / len(epsilon)))
        found.append(Checked(take.number, sigma, float((epsilon**2).mean())))
    return tuple(found)


def difference_percent(free: Body, full: Body) -> Float[np.ndarray, "6"]:
    """Eq. 48 of the essential parameters, %."""
    return 100 * np.abs((full.vector - free.vector) / free.vector)[:6]
