"""From windows that only a gyroscope shows to an IdentificationResult by maximum likelihood.

The same fit as of markers, with angular rates in their place (`trajectories.rate_likelihood`). Beside the body it has
how the gyroscope sits and its scale, the drag that makes a pendulum die away, and the geometry within its survey: a
usual one where the robot file states none, since rates alone do not show that it is off.
"""

from dataclasses import replace
from time import perf_counter

import numpy as np

from fidim_lab.data.own_sensors import has_rates_alone
from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.effects.dissipation.drag import AirDragLinear, RotationalDrag
from fidim_lab.effects.geometry.gyroscope import GyroscopeMount
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.mle import findings, held_out
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.geometry import Surveyed, with_geometry
from fidim_lab.identification.mle.geometry_words import geometry_warnings, told_geometry
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.mle.undetermined import tried_out
from fidim_lab.identification.results.result import IdentificationResult, WindowVerdict
from fidim_lab.identification.survey import prior_sd, stated_or_usual
from fidim_lab.model.mechanism import Mechanism

VARIANT = "angular rates"
"""how a window's motion was measured"""
DRAG = (0.2, 0.02)
"""N s/m and N m s: one standard deviation of linear drag about 0; a plate of 0.5 m in air has a tenth of it"""


def shown_by_rates(campaign: Campaign) -> bool:
    """Whether a gyroscope is all that shows the motions. Raises SetupError where it is in some windows only."""
    alone = [window.id for window in campaign.windows if has_rates_alone(window)]
    if alone and len(alone) < len(campaign.windows):
        raise SetupError(
            f"Windows {', '.join(alone[:3])} have a gyroscope's rates alone, others markers; a fit takes one kind.",
            hint="Make two campaigns of them.",
        )
    return bool(alone)


def identify_by_rates(campaign: Campaign, *, native: bool = False, predict: bool = True) -> IdentificationResult:
    """Identify what the angular rates of the `identify` windows show of the body, judge it on all windows.

    native, predict: as in `mle.identify`. Raises RefusedError where no window can be used.
    """
    begin = perf_counter()
    robot = campaign.robot
    opened = stated_or_usual(robot)
    own = (GyroscopeMount(), AirDragLinear(), RotationalDrag())
    start = [0.0] * (len(GyroscopeMount.SD) + len(DRAG))
    mechanism = with_geometry(Mechanism(robot, own, start, native=native), opened)
    known = np.concatenate([GyroscopeMount.SD, DRAG, prior_sd(opened)])
    found = tried_out(fit(mechanism, campaign.of_role(Role.IDENTIFY), theta_sd=known))
    surveyed = Surveyed(found, opened)
    windows = tuple(_verdict(window, found, predict=predict) for window in campaign.windows)
    figures = figures_of(found, robot.nominal)
    geometry = told_geometry(surveyed)
    outcome = findings.outcome(found, figures, windows)
    told = findings.FitAnswer(
        outcome,
        findings.answer(outcome, found, figures, ""),
        windows,
        (*geometry_warnings(surveyed, geometry, answers=outcome.answers), *findings.warnings(found, figures, windows)),
        noise_ratio=float(np.sqrt(found.excess)),
    )
    return replace(figures.result(campaign.name, robot, told, begin), geometry=geometry)


def _verdict(window: Window, found: Fit, *, predict: bool) -> WindowVerdict:
    ids = [recording.window.id for recording in found.likelihood.recordings]
    if window.id in ids:
        w = ids.index(window.id)
        return _judged(window, found.remainders[w], findings.journey_notes(found.journey, w))
    if window.id in found.unused:
        return _left_out(window, found.unused[window.id])
    if not predict:
        return WindowVerdict(window.id, window.role, used=True, samples=len(window.t), no_sigma=NO_SIGMA)
    try:
        mechanism = found.likelihood.mechanism
        recording = prepare(window, mechanism.robot, rates=True)
        held = held_out.predict(mechanism, found.values, recording, mechanism.robot.sensors)
    except RefusedError as refusal:
        return _left_out(window, str(refusal))
    return _judged(window, held.remainder, findings.journey_notes(held.journey, 0))


NO_SIGMA = "a gyroscope shows no pose, without which there are no equations of motion"


def _left_out(window: Window, why: str) -> WindowVerdict:
    return WindowVerdict(window.id, window.role, used=False, notes=(why,))


def _judged(window: Window, left: Remainder, notes: tuple[str, ...]) -> WindowVerdict:
    return WindowVerdict(
        id=window.id,
        role=window.role,
        used=True,
        variant=VARIANT,
        samples=len(left.t),
        chi2_per_dof=left.chi2_per_dof,
        notes=notes,
        no_sigma=NO_SIGMA,
    )
