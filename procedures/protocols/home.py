"""The encoders' zeros, from a known pose (a jig, a place measured by hand) or one measured by markers.

Nothing moves and no drive has power: the platform stands on a jig, or hangs on its brakes. With `Settings.home.taut`
slack is taken up by torque first, the platform fixed, and the counts are taken while the motors pull. The plan has one
window: its `pose` where the platform is put there, else its `lengths`; a robot with three or more markers measures its
pose itself where `Settings.home.by_markers` says so. What comes out is kept in RIG.home.toml.
"""

from collections.abc import Generator

import numpy as np

from fidim_lab.data.records import PlannedWindow, Robot
from fidim_lab.errors import SetupError
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome
from procedures.protocols.beginning import ask_without_power, only_place
from procedures.protocols.experiment import Lab
from procedures.protocols.take_up import ask_for_motion, power_taken, taken_up
from procedures.settings import HomeSettings, Settings
from procedures.steps import (
    AskWithoutPower,
    Configure,
    GiveUpWithoutPower,
    Lengths,
    MeasurePose,
    Result,
    SetLengths,
    Step,
    Steps,
)

ENOUGH_MARKERS = 3
"""not on one line: fewer leave the pose open"""


def home(lab: Lab) -> Steps:
    """The steps.

    Raises SetupError for a plan with more than one window, or for markers that do not tell a pose.
    """
    place = only_place(lab.plan, "homing is done")
    if lab.settings.home.by_markers:
        _require_markers(lab.robot)
    return _home(place, lab.robot, lab.settings)


def known_lengths(place: PlannedWindow, robot: Robot) -> Lengths:
    """(n,) m: of the window's pose where it has one (Eq. 3), else the window's own."""
    if place.pose is None:
        return tuple(float(length) for length in place.lengths)
    lengths = Mechanism(robot).lengths(place.pose.position[None], place.pose.rotation[None])
    return tuple(float(length) for length in lengths[0])


def _home(place: PlannedWindow, robot: Robot, settings: Settings) -> Steps:
    yield Configure(window=place.id)
    if (yield _ask(place, settings)).answer != "done":
        yield GiveUpWithoutPower(window=place.id, outcome=Outcome.ABORTED, reason="left unchanged by the operator")
        return
    home = settings.home
    if home.taut:
        if (yield ask_for_motion(place, settings)).answer != "done":
            yield GiveUpWithoutPower(window=place.id, outcome=Outcome.ABORTED, reason="left unchanged by the operator")
            return
        yield from taken_up(place, robot, settings)
    if home.by_markers:
        lengths = yield from _measured(place, home)
        if lengths is None:
            return
    else:
        lengths = known_lengths(place, robot)
    result = yield SetLengths(window=place.id, lengths=lengths, over=home.over, still=home.encoder_still)
    if home.taut:
        yield power_taken(place, settings)
    changes = ", ".join(f"{change * 1e3:+.1f}" for change in result.values)
    said = result.reason or (f"lengths changed by {changes} mm" if changes else "")
    yield GiveUpWithoutPower(window=place.id, outcome=result.outcome, reason=said)


def _measured(place: PlannedWindow, home: HomeSettings) -> Generator[Step, Result, Lengths | None]:
    """The lengths of the measured pose; None where it is none."""
    measured = yield MeasurePose(window=place.id, over=home.over, still=home.still, misfit=home.misfit)
    if not measured.outcome.usable:
        yield GiveUpWithoutPower(window=place.id, outcome=measured.outcome, reason=measured.reason)
        return None
    return measured.values


def _ask(place: PlannedWindow, settings: Settings) -> AskWithoutPower:
    where = " ".join(f"{value:.3f}" for value in place.position)
    slack = settings.home.taut
    if settings.home.by_markers:
        cables = "" if slack else " and cables taut"
        text = f"Is the platform at rest, near marker position {where} m, with all markers in sight{cables}?"
    else:
        cables = "" if slack else ", with all cables taut"
        text = f"Is the platform exactly at the known place (main marker at {where} m){cables}?"
    return ask_without_power(place.id, text, settings)


def _require_markers(robot: Robot) -> None:
    places = np.array(robot.markers, dtype=float)
    flat = len(places) < ENOUGH_MARKERS or np.linalg.matrix_rank(places[1:] - places[0], tol=1e-3) < 2
    if flat:
        raise SetupError(
            f"The robot file has {len(places)} marker(s); a pose is measured by {ENOUGH_MARKERS} or more, not on one "
            "line.",
            hint="Add extra_markers to it, or home at a known pose.",
        )
