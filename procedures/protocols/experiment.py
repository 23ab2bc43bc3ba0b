"""A procedure on a robot, checked: `checked_experiment` makes one from a plan and a generator of steps."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeVar

from fidim_lab.data.records import Plan, Robot, Role
from fidim_lab.errors import FileError
from procedures.expected.limits import RestLimits, Statics, beyond_limits, check_moves, find_route, way_points
from procedures.expected.nominal_rest import NominalRest
from procedures.protocols.listing import Outline
from procedures.recording.resumption import Resumption
from procedures.recording.run_folder import check_window_ids
from procedures.settings import Settings
from procedures.steps import Lengths, Procedure, Step, Steps

T = TypeVar("T")

Route = Callable[[Lengths, Lengths], tuple[Lengths, ...]]
"""(from, to) → the lengths to move to one after another, the last being `to`; raises InfeasibleError without a way"""


def straight(_start: Lengths, goal: Lengths) -> tuple[Lengths, ...]:
    """The direct way."""
    return (goal,)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A procedure and its robot."""

    name: str
    robot: Robot
    procedure: Procedure
    roles: Mapping[str, Role]
    """of the planned windows, in order"""
    workspace: RestLimits
    settings: Settings
    rest: NominalRest | None = None
    """where the platform should rest; None: not known, nothing is compared with it"""


class Memory:
    """Answers that the readings of one procedure share: it is listed, checked and carried out by the same model."""

    def __init__(self) -> None:
        self._known: dict[Hashable, Any] = {}

    def once(self, key: Hashable, compute: Callable[[], T]) -> T:
        """`compute()`, only the first time that the key is asked for."""
        if key not in self._known:
            self._known[key] = compute()
        return self._known[key]


@dataclass(frozen=True, eq=False)
class Lab:
    """The input of a procedure: the remaining windows of the plan, the robot, the settings, and safe moves."""

    plan: Plan
    robot: Robot
    settings: Settings = field(default_factory=Settings)
    route: Route = straight
    attempts: Mapping[str, int] = field(default_factory=dict[str, int])
    """recordings that an earlier process made, by window: numbers go on after them"""
    done: AbstractSet[str] = frozenset()
    """windows that have their verdict from an earlier process"""
    recorded: int = 0
    """windows to identify from that an earlier process has kept"""
    swings: bool = False
    """an earlier process has not seen the platform at rest again"""
    memory: Memory = field(default_factory=Memory)
    beyond: Callable[[Step], Sequence[str]] = lambda step: ()
    """what of a step leaves the limits of robot and winches"""


Make = Callable[[Lab], Steps]


def checked_experiment(
    make: Make,
    plan: Plan,
    robot: Robot,
    settings: Settings | None = None,
    statics: Statics | None = None,
    resumption: Resumption | None = None,
    own: Path | None = None,
) -> Experiment:
    """The steps that `make` yields for a plan, their limits checked (some seconds; the robot is not needed).

    statics: tensions at rest; by the nominal model unless given. resumption: what an earlier process has done of it.
    own: the file that the steps are from, where they are of somebody's own.
    Raises InfeasibleError naming window, cable, value and what is allowed where the plan, or every way between two of
    its equilibria, leaves the limits; SetupError for a window that cannot be a file.
    """
    settings = settings or Settings()
    check_window_ids([window.id for window in plan.windows])
    rest = NominalRest(robot)
    workspace = RestLimits(robot, statics or rest.tensions, settings.motion.length_limits)
    via = lru_cache(partial(way_points, robot, plan))

    def route(start: Lengths, goal: Lengths) -> tuple[Lengths, ...]:
        return find_route(workspace, start, goal, via)

    left = plan if resumption is None else resumption.left_of(plan)
    beyond = partial(beyond_limits, robot=robot, workspace=workspace, motion=settings.motion)
    lab = Lab(left, robot, settings, route, beyond=beyond)
    if resumption is not None:
        known = {"attempts": resumption.attempts, "recorded": resumption.recorded, "swings": resumption.swings}
        lab = replace(lab, done=frozenset(resumption.rows), **known)
    procedure: Procedure = partial(make, lab)
    outline = Outline(procedure)
    check_moves(outline.steps, robot, workspace, settings.motion)
    if own is not None and outline.without_verdict:
        raise FileError(
            own,
            "procedure",
            f"leaves {', '.join(outline.without_verdict)} without a verdict.",
            hint="Yield Accept after Record and CheckWindow, or GiveUp, for each window (docs/procedures.md).",
        )
    roles = {window.id: window.role for window in plan.windows}
    return Experiment(plan.name, robot, procedure, roles, workspace, settings, rest if statics is None else None)
