"""The delay of motion capture against the encoders, measured while the platform goes up and down.

The plan has one window, the place. What comes out is alignment.toml of the run, is kept beside the rig file
(RIG.alignment.toml) and goes with every campaign that is recorded from then on: its lengths and currents are read at
the instants at which the cameras saw the markers. The free motion of identification itself, with locked winches, does
not need it; poses from the robot's own sensors, excitation and what is told by motor currents do.
"""

from functools import partial

import numpy as np

from fidim_lab.model.closure import Closure
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.marker_lag import jog_signal
from fidim_lab.model.mechanism import Mechanism
from procedures.protocols.beginning import begin, compared, only_place, settling
from procedures.protocols.experiment import Lab
from procedures.steps import Lengths, MoveTo, Steps
from procedures.steps.align import Jog, Told

UP = np.array([0.0, 0.0, 1.0])


def align(lab: Lab) -> Steps:
    """The steps.

    Raises SetupError for a plan with more than one window or markers and lengths that have too little in common,
    InfeasibleError where the platform cannot rest at either end.
    """
    robot, settings = lab.robot, lab.settings
    hint = "Give a plan of one window, where there is room to go up and down."
    place = only_place(lab.plan, "clocks are compared", hint)
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
    return _steps(lab, place.id, ends, jog_signal(mechanism, robot, rest.pose, up - down))


def _steps(lab: Lab, window: str, ends: tuple[Lengths, Lengths], signal: Closure) -> Steps:
    settings = lab.settings
    motion, wanted = settings.motion, settings.align
    usual = partial(MoveTo, window=window, tolerance=motion.position_tolerance)
    here = yield from begin(lab.robot.n, settings, attended=False)
    at = here or None
    for goal in lab.route(here, ends[0]) if here else (ends[0],):
        yield usual(lengths=goal, start=at, speed=motion.speed, acceleration=motion.acceleration)
        at = goal
    yield usual(lengths=ends[1], start=ends[0], speed=wanted.speed, acceleration=wanted.acceleration)
    # what still swings afterwards does not matter much
    settled = yield settling(window, settings)
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
