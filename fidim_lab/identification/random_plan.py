"""A plan of random equilibria (paper §5.2): places and displacements drawn at random, kept where the physics allows.

The paper found that random equilibria excite about as well as optimised ones. Drawn here by seed; kept where the
platform rests with all tensions within their limits, where the free coordinates are well conditioned, and where the
free motion that follows the displacement stays taut and within the allowed displacement. Cheap checks come first, then
two seconds of motion, then the whole window. CasADi's virtual machine alone decides: the same plan on every machine.
"""

import itertools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from fidim_lab.arrays import PerCable, Positions, Rotations, Vector3
from fidim_lab.data.records import Plan, PlannedWindow, Pose, Robot, Role
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.workspace import Workspace, displaced, rest_near
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import scaled_singular_values
from fidim_lab.model.motion import FreeMotion, conditioning, marker_selector, simulate_free_motion
from fidim_lab.model.statics import Equilibrium

DRAWS_FOR_EACH = 60
"""places tried for each window before the plan is given up"""
DRAWS_FOR_FIRST = 200
"""places tried without finding any: then there is hardly one"""
PENDULUM = 3
"""cables, on which a platform may hang as a pendulum whose marker reaches hardly any of the places drawn: if too few
are found, cables are given the lengths of an upright platform there instead"""
STEP = 0.01
"""s of integration: tensions within 1 % over 10 s, enough to accept or refuse a window"""
SAMPLE = 0.02
"""s"""
HORIZONS = (2.0, np.inf)
"""s of motion that are looked at: most of the unsuitable ones show in the first swings"""


class PlaceRefusal(StrEnum):
    """Why a drawn place is not used."""

    NO_REST = "the platform cannot rest there"
    TENSION = "tensions at rest are outside their limits"
    CONDITIONING = "the cables hold the platform badly there (conditioning)"
    SWING = "no displacement swings with taut cables within the limits"
    NEAR = "it is too near another one"
    TRIAL = "the true robot cannot rest or be displaced so there"


Trial = Callable[[Vector3, PerCable, np.ndarray], bool]
"""(place of the marker, lengths, displacement) → whether it can be done"""


@dataclass(frozen=True)
class Taste:
    """What a random window must be like."""

    seconds: float = 10.0
    inside: float = 0.6
    """part of the anchors' box, about its middle, from which places are drawn"""
    depth: tuple[float, float] = (0.35, 1.0)
    """below the anchors, in the workspace's scale (half the diagonal of the anchors' box)"""
    rest_margin: float = 0.05
    """part of the tension limits to keep away from, at rest: the true body is another"""
    taut: float = 0.3
    """least tension in motion, as a part of the lower limit"""
    tight: float = 1.1
    """largest tension in motion, as a part of the upper limit"""
    swing_margin: float = 0.0
    """part by which a cable's tension may leave its value at rest farther than the nominal body's swing makes it"""
    conditioning: float = 20.0
    """largest condition number of Ξ over the dependent coordinates at rest; of scaled Ξ with three freedoms or more"""
    conditioning_in_motion: float = 60.0
    amplitudes: tuple[float, ...] = (0.06, 0.045, 0.03, 0.02)
    """m of displacement, tried in this order"""
    apart: float = 0.05
    """least distance between places, in the workspace's scale (8 cm for the paper's robot)"""


WITHIN_LIMITS = Taste(taut=1.0, tight=1.0, swing_margin=0.25)
"""Eq. 42: all tensions stay within their limits at all times of the free motion, also for a body a little off.

Bodies whose centre of mass and inertia are 10–20 % off swing up to 0.25 harder in 9 of 10 windows (120 windows of 8
plans, 3 bodies each: 50 % within 0.07, 90 % within 0.26, 99 % within 0.57). What they do beyond that is seen when it is
recorded.
"""


def random_plan(
    robot: Robot,
    name: str,
    equilibria: int,
    validation: int,
    seed: int,
    taste: Taste | None = None,
    progress: Callable[[int, int], None] | None = None,
    trial: Trial | None = None,
) -> Plan:
    """A plan of `equilibria` windows to identify from and `validation` windows held out, for the nominal body.

    The windows are ordered for short ways; ids i01…, v01…. `progress(found, wanted)` is called after each find; `trial`
    may refuse what the nominal model accepts, where a place can be tried out. Raises InfeasibleError where not enough
    are found, with what most places lacked.
    """
    wanted, refusals = equilibria + validation, Counter[PlaceRefusal]()
    found: list[_Candidate] = []
    for hung in (False, True) if robot.n == PENDULUM else (False,):
        search = _Search(robot, taste or Taste(), np.random.default_rng([seed, 2]), hung=hung)
        tried, drawn = _drawn(search, wanted, progress, trial)
        if len(drawn) == wanted:
            return Plan(name, _windows(drawn, equilibria))
        if len(drawn) >= len(found):
            refusals, found = tried, drawn
    raise InfeasibleError(
        f"Only {len(found)} of {wanted} equilibria were found where the platform rests and swings with tensions within "
        f"{robot.limits.tension[0]:g} to {robot.limits.tension[1]:g} N; of the other places drawn, "
        + "; ".join(f"{count}: {why.value}" for why, count in refusals.most_common())
        + ".",
        hint="Ask for fewer, widen the limits in the robot file, or give a plan. fidim doctor --robot checks the file.",
    )


