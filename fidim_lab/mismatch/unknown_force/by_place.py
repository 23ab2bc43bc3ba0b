"""Families of the place in the room: towards a point, polynomials, sums of bell functions, brakes."""

from functools import partial
from itertools import product

import casadi as ca
import numpy as np
from scipy.stats import qmc

from fidim_lab.effects.wrenches import at_arm
from fidim_lab.mismatch.unknown_force.family import Dependence, Expression, Family, bells, monomials
from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.mismatch.unknown_force.reach import Reach, centres_of, drag_on, force_on
from fidim_lab.model.slots import PlatformState

MOST_CENTRES = 45
"""of a field in space"""
WIDTHS = (0.08, 0.15, 0.3)
"""of a field in space, as shares of the room that was visited"""
OUTSIDE = 0.25
"""how far outside the room that was visited, in its diagonals, a centre of force is looked for"""

ALL_OVER = 256
"""further starts, evenly over the box: a centre that nobody passed was missed from 18 places that were visited and from
128 all over, and found from 256, at 5 ms each"""


def _to_centre(point: ForcePoint, state: PlatformState, shape: ca.SX) -> ca.SX:
    return at_arm(point.arm(state), shape[:3] - point.place(state))


def centre(reach: Reach, point: ForcePoint) -> Family:
    """Towards a place, or away from it; two widths together give nearly any fall-off."""
    label = f"force on {point.value} towards a place"
    return _about_a_place(reach, point, Dependence.CENTRE, label, partial(_to_centre, point))


def brake(reach: Reach, point: ForcePoint) -> Family:
    """Against the motion near a place: what eddy currents do."""
    label = f"brake on {point.value} near a place"
    return _about_a_place(reach, point, Dependence.BRAKE, label, partial(drag_on, point))


def _about_a_place(reach: Reach, point: ForcePoint, dependence: Dependence, label: str, wrenches: Expression) -> Family:
    def falling(state: PlatformState, shape: ca.SX) -> ca.SX:
        away = point.place(state) - shape[:3]
        near = ca.dot(away, away) / ca.exp(2 * shape[3])
        return ca.vertcat(ca.exp(-near / 2), ca.exp(-near / 8))

    positions = reach.places(point)
    steps = np.append(np.full(3, 0.08 * reach.size), 0.3)
    low = np.append(positions.min(axis=0) - OUTSIDE * reach.size, np.log(0.03 * reach.size))
    high = np.append(positions.max(axis=0) + OUTSIDE * reach.size, np.log(0.6 * reach.size))
    visited = (
        np.append(middle, np.log(share * reach.size))
        for share, most in ((0.15, 40), (0.3, 20))
        for middle in centres_of(positions, 0.7 * share * reach.size, most)
    )
    shapes = (*visited, *qmc.scale(qmc.Sobol(4, rng=0).random(ALL_OVER), low, high))
    return Family(dependence, label, wrenches, falling, shapes, steps, point, box=np.stack([low, high]))


def evenly(reach: Reach) -> list[Family]:
    """Polynomials of the place: the lowest orders of any force from far away.

    With what is the same everywhere: such a force vanishes where its source says, not in the middle of the motion.
    """
    found: list[Family] = []
    for point, degrees in product(ForcePoint, ((0, 1), (0, 1, 2), (0, 1, 2, 3))):
        positions = reach.places(point)
        middle, half = positions.mean(axis=0), reach.size / 2

        def law(
            state: PlatformState,
            shape: ca.SX,
            point: ForcePoint = point,
            degrees: tuple[int, ...] = degrees,
            middle: np.ndarray = middle,
            half: float = half,
        ) -> ca.SX:
            return monomials((point.place(state) - ca.SX(ca.DM(middle))) / half, degrees)

        label = f"force on {point.value} by a polynomial of the place, degree {degrees[-1]}"
        push = partial(force_on, point)
        found.append(Family(Dependence.GRADIENT, label, push, law, point=point, scale=half))
    return found


def in_space(reach: Reach) -> list[Family]:
    """Any smooth force of the place, and a brake that is stronger in some places: bells of several widths."""
    found: list[Family] = []
    for share, point in product(WIDTHS, ForcePoint):
        width = share * reach.size
        positions = reach.places(point)
        field = partial(_field, point, centres_of(positions, width, MOST_CENTRES), width)
        says = f"{width:.2g} m wide"
        label = f"force field on {point.value}, {says}"
        found.append(Family(Dependence.POSITION, label, partial(force_on, point), field, point=point))
        label = f"brake on {point.value} in places, {says}"
        found.append(Family(Dependence.BRAKE, label, partial(drag_on, point), field, point=point))
    return found


def _field(point: ForcePoint, centres: np.ndarray, width: float, state: PlatformState, shape: ca.SX) -> ca.SX:
    return bells(point.place(state), ca.SX(ca.DM(centres)), ca.SX(width))
