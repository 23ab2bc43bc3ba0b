"""Lengths and structure matrices of many robots of so many cables at once, each pose with a geometry of its own.

The same expressions as `Mechanism`'s, with the constants of the cables as arguments: a search tries hundreds of robots
that differ in these alone, and to compile a mechanism for each takes longer than to fit its poses.
"""

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.records import Robot
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.geometry import CableConstants, cable_expressions
from fidim_lab.model.making import MAKING
from fidim_lab.model.mechanism import SINGULAR_DISTANCE, structure_expression

CONSTANTS = 16
"""numbers of a cable: d, a, x, y, z, radius"""


def alike(robot: Robot) -> tuple[bool, ...]:
    """What robots must have in common to be looked at together: which cables have a pulley."""
    return tuple(cable.radius != 0 for cable in robot.cables)


class ManyRobots:
    """Kinematics without effects of robots that are `alike`, each at so many poses, one robot after the other."""

    def __init__(self, robots: Sequence[Robot], poses: int) -> None:
        self._compiled = _compiled(alike(robots[0]))
        self._constants = np.repeat([_constants(robot) for robot in robots], poses, axis=0)

    def at(
        self, p: Positions, R: Rotations
    ) -> tuple[Float[np.ndarray, "N n"], Float[np.ndarray, "N n 6"], Bool[np.ndarray, " N"]]:
        """Lengths (m), Ξ, and where one of the cables is singular: there the others mean nothing."""
        lengths, structure, distances, clearances = over_samples(self._compiled, len(p), p, R, self._constants)
        singular = np.any((distances <= SINGULAR_DISTANCE) | (clearances <= SINGULAR_DISTANCE**2), axis=1)
        return lengths, structure.reshape(len(p), -1, 6), np.asarray(singular)


def _constants(robot: Robot) -> np.ndarray:
    return np.concatenate([(*c.d, *c.a, *c.x, *c.y, *c.z, c.radius) for c in robot.cables])


@cache
def _compiled(pulleys: tuple[bool, ...]) -> ca.Function:
    with MAKING:
        position, flat = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
        constants = ca.SX.sym("constants", CONSTANTS, len(pulleys))
        rotation = from_rows(flat, 3, 3)
        cables = tuple(
            cable_expressions(_symbols(constants[:, k], pulley=pulley), position, rotation)
            for k, pulley in enumerate(pulleys)
        )
        return function(
            "many_robots",
            [position, flat, ca.vec(constants)],
            [
                ca.vertcat(*(cable.length for cable in cables)),
                rows(structure_expression(cables)),
                ca.vertcat(*(cable.axis_distance for cable in cables)),
                ca.vertcat(*(cable.clearance for cable in cables)),
            ],
        )


def _symbols(column: ca.SX, *, pulley: bool) -> CableConstants:
    d, a, x, y, z = (column[begin : begin + 3] for begin in range(0, 15, 3))
    return CableConstants(d=d, a=a, x=x, y=y, z=z, radius=column[15] if pulley else ca.SX(0.0))
