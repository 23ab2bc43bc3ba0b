"""Moves between equilibria without exciting the platform: speed and acceleration of a trapezoidal move.

A ramp of constant acceleration that lasts whole periods of a mode leaves that mode at rest (it is an input shaper that
every drive has), and between two modes some duration leaves little of both. So speed and acceleration are all that has
to be chosen, for the modes where the move begins and where it ends; the nonlinear model says what remains.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.strokes import COARSE, timeline
from fidim_lab.model.motion import driven_derivative, driven_motions
from fidim_lab.model.swing import Swing

SPEEDS = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2, 0.1)
"""parts of the highest speed"""
RAMPS = 60
LONGEST_RAMP = 4.0
"""s"""
TRIALS = 6
"""moves that the nonlinear model looks at"""
STEPS = (200, 400, 800, 1600)


@dataclass(frozen=True)
class Trapezoid:
    """A move over a unit way: ramp up, cruise, ramp down."""

    ramp: float
    """s"""
    seconds: float

    def pieces(self) -> Float[np.ndarray, "pieces 3"]:
        """(begin, duration, acceleration) of each piece, 1/s²."""
        acceleration = 1.0 / (self.ramp * (self.seconds - self.ramp))
        return np.array(
            [
                [0.0, self.ramp, acceleration],
                [self.ramp, self.seconds - 2 * self.ramp, 0.0],
                [self.seconds - self.ramp, self.ramp, -acceleration],
            ]
        )


@dataclass(frozen=True)
class Travel:
    """One move, and what is to be expected of it."""

    speed: float
    """m/s of the cable with the longest way"""
    acceleration: float
    """m/s²"""
    seconds: float
    left: float
    """m: how far the main marker still swings, without any damping"""
    tension: tuple[float, float]
    """N on the way"""


def travelled(start: ExcitationPlace, goal: ExcitationPlace, speed: float, acceleration: float) -> Travel:
    """What comes of a given move, by the nonlinear model without damping."""
    way = _way(start, goal)
    ramp = min(speed / acceleration, float(np.sqrt(way / acceleration)))
    return _looked_at(start, goal, Trapezoid(ramp, way / (ramp * acceleration) + ramp))


def travel(
    start: ExcitationPlace, goal: ExcitationPlace, speed: float, acceleration: float, swing: float = 1e-3
) -> Travel:
    """The quickest move between two equilibria that leaves the marker swinging less than `swing` (m).

    speed, acceleration: the highest allowed. Of the robot's tension limits, those that the rests keep are kept on the
    way. Where no move leaves so little, the one that leaves least. Raises InfeasibleError where every one that was
    tried would break a tension limit.
    """
    way = _way(start, goal)
    direction = (goal.equilibrium.lengths - start.equilibrium.lengths) / way
    choices: list[tuple[float, float, Trapezoid]] = []
    for share in SPEEDS:
        cruise = share * speed
        for ramp in np.linspace(cruise / acceleration, LONGEST_RAMP, RAMPS):
            if way < cruise * ramp:
                continue
            shape = Trapezoid(float(ramp), way / cruise + float(ramp))
            left = _left(start.swing, direction, cruise, float(ramp)) + _left(
                goal.swing, direction, cruise, float(ramp)
            )
            choices.append((shape.seconds, left, shape))
    if not choices:  # a way too short for any ramp that is timed
        return _best([travelled(start, goal, speed, acceleration)], start, goal)
    gentle = sorted(one for one in choices if one[1] <= swing) or sorted(choices, key=lambda one: one[1])
    found: list[Travel] = []
    for _, _, shape in gentle[:: max(1, min(len(gentle) // TRIALS, 8))][:TRIALS]:
        found.append(_looked_at(start, goal, shape))
        if found[-1].left <= swing and _keeps(found[-1], start, goal):
            return found[-1]
    return _best(found, start, goal)


def _best(found: list[Travel], start: ExcitationPlace, goal: ExcitationPlace) -> Travel:
    """The one that leaves least, of those that keep the limits."""
    safe = [one for one in found if _keeps(one, start, goal)]
    if not safe:
        low, high = max((one.tension for one in found), key=lambda tension: tension[0])
        raise InfeasibleError(
            f"Moves there that leave the platform still pull the cables by {low:.0f} to {high:.0f} N."
        )
    return min(safe, key=lambda one: one.left)


def _way(start: ExcitationPlace, goal: ExcitationPlace) -> float:
    return float(np.abs(goal.equilibrium.lengths - start.equilibrium.lengths).max())


def _left(swing: Swing, direction: PerCable, speed: float, ramp: float) -> float:
    """How far the marker swings after one ramp, by linear theory without damping, m."""
    omega = 2 * np.pi * swing.frequencies
    response = np.abs(swing.gain @ direction) * speed / ramp * np.abs(2 * np.sin(omega * ramp / 2)) / omega**2
    return float(np.linalg.norm(response * swing.lever))


def _looked_at(start: ExcitationPlace, goal: ExcitationPlace, shape: Trapezoid) -> Travel:
    ways = goal.equilibrium.lengths - start.equilibrium.lengths
    needed = shape.seconds / COARSE + 12
    count = next((steps for steps in STEPS if steps >= needed), int(needed) + 1)
    line = timeline((shape,), (0.0,), shape.seconds, count, COARSE)
    accelerations = line.accelerations(ways[np.newaxis])
    pose, mechanism = start.equilibrium.pose, start.mechanism
    found = driven_motions(mechanism, start.body, pose, accelerations[np.newaxis], line.steps)
    end = driven_derivative(mechanism, start.body, pose, accelerations, np.zeros((*accelerations.shape, 1)), line.steps)
    newton = found.tensions * start.robot.mass
    left = goal.swing.amplitudes(goal.swing.states(end.pose, end.twist)[0])
    way = _way(start, goal)
    speed = way / (shape.seconds - shape.ramp)
    return Travel(
        speed=speed,
        acceleration=speed / shape.ramp,
        seconds=shape.seconds,
        left=float(np.linalg.norm(left)) if np.isfinite(left).all() else np.inf,
        tension=(float(newton.min()), float(newton.max())),
    )


def _keeps(found: Travel, start: ExcitationPlace, goal: ExcitationPlace) -> bool:
    """Whether no tension leaves the limits farther than both rests do."""
    low, high = start.robot.limits.tension
    rests = np.concatenate([one.equilibrium.tensions_in_newton(one.robot.mass) for one in (start, goal)])
    return found.tension[0] >= min(low, float(rests.min())) and found.tension[1] <= max(high, float(rests.max()))
