"""The check before any motion: every equilibrium, and every move between, against the limits, by the nominal model.

`RestLimits` answers for lengths; `check_moves` reads the steps of a procedure; `find_route` leads around forbidden ways
by way of lengths that are known to be safe.
"""

import heapq
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

import numpy as np

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Plan, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.kinematics import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from procedures.settings import MotionSettings
from procedures.steps import Ask, Lengths, MoveTo, Step, longest_way
from procedures.steps.excitation import Strokes

Statics = Callable[[PerCable], PerCable]
"""(n,) cable lengths, m → (n,) tensions at rest, N; raises InfeasibleError where there is no equilibrium"""

SPACING = 0.03
"""m of the longest way between two checked points"""
SLACK = 0.005
"""part of a tension limit that is forgiven: plans sit on the limit and are rounded to 0.01 mm"""


class RestLimits:
    """Where the robot may be at rest: tensions by the nominal model and cable lengths within limits.

    What is not allowed is a sentence without its full stop. Answers are remembered: plans, routes and the run ask the
    same questions.
    """

    def __init__(
        self, robot: Robot, statics: Statics, length_limits: Sequence[tuple[float, float]] | None = None
    ) -> None:
        self._tension = robot.limits.tension
        self._statics = statics
        self._length_limits = length_limits
        self._points: dict[Lengths, str | None] = {}
        self._ways: dict[tuple[Lengths, Lengths], str | None] = {}

    def at(self, lengths: Lengths) -> str | None:
        """Why the robot must not rest at these lengths (m); None if it may."""
        if lengths not in self._points:
            self._points[lengths] = self._judge(lengths)
        return self._points[lengths]

    def between(self, start: Lengths, end: Lengths) -> str | None:
        """Why the straight line between two length sets, ends included, must not be taken; None if it may."""
        key = (start, end) if start <= end else (end, start)
        if key not in self._ways:
            self._ways[key] = self._first_violation(*key)
        return self._ways[key]

    def require(self, start: Lengths | None, end: Lengths, what: str) -> None:
        """Raise InfeasibleError, naming `what` is to be done, where the way is not allowed."""
        wrong = self.at(end)
        if wrong is not None:
            raise InfeasibleError(f"{what}: {wrong}.", hint="Nothing was moved. Choose other lengths for it.")
        wrong = None if start is None else self.between(start, end)
        if wrong is not None:
            raise InfeasibleError(f"{what}, on the way to it: {wrong}.", hint="Go there through another pose.")

    def _judge(self, lengths: Lengths) -> str | None:
        for cable, (length, (low, high)) in enumerate(zip(lengths, self._length_limits or (), strict=False), start=1):
            if not low <= length <= high:
                return f"cable {cable} would be {length:.3f} m long, its winch allows {low:.3f} to {high:.3f} m"
        try:
            tensions = self._statics(np.array(lengths))
        except InfeasibleError as error:
            return f"no equilibrium: {error.message.rstrip('.')}"
        low, high = self._tension
        for cable, tension in enumerate(tensions, start=1):
            if not low * (1 - SLACK) <= tension <= high * (1 + SLACK):
                return (
                    f"cable {cable} would have {tension:.1f} N by the nominal model, {low:g} to {high:g} N is allowed"
                )
        return None

    def _first_violation(self, start: Lengths, end: Lengths) -> str | None:
        points = max(2, 1 + round(longest_way(start, end) / SPACING))
        for part in np.linspace(0.0, 1.0, points):
            here = tuple(float(a + part * (b - a)) for a, b in zip(start, end, strict=True))
            if (wrong := self.at(here)) is not None:
                return f"at lengths {_text(here)} m {wrong}"
        return None


def check_moves(
    steps: Iterable[Step], robot: Robot, workspace: RestLimits, motion: MotionSettings | None = None
) -> None:
    """Refuse a procedure that leaves the workspace anywhere, or exceeds the limits of a winch.

    motion: with what the winches may do. Raises InfeasibleError naming all steps that do.
    """
    motion = motion or MotionSettings()
    _refuse(
        [
            f"step {number}, {wrong}"
            for number, step in enumerate(steps, start=1)
            for wrong in beyond_limits(step, robot, workspace, motion)
        ]
    )


def beyond_limits(step: Step, robot: Robot, workspace: RestLimits, motion: MotionSettings) -> list[str]:
    """What of a step leaves the workspace, or exceeds the limits of a winch: sentences without their full stop."""
    found = (*_wrong(step, robot, workspace), *_too_fast(step, motion))
    return [f"window {step.window or '–'}, {step.text}: {wrong}" for wrong in found]