def _drawn(
    search: "_Search", wanted: int, progress: Callable[[int, int], None] | None, trial: Trial | None
) -> tuple[Counter[PlaceRefusal], list["_Candidate"]]:
    """As many candidates as are wanted, or those that were found until the search is given up; and its refusals."""
    found: list[_Candidate] = []
    refusals: Counter[PlaceRefusal] = Counter()
    for _ in range(DRAWS_FOR_EACH * wanted):
        drawn = search.draw(found)
        if isinstance(drawn, _Candidate) and trial is not None and not trial(*drawn):
            drawn = PlaceRefusal.TRIAL
        if isinstance(drawn, PlaceRefusal):
            refusals[drawn] += 1
            if not found and refusals.total() >= DRAWS_FOR_FIRST:
                break
            continue
        found.append(drawn)
        if progress is not None:
            progress(len(found), wanted)
        if len(found) == wanted:
            break
    return refusals, found


class _Candidate(NamedTuple):
    place: Vector3
    lengths: PerCable
    displacement: np.ndarray


class _Search:
    """Draws one candidate at a time."""

    def __init__(self, robot: Robot, taste: Taste, rng: np.random.Generator, *, hung: bool = False) -> None:
        self._robot, self._taste, self._rng, self._hung = robot, taste, rng, hung
        self._mechanism = Mechanism(robot)
        self._workspace = Workspace(robot)

    def draw(self, found: list[_Candidate]) -> _Candidate | PlaceRefusal:
        """A place and a displacement that pass, apart from those found, or why not."""
        # Every draw takes the same numbers from the generator whatever becomes of it, so plans change little.
        aside, depth = self._rng.uniform(-1.0, 1.0, 3), self._rng.uniform(*self._taste.depth)
        angle = self._rng.uniform(-np.pi, np.pi)
        rest = self._rest(aside * self._taste.inside, depth)
        if isinstance(rest, PlaceRefusal):
            return rest
        place = rest.marker_position(self._robot.marker)
        apart = self._taste.apart * self._workspace.scale
        if any(np.linalg.norm(place - other.place) < apart for other in found):
            return PlaceRefusal.NEAR
        direction = self._direction(rest.pose, angle)
        for amplitude in self._taste.amplitudes:
            if self._swings_well(rest, place, amplitude * direction):
                return _Candidate(place, rest.lengths, amplitude * direction)
        return PlaceRefusal.SWING

    def _rest(self, aside: Vector3, depth: float) -> Equilibrium | PlaceRefusal:
        robot, taste = self._robot, self._taste
        try:
            equilibrium = rest_near(self._mechanism, self._workspace.place(aside, depth), hung=self._hung)
        except InfeasibleError:
            return PlaceRefusal.NO_REST
        tension = equilibrium.tensions_in_newton(robot.mass)
        low, high = robot.limits.tension
        margin = taste.rest_margin
        if tension.min() < (1.0 + margin) * low or tension.max() > (1.0 - margin) * high:
            return PlaceRefusal.TENSION
        pose = equilibrium.pose
        worst = self._conditionings(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
        return equilibrium if worst < taste.conditioning else PlaceRefusal.CONDITIONING

    def _direction(self, pose: Pose, angle: float) -> np.ndarray:
        """The unit vector (x, y) of the displacement: at this angle, or the only way where there is one freedom."""
        wanted = np.array([np.cos(angle), np.sin(angle)])
        if self._robot.freedoms > 1:
            return wanted
        xi = self._mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
        selector = marker_selector(pose.rotation[np.newaxis], self._robot.marker, (0, 1))[0]
        way = selector @ np.linalg.svd(xi)[2][-1]
        return way / np.copysign(np.linalg.norm(way), way @ wanted)

    def _conditionings(self, positions: Positions, rotations: Rotations) -> np.ndarray:
        """(N,) over the marker's x, y as free coordinates, over the better one of them with a single freedom.

        With three freedoms or more one marker is no chart (a trifilar's yaw hardly moves it): of Ξ itself then, scaled.
        """
        free = self._robot.freedoms
        xi = self._mechanism.structure_matrix(positions, rotations)
        if free > 2:
            values = scaled_singular_values(xi)
            return values[:, 0] / values[:, -1]
        choices = [(0,), (1,)] if free == 1 else [(0, 1)]
        worst = [conditioning(xi, marker_selector(rotations, self._robot.marker, axes)) for axes in choices]
        return np.min(worst, axis=0)

    def _swings_well(self, rest: Equilibrium, place: Vector3, displacement: np.ndarray) -> bool:
        """Whether the free motion from there stays taut, within the displacement limits, and well conditioned."""
        try:
            start = displaced(self._mechanism, rest, displacement)
            return all(self._stays_well(self._swing(start, horizon), rest, place) for horizon in HORIZONS)
        except InfeasibleError:
            return False

    def _swing(self, start: Pose, horizon: float) -> FreeMotion:
        times = np.arange(0.0, min(horizon, self._taste.seconds) + 1e-9, SAMPLE)
        return simulate_free_motion(self._mechanism, self._robot.nominal, start, np.zeros(6), times, STEP)

    def _stays_well(self, free: FreeMotion, rest: Equilibrium, place: Vector3) -> bool:
        robot, taste, motion = self._robot, self._taste, free.motion
        if free.slack_time is not None:
            return False
        at_rest = rest.tensions_in_newton(robot.mass)
        tension = at_rest + (1.0 + taste.swing_margin) * (free.tensions * robot.mass - at_rest)
        low, high = robot.limits.tension
        marker = motion.positions + motion.rotations @ robot.marker
        moved = np.abs(marker - place)[:, :2].max(axis=0)
        return bool(
            tension.min() > taste.taut * low
            and tension.max() < taste.tight * high
            and np.all(moved <= robot.limits.free_displacement)
            and self._conditionings(motion.positions, motion.rotations).max() < taste.conditioning_in_motion
        )


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
