"""Visit each planned equilibrium and compare every tension with its limits; no displacement, no recording.

For a new robot, or after a cable was changed: an hour before an identification, this takes minutes.
"""

from collections.abc import Generator

from fidim_lab.data.records import Plan, Robot
from procedures.control import Retried, Skipped
from procedures.outcomes import Outcome
from procedures.protocols.beginning import begin, compared
from procedures.protocols.identify import Route, straight
from procedures.settings import Settings
from procedures.steps import CheckTension, GiveUp, Hold, Lengths, MoveTo, Note, Result, Settle, Step, Steps


def tension_check(plan: Plan, robot: Robot, settings: Settings | None = None, route: Route = straight) -> Steps:
    """The steps. Raises InfeasibleError (from `route`) where no safe way to an equilibrium is known.

    Every place gets its verdict; one whose tensions are wrong does not end the run, the limits of the guards do.
    """
    settings = settings or Settings()
    at = yield from begin(robot.n, settings)
    for planned in plan.windows:
        goal = tuple(float(length) for length in planned.lengths)
        try:
            for lengths in route(at, goal) if at else (goal,):
                yield _move(planned.id, at, lengths, goal, settings)
                at = lengths
            result = yield from _rest(planned.id, robot, settings)
        except (Skipped, Retried) as word:
            yield GiveUp(window=planned.id, outcome=Outcome.SKIPPED, reason=word.reason)
            at = (yield Hold(window=planned.id)).values
        else:
            yield GiveUp(window=planned.id, outcome=result.outcome, reason=result.reason or _text(result))


def _rest(window: str, robot: Robot, settings: Settings) -> Generator[Step, Result, Result]:
    motion, tension = settings.motion, settings.tension
    settled = yield Settle(
        window=window, tolerance=motion.settle_tolerance, over=motion.settle_over, timeout=motion.settle_timeout
    )
    if not settled.outcome.usable:
        yield Note(window=window, remark=f"measured although the platform moves: {settled.reason}")
    yield Hold(window=window)
    if settled.outcome.usable:
        yield from compared(window, settled.values, settings)
    return (
        yield CheckTension(window=window, limits=robot.limits.tension, tolerance=tension.tolerance, over=tension.over)
    )


def _move(window: str, start: Lengths, lengths: Lengths, goal: Lengths, settings: Settings) -> MoveTo:
    motion = settings.motion
    return MoveTo(
        window=window,
        lengths=lengths,
        start=start or None,
        speed=motion.speed,
        acceleration=motion.acceleration,
        tolerance=motion.position_tolerance,
        way_point=lengths != goal,
    )


def _text(result: Result) -> str:
    """Of what was measured, or of the step in a list of what will be done."""
    seen = " ".join(f"{value:.1f}" for value in result.values)
    return f"tensions {seen} N" if seen else "note the tensions: nothing is recorded here"
