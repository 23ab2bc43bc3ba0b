"""A plan of random equilibria (paper §5.2): places and displacements drawn at random, kept where the physics allows.

The paper found that random equilibria excite about as well as optimised ones. Drawn here by seed; kept where the
platform rests with all tensions within their limits, where the free coordinates are well conditioned, and where the
free motion that follows the displacement stays taut and within the allowed displacement.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.data.records import Motion, Plan, PlannedWindow, Pose, Robot, Role
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.dynamics import simulate_free_motion
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.free_motion import conditioning, marker_selector
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium

DRAWS_FOR_EACH = 60
"""places tried for each window before the plan is given up"""
STRETCH = 1e-6
"""m of cable by which a displaced pose may miss the held lengths"""


@dataclass(frozen=True)
class Taste:
    """What a random window must be like."""

    seconds: float = 10.0
    inside: float = 0.6
    """part of the anchors' box, about its middle, from which places are drawn"""
    depth: tuple[float, float] = (0.35, 1.0)
    """below the anchors, as parts of half the box's diagonal"""
    rest_margin: float = 0.05
    """part of the tension limits to keep away from, at rest: the true body is another"""
    taut: float = 0.3
    """least tension in motion, as a part of the lower limit"""
    tight: float = 1.1
    """largest tension in motion, as a part of the upper limit"""
    conditioning: float = 20.0
    """largest condition number of Ξ over the dependent coordinates, at rest"""
    conditioning_in_motion: float = 60.0
    amplitudes: tuple[float, ...] = (0.06, 0.045, 0.03, 0.02)
    """m of displacement, tried in this order"""
    apart: float = 0.08
    """m between places"""


def random_plan(
    robot: Robot, name: str, equilibria: int, validation: int, seed: int, taste: Taste | None = None
) -> Plan:
    """A plan of `equilibria` windows to identify from and `validation` windows held out, for the nominal body.

    The windows are ordered for short ways; ids i01…, v01…. Raises InfeasibleError where not enough are found.
    """
    taste = taste or Taste()
    rng = np.random.default_rng([seed, 2])
    search = _Search(robot, taste, rng)
    wanted = equilibria + validation
    found: list[_Candidate] = []
    for _ in range(DRAWS_FOR_EACH * wanted):
        candidate = search.draw()
        if candidate is not None and all(
            np.linalg.norm(candidate.place - other.place) >= taste.apart for other in found
        ):
            found.append(candidate)
        if len(found) == wanted:
            return Plan(name, _windows(found, equilibria))
    raise InfeasibleError(
        f"Only {len(found)} of {wanted} equilibria were found where the platform rests and swings with tensions within "
        f"{robot.limits.tension[0]:g} to {robot.limits.tension[1]:g} N.",
        hint="Ask for fewer, widen the limits in the robot file, or give a plan.",
    )


@dataclass(frozen=True, eq=False)
class _Candidate:
    place: Vector3
    lengths: PerCable
    displacement: np.ndarray


