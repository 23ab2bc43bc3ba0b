"""Moves from equilibrium to equilibrium on hidden bodies: how far the platform swings afterwards, until it is at rest.

python -m benchmarks.excite travel --runs 24
"""

import argparse
from dataclasses import dataclass

import numpy as np

from benchmarks.excite.runs import true_world
from benchmarks.excite.swung import LOOK
from benchmarks.page import table
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.excitation.place import ExcitationPlace
from fidim_lab.identification.excitation.travel import Trapezoid, Travel, travel, travelled
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.mechanism import Mechanism
from procedures.settings import ExciteSettings, MotionSettings
from sim_backends.plant.plant import Plant
from sim_backends.plant.world import World

DAMPING = (0.026, 0.086)
"""of the most damped mode, as seen in practice"""
PATIENCE = 20.0
"""s after a move that are looked at"""
PLACES, SEED = 12, 5


@dataclass(frozen=True)
class Moved:
    """One move, carried out."""

    seconds: float
    swing: float
    """m, farthest from rest after it"""
    settled: float
    """s after it until the marker stays within the tolerance; PATIENCE where it does not"""
    tension: tuple[float, float]
    """N on the way"""


def moved(world: World, places: tuple[ExcitationPlace, ExcitationPlace], move: Travel, tolerance: float) -> Moved:
    """A move from rest on a body that the planner does not know. tolerance: m, about the rest."""
    start, goal = (place.equilibrium.lengths for place in places)
    plant = Plant(world)
    plant.settle(start)
    ways = goal - start
    ramp, way = move.speed / move.acceleration, float(np.abs(ways).max())
    shape = Trapezoid(ramp, way / move.speed + ramp)
    tensions = [plant.tensions]
    offset, rate = np.zeros(len(ways)), np.zeros(len(ways))
    for _, duration, unit in shape.pieces():
        steps = int(np.ceil(duration / LOOK))
        for _ in range(steps):
            h, a = duration / steps, unit * ways
            plant.advance(plant.t + h, start + offset, rate, a)
            offset, rate = offset + rate * h + a * h**2 / 2, rate + a * h
            tensions.append(plant.tensions)
    seen, none = list[np.ndarray](), np.zeros(len(ways))
    for _ in range(round(PATIENCE / LOOK)):
        plant.advance(plant.t + LOOK, goal, none, none)
        seen.append(plant.markers()[0])
        tensions.append(plant.tensions)
    away = np.linalg.norm(np.array(seen) - plant.rest(goal, plant.pose).marker, axis=1)
    still = np.flatnonzero(away > tolerance)
    settled = LOOK * (still[-1] + 1) if len(still) else 0.0
    return Moved(shape.seconds, float(away.max()), float(settled), (float(np.min(tensions)), float(np.max(tensions))))


def travels(options: argparse.Namespace) -> str:
    """The moves of a session by hand, as fast as may be, and timed for the modes."""
    robot = read_robot(PAPERS_ROBOT)
    mechanism = Mechanism(robot, native=True)
    drawn = [window.lengths for window in random_plan(robot, "travel", PLACES, 0, SEED).windows]
    places = [ExcitationPlace.at(mechanism, lengths) for lengths in drawn]
    hand, excite = MotionSettings(), ExciteSettings()
    kinds = {
        "as by hand": lambda a, b: travelled(a, b, hand.speed, hand.acceleration),
        "as fast as may be": lambda a, b: travelled(a, b, excite.speed, excite.acceleration),
        "timed for the modes": lambda a, b: travel(a, b, excite.speed, excite.acceleration, excite.left),
    }
    done: dict[str, list[Moved]] = {name: [] for name in kinds}
    for run in range(options.runs):
        rng = np.random.default_rng([run, 11])
        while True:
            first, second = rng.choice(PLACES, 2, replace=False)
            pair = places[first], places[second]
            if _inside(robot, kinds["as by hand"](*pair).tension):  # a session goes another way where that is not so
                break
        world = true_world(robot, rng, drawn[second], mechanism, DAMPING)
        for name, plan in kinds.items():
            done[name].append(moved(world, pair, plan(*pair), hand.settle_tolerance))
    return (
        f"{options.runs} moves between {PLACES} random places of the paper's robot, straight ways that keep its "
        f"tensions; bodies and masses 5 % off CAD, damping of {100 * DAMPING[0]:g} to {100 * DAMPING[1]:g} %. At rest: "
        f"the marker is within {1e3 * hand.settle_tolerance:g} mm of where it ends; {PATIENCE:g} s were looked at. By "
        f"hand: at most {hand.speed:g} m/s and {hand.acceleration:g} m/s²; else {excite.speed:g} m/s and "
        f"{excite.acceleration:g} m/s². Nothing calms the platform after the move.\n\n"
        + table(
            ["median, 95 %", "move, s", "swing left, mm", "until at rest, s", "both, s", "tensions outside"],
            [_line(robot, name, some) for name, some in done.items()],
        )
    )


def _inside(robot: Robot, tension: tuple[float, float]) -> bool:
    low, high = robot.limits.tension
    return low <= tension[0] and tension[1] <= high


def _line(robot: Robot, name: str, some: list[Moved]) -> list[object]:
    columns = [
        [one.seconds for one in some],
        [1e3 * one.swing for one in some],
        [one.settled for one in some],
        [one.seconds + one.settled for one in some],
    ]
    outside = sum(not _inside(robot, one.tension) for one in some)
    return [
        name,
        *(", ".join(f"{value:.1f}" for value in np.quantile(column, (0.5, 0.95))) for column in columns),
        outside,
    ]
