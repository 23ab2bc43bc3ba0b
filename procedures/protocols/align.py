"""The delay of motion capture against the encoders, measured while the platform goes up and down.

The plan has one window, the place. What comes out is alignment.toml of the run, is kept beside the rig file
(RIG.alignment.toml) and goes with every campaign that is recorded from then on: its lengths and currents are read at
the instants at which the cameras saw the markers. The free motion of identification itself, with locked winches, does
not need it; poses from the robot's own sensors, excitation and what is told by motor currents do.
"""

from functools import partial

import numpy as np

from fidim_lab.data.records import Plan, Robot
from fidim_lab.errors import SetupError
from fidim_lab.model.closure import Closure
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.marker_lag import jog_signal
from fidim_lab.model.mechanism import Mechanism
from procedures.protocols.beginning import begin, compared
from procedures.protocols.identify import Route, straight
from procedures.settings import Settings
from procedures.steps import Lengths, MoveTo, Settle, Steps
from procedures.steps.align import Jog, Told

UP = np.array([0.0, 0.0, 1.0])


def align(plan: Plan, robot: Robot, settings: Settings | None = None, route: Route = straight) -> Steps:
    """The steps.

    Raises SetupError for a plan with more than one window or markers and lengths that have too little in common,
    InfeasibleError where the platform cannot rest at either end.
    """
    settings = settings or Settings()
    if len(plan.windows) != 1:
        raise SetupError(
            f"Plan {plan.name!r} has {len(plan.windows)} windows; clocks are compared at one place.",
            hint="Give a plan of one window, where there is room to go up and down.",
        )
    (place,) = plan.windows
    mechanism = Mechanism(robot)
    rest = equilibrium_at(mechanism, robot.nominal, place.position)
    up, down = (
        equilibrium_at(
            mechanism, robot.nominal, place.position + side * settings.align.amplitude * UP, rest.pose
        ).lengths
        for side in (1.0, -1.0)
    )
    middle = np.asarray(place.lengths)  # the lengths of the plan count, not those of the model
    ends = (_told(middle + 0.5 * (up - down)), _told(middle - 0.5 * (up - down)))
    return _steps(robot.n, place.id, ends, jog_signal(mechanism, robot, rest.pose, up - down), settings, route)


def _steps(
    n: int, window: str, ends: tuple[Lengths, Lengths], signal: Closure, settings: Settings, route: Route
) -> Steps:
    motion, wanted = settings.motion, settings.align
    usual = partial(MoveTo, window=window, tolerance=motion.position_tolerance)
    here = yield from begin(n, settings, attended=False)
    at = here or None
    for goal in route(here, ends[0]) if here else (ends[0],):
        yield usual(lengths=goal, start=at, speed=motion.speed, acceleration=motion.acceleration)
        at = goal
    yield usual(lengths=ends[1], start=ends[0], speed=wanted.speed, acceleration=wanted.acceleration)
    # what still swings afterwards does not matter much
    settled = yield Settle(
        window=window, tolerance=motion.settle_tolerance, over=motion.settle_over, timeout=motion.settle_timeout
    )
    if settled.outcome.usable:
        yield from compared(window, settled.values, settings)
    found = yield Jog(
        window=window,
        ends=ends,
        signal=signal,
        duration=wanted.seconds,
        speed=wanted.speed,
        acceleration=wanted.acceleration,
        tolerance=motion.position_tolerance,
        sd=wanted.sd,
    )
    yield Told(window=window, outcome=found.outcome, reason=found.reason)


def _told(lengths: np.ndarray) -> Lengths:
    return tuple(round(float(length), 6) for length in lengths)