class _Search:
    """Draws one candidate at a time."""

    def __init__(self, robot: Robot, taste: Taste, rng: np.random.Generator) -> None:
        self._robot, self._taste, self._rng = robot, taste, rng
        self._mechanism = Mechanism(robot)
        anchors = np.array([cable.d for cable in robot.cables])
        self._middle = anchors.mean(axis=0)
        self._half = np.maximum(np.ptp(anchors, axis=0) / 2.0, 0.05)
        self._times = np.arange(0.0, taste.seconds + 1e-9, 0.02)

    def draw(self) -> _Candidate | None:
        """A place and a displacement that pass, or None."""
        equilibrium = self._rest()
        if equilibrium is None:
            return None
        place = equilibrium.marker_position(self._robot.marker)
        angle = self._rng.uniform(-np.pi, np.pi)
        for amplitude in self._taste.amplitudes:
            displacement = amplitude * np.array([np.cos(angle), np.sin(angle)])
            if self._swings_well(equilibrium, place, displacement):
                return _Candidate(place, equilibrium.lengths, displacement)
        return None

    def _rest(self) -> Equilibrium | None:
        robot, taste = self._robot, self._taste
        down = robot.gravity / np.linalg.norm(robot.gravity)
        box = self._rng.uniform(-1.0, 1.0, 3) * self._half * taste.inside
        box -= down * (box @ down)
        depth = self._rng.uniform(*taste.depth) * float(np.linalg.norm(self._half))
        try:
            equilibrium = equilibrium_at(self._mechanism, robot.nominal, self._middle + box + depth * down)
        except InfeasibleError:
            return None
        tension = equilibrium.tensions_in_newton(robot.mass)
        low, high = robot.limits.tension
        margin = taste.rest_margin
        if tension.min() < (1.0 + margin) * low or tension.max() > (1.0 - margin) * high:
            return None
        return equilibrium if self._conditioning(equilibrium.pose) < taste.conditioning else None

    def _conditioning(self, pose: Pose) -> float:
        """The worst over x, y as free coordinates (as far as there are so many freedoms)."""
        return float(self._conditionings(pose.position[np.newaxis], pose.rotation[np.newaxis])[0])

    def _conditionings(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        axes = tuple(range(min(self._robot.freedoms, 3)))
        if self._robot.freedoms > 3:
            return np.ones(len(positions))
        xi = self._mechanism.structure_matrix(positions, rotations)
        return conditioning(xi, marker_selector(rotations, self._robot.marker, axes))

    def _swings_well(self, equilibrium: Equilibrium, place: Vector3, displacement: np.ndarray) -> bool:
        """Whether the free motion from there stays taut, within the displacement limits, and well conditioned."""
        robot, taste = self._robot, self._taste
        start = self._displaced(equilibrium, place, displacement)
        if start is None:
            return False
        try:
            free = simulate_free_motion(self._mechanism, robot.nominal, start, np.zeros(6), self._times)
        except InfeasibleError:
            return False
        if free.slack_time is not None:
            return False
        tension = free.tensions * robot.mass
        low, high = robot.limits.tension
        moved = np.abs(_markers(free.motion, robot.marker) - place)[:, :2].max(axis=0)
        return bool(
            tension.min() > taste.taut * low
            and tension.max() < taste.tight * high
            and np.all(moved <= robot.limits.free_displacement)
            and self._conditionings(free.motion.positions, free.motion.rotations).max() < taste.conditioning_in_motion
        )

    def _displaced(self, equilibrium: Equilibrium, place: Vector3, displacement: np.ndarray) -> Pose | None:
        """A pose at the same lengths with the marker as near as can be to the wanted displacement in x, y."""
        robot, pose = self._robot, equilibrium.pose

        def at(unknown: np.ndarray) -> Pose:
            return Pose(pose.position + unknown[:3], rotation_matrix(unknown[3:]) @ pose.rotation)

        def stretch(moved: Pose) -> PerCable:
            return (
                self._mechanism.lengths(moved.position[np.newaxis], moved.rotation[np.newaxis])[0] - equilibrium.lengths
            )

        def miss(unknown: np.ndarray) -> np.ndarray:
            moved = at(unknown)
            marker = moved.position + moved.rotation @ robot.marker
            return np.concatenate([1e3 * stretch(moved), (marker - place)[:2] - displacement, 1e-3 * unknown])

        moved = at(least_squares(miss, np.zeros(6)).x)
        return moved if np.abs(stretch(moved)).max() < STRETCH else None


def _markers(motion: Motion, marker: Vector3) -> np.ndarray:
    return motion.positions + motion.rotations @ marker


def _windows(found: list[_Candidate], equilibria: int) -> tuple[PlannedWindow, ...]:
    """The candidates in an order of short ways, the held-out ones spread among them."""
    order = _short_way(found)
    held_out = len(found) - equilibria
    spread = {round((k + 0.5) * len(found) / held_out) for k in range(held_out)} if held_out else set[int]()
    names = {Role.IDENTIFY: itertools.count(1), Role.VALIDATE: itertools.count(1)}
    windows: list[PlannedWindow] = []
    for index, candidate in enumerate(order):
        role = Role.VALIDATE if index in spread else Role.IDENTIFY
        windows.append(
            PlannedWindow(
                id=f"{role.value[0]}{next(names[role]):02d}",
                role=role,
                lengths=candidate.lengths,
                displacement=candidate.displacement,
                position=candidate.place,
            )
        )
    return tuple(windows)


def _short_way(found: list[_Candidate]) -> list[_Candidate]:
    """Nearest neighbour after nearest neighbour, in length space, from the first drawn."""
    left = list(found)
    order = [left.pop(0)]
    while left:
        nearest = min(range(len(left)), key=lambda k: float(np.abs(left[k].lengths - order[-1].lengths).max()))
        order.append(left.pop(nearest))
    return order