def check_displacements(plan: Plan, robot: Robot) -> None:
    """Refuse a plan that displaces the platform farther than the robot file allows. Raises InfeasibleError.

    For a procedure whose steps are planned for what can be reached, so that they do not show what was wanted.
    """
    _refuse(
        [
            f"window {window.id}, {wrong}"
            for window in plan.windows
            for wrong in _too_far(tuple(map(float, window.displacement)), robot)
        ]
    )


def _refuse(found: Sequence[str]) -> None:
    """Raise InfeasibleError where anything is."""
    if not found:
        return
    more = f" (and {len(found) - 4} more)" if len(found) > 4 else ""
    raise InfeasibleError(
        "The plan exceeds the robot's limits: " + "; ".join(found[:4]) + more + ".",
        hint="Nothing was moved. Change these windows in the plan.",
    )


def _wrong(step: Step, robot: Robot, workspace: RestLimits) -> list[str]:
    match step:
        case MoveTo():
            wrong = [workspace.at(step.lengths)]
            if wrong == [None] and step.start is not None:
                wrong = [workspace.between(step.start, step.lengths)]
        case Strokes():
            targets = dict.fromkeys(target for chain in step.chains for target in chain.targets)
            beyond = (workspace.between(step.lengths, target) for target in targets)
            wrong = [next(filter(None, beyond), None), *_too_far(step.displacement, robot)]
        case Ask():
            wrong = _too_far(step.prompt.displacement, robot)
        case _:
            wrong = []
    return [one for one in wrong if one is not None]


def _too_fast(step: Step, motion: MotionSettings) -> list[str]:
    """Of any step with a speed or an acceleration: a drive would refuse it in the middle of a run, or clip it."""
    asked = (
        ("speed", "m/s", motion.highest_speed),
        ("acceleration", "m/s²", motion.highest_acceleration),
    )
    return [
        f"{name} is {value:g} {unit}, "
        + (f"the rig's winches may do up to {most:g} {unit}" if most is not None and value > 0 else "more than 0")
        for name, unit, most in asked
        if (value := getattr(step, name, None)) is not None and not 0 < value <= (math.inf if most is None else most)
    ]


def _too_far(displacement: Sequence[float], robot: Robot) -> list[str]:
    return [
        f"displacement {axis} is {wanted:.3f} m, at most {allowed:.3f} m is allowed"
        for axis, wanted, allowed in zip("xy", displacement, robot.limits.free_displacement, strict=False)
        if abs(wanted) > allowed
    ]


def find_route(
    workspace: RestLimits, start: Lengths, goal: Lengths, via: Callable[[], Sequence[Lengths]]
) -> tuple[Lengths, ...]:
    """The shortest safe way from `start` to `goal`: straight where allowed, else by way of some of `via`.

    Returns the length sets to move to one after another, the last being `goal`; the direct way, too, where one of its
    ends is forbidden itself, which `check_moves` and the move then say better. `via` is asked for only when needed.
    Raises InfeasibleError naming what stands in the direct way where there is no other.
    """
    direct = workspace.between(start, goal)
    if direct is None or workspace.at(start) is not None or workspace.at(goal) is not None:
        return (goal,)
    places = (*via(), goal)
    # A* whose edges are checked only when their turn comes: a check costs some 50 ms, a candidate nothing.
    order = itertools.count()
    queue: list[tuple[float, int, float, tuple[Lengths, ...]]] = [(0.0, next(order), 0.0, (start,))]
    done: set[Lengths] = set()
    while queue:
        _, _, way, path = heapq.heappop(queue)
        here = path[-1]
        if here in done or (len(path) > 1 and workspace.between(path[-2], here) is not None):
            continue
        if here == goal:
            return path[1:]
        done.add(here)
        for there in places:
            if there not in done:
                far = way + longest_way(here, there)
                heapq.heappush(queue, (far + longest_way(there, goal), next(order), far, (*path, there)))
    raise InfeasibleError(
        f"No safe path from lengths {_text(start)} to {_text(goal)} m: {direct}.",
        hint="Add a window between them to the plan, or start from another pose.",
    )


def way_points(robot: Robot, plan: Plan, per_axis: int = 3) -> tuple[Lengths, ...]:
    """Intermediate places: the plan's own equilibria, and a grid over the box they span (about 10 ms each).

    Places where the platform cannot rest within the robot's limits are left out.
    """
    positions = np.array([window.position for window in plan.windows])
    axes = np.linspace(positions.min(axis=0), positions.max(axis=0), per_axis).T
    mechanism = Mechanism(robot)
    found = [tuple(float(length) for length in window.lengths) for window in plan.windows]
    for place in itertools.product(*axes):
        with suppress(InfeasibleError):
            rest = equilibrium_at(mechanism, robot.nominal, np.array(place))
            found.append(tuple(float(length) for length in rest.lengths))
    return tuple(found)


def _text(lengths: Lengths) -> str:
    return " ".join(f"{length:.3f}" for length in lengths)
