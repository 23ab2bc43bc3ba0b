"""Visit each planned equilibrium and compare every tension with its limits; no displacement, no recording.

For a new robot, or after a cable was changed: an hour before an identification, this takes minutes.
"""

from collections.abc import Generator

from fidim_lab.data.records import Robot
from procedures.control import Retried, Skipped
from procedures.outcomes import Outcome
from procedures.protocols.beginning import begin, compared, settling
from procedures.protocols.experiment import Lab
from procedures.protocols.identify import WindowProtocol
from procedures.settings import Settings
from procedures.steps import CheckTension, GiveUp, Hold, Note, Result, Step, Steps


def tension_check(lab: Lab) -> Steps:
    """The steps. Raises InfeasibleError (from `Lab.route`) where no safe way to an equilibrium is known.

    Every place gets its verdict; one whose tensions are wrong does not end the run, the limits of the guards do.
    """
    protocol = WindowProtocol(lab)
    at = yield from begin(lab.robot.n, lab.settings)
    for planned in lab.plan.windows:
        try:
            at = yield from protocol.go(planned, at)
            result = yield from _rest(planned.id, lab.robot, lab.settings)
        except (Skipped, Retried) as word:
            yield GiveUp(window=planned.id, outcome=Outcome.SKIPPED, reason=word.reason)
            at = (yield Hold(window=planned.id)).values
        else:
            yield GiveUp(window=planned.id, outcome=result.outcome, reason=result.reason or _text(result))


def _rest(window: str, robot: Robot, settings: Settings) -> Generator[Step, Result, Result]:
    settled = yield settling(window, settings)
    if not settled.outcome.usable:
        yield Note(window=window, remark=f"measured although the platform moves: {settled.reason}")
    yield Hold(window=window)
    if settled.outcome.usable:
        yield from compared(window, settled.values, settings)
    tension = settings.tension
    return (
        yield CheckTension(window=window, limits=robot.limits.tension, tolerance=tension.tolerance, over=tension.over)
    )


def _text(result: Result) -> str:
    """Of what was measured, or of the step in a list of what will be done."""
    seen = " ".join(f"{value:.1f}" for value in result.values)
    return f"tensions {seen} N" if seen else "note the tensions: nothing is recorded here"
