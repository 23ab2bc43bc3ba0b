"""Slack taken up by torque, one cable after another, with the platform fixed; then the brakes hold.

By itself, or before homing (`Settings.home.taut`). The plan has one window, whose lengths do not matter here.
"""

from collections.abc import Generator

from fidim_lab.data.records import PlannedWindow, Robot
from procedures.outcomes import Outcome
from procedures.protocols.beginning import ask_without_power, only_place
from procedures.protocols.experiment import Lab
from procedures.settings import Settings
from procedures.steps import AskWithoutPower, Configure, GiveUpWithoutPower, Result, Step, Steps
from procedures.steps.taut import TakePower, TakeUp


def take_up(lab: Lab) -> Steps:
    """The steps. Raises SetupError for a plan with more than one window."""
    return _take_up(only_place(lab.plan, "slack is taken up"), lab)


def _take_up(place: PlannedWindow, lab: Lab) -> Steps:
    settings = lab.settings
    yield Configure(window=place.id)
    if (yield ask_for_motion(place, settings)).answer != "done":
        yield GiveUpWithoutPower(window=place.id, outcome=Outcome.ABORTED, reason="left unchanged by the operator")
        return
    taken = yield from taken_up(place, lab.robot, settings)
    held = yield power_taken(place, settings)
    worse = held if not held.outcome.usable else taken
    said = ", ".join(f"{way * 1e3:.0f}" for way in taken.values)
    yield GiveUpWithoutPower(
        window=place.id, outcome=worse.outcome, reason=worse.reason or (f"{said} mm wound" if said else "")
    )


def taken_up(place: PlannedWindow, robot: Robot, settings: Settings) -> Generator[Step, Result, Result]:
    """All cables taut, all winches holding."""
    told = settings.taut
    tension = told.tension or robot.limits.tension[0]
    return (yield TakeUp(window=place.id, tension=tension, speed=told.speed, way=told.way, cables=robot.n))


def power_taken(place: PlannedWindow, settings: Settings) -> TakePower:
    """The step after it."""
    return TakePower(window=place.id, still=settings.hold.still, over=settings.hold.still_for)


def ask_for_motion(place: PlannedWindow, settings: Settings) -> AskWithoutPower:
    """A person's word that slack cables may be wound."""
    text = (
        "The winches will wind slack cable, one after another, until each is taut. Is the platform fixed in its jig or "
        "on its stand, nobody within reach of cables and drums, and the emergency stop at hand?"
    )
    return ask_without_power(place.id, text, settings)
