"""A fit with the geometry free within its survey, and whether the recordings support that.

Where the robot file states its survey, that is the prior. Where it states nothing, models are weighed by their evidence
(`evidence`): the file's geometry to the micrometre, and a usual survey of the cables (anchors and attachments), of the
markers, or of both. Markers are often put on anew, so each of the two has its own common factor on its standard
deviations, which the evidence chooses too. So has the capture's frame with the direction of gravity in it: where the
recordings show that it is off, it is left open as well. Without it anchors took up a part of a tilt of 3 mrad, and the
body was wrong by 7 to 19 stated ±.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Robot, Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.evidence import ALL_EXACT, NOT_WEIGHED, Factors, GeometryOdds, fall, weighed
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.trajectories.optimise import FINAL, Effort
from fidim_lab.identification.mle.warm_start import Newcomer, rearranged
from fidim_lab.identification.survey import Nuisance, prior_sd, stated, usual, usual_frame, usual_markers
from fidim_lab.model.mechanism import Mechanism

GLANCE = replace(FINAL, rounds=0)
"""one simulation with derivatives, no step"""
ONCE, NO_FRAME = Factors(1.0, 1.0, 1.0), Factors(1.0, 1.0)
HALF = 0.5
"""of the fall of the sum of squares that is foretold, which a fit must reach for an open geometry to be better"""


@dataclass(frozen=True, eq=False)
class Surveyed:
    """A fit whose geometry has its own prior, and what the recordings say of it."""

    found: Fit
    geometry: tuple[Nuisance, ...] = ()
    """what was left open; nothing where the geometry counts as exact"""
    weighed: GeometryOdds = NOT_WEIGHED
    """by evidence where the file states no survey"""
    exact: Fit | None = None
    """with the file's geometry, where another was found better"""


def begin_surveyed(mechanism: Mechanism, windows: list[Window], *, hasty: bool = False) -> Fit:
    """The first fit of body and geometry: with the survey that the file states, else with its geometry as it stands.

    hasty: as `fit`. Raises RefusedError as `fit`.
    """
    opened = stated(mechanism.robot)
    return _opened(mechanism, windows, opened, hasty=hasty) if opened else fit(mechanism, windows, hasty=hasty)


def fit_surveyed(begun: Fit, windows: list[Window]) -> Surveyed:
    """The fit of `begin_surveyed`; without a survey in the file, with the evidence for one (see above)."""
    robot = begun.likelihood.mechanism.robot
    return _weighed(begun, windows, ONCE) if robot.survey is None else Surveyed(begun, stated(robot))


def _weighed(exact: Fit, windows: list[Window], open_once: Factors) -> Surveyed:
    """The exact geometry against a usual survey of cables and markers, and of the frame where it may be open."""
    robot = exact.likelihood.mechanism.robot
    once = _usual(robot, open_once)
    first = NO_FRAME
    begun = continued(exact, once, GLANCE)
    if begun is not None and exact.settled:
        foretold = weighed(exact, begun, once)
        if foretold.factors.exact:
            return Surveyed(exact, (), foretold)
        odds = foretold.factors
        first = Factors(odds.cables or 1.0, odds.markers or 1.0, odds.frame)  # one fit, where that holds
    opened = _usual(robot, first)
    found = None if begun is None else continued(exact, opened)
    found = _opened(exact.likelihood.mechanism, windows, opened) if found is None else found
    says = weighed(exact, found, _usual(robot, ONCE if first.frame else NO_FRAME))
    if first.frame and not found.explained:  # a frame that is far off is not reached at once, but anchors may be
        other = _weighed(exact, windows, NO_FRAME)
        if says.factors.exact or not found.settled or other.found.chi2_per_dof < found.chi2_per_dof:
            return other
    if says.factors.exact or (exact.settled and not found.settled):
        return Surveyed(exact, (), says)
    if not says.factors.near(first):
        chosen = _usual(robot, says.factors)
        again = continued(found, chosen)
        found, opened = (found, opened) if again is None else (again, chosen)
    if says.leads and fall(exact, found) < HALF * says.chi2_gain:  # foretold along what data do not determine
        return Surveyed(exact, (), replace(says, factors=ALL_EXACT))
    return Surveyed(found, opened, says, exact)


def _usual(robot: Robot, factors: Factors) -> tuple[Nuisance, ...]:
    cables = () if factors.cables is None else usual(robot, factors.cables)
    markers = () if factors.markers is None else usual_markers(robot, factors.markers)
    frame = () if factors.frame is None else usual_frame(robot, factors.frame)
    return (*cables, *markers, *frame)


def _opened(mechanism: Mechanism, windows: list[Window], opened: tuple[Nuisance, ...], *, hasty: bool = False) -> Fit:
    return fit(with_geometry(mechanism, opened), windows, theta_sd=prior_sd(opened), hasty=hasty)


def with_geometry(mechanism: Mechanism, opened: tuple[Nuisance, ...]) -> Mechanism:
    """The mechanism with this geometry open, at the file's values, behind its effects."""
    effects, theta = tuple(one.effect for one in opened), np.zeros(len(prior_sd(opened)))
    return Mechanism(
        mechanism.robot,
        (*mechanism.effects, *effects),
        [*mechanism.theta.tolist(), *theta.tolist()],
        native=mechanism.native,
        springs=mechanism.springs,
        quiet=mechanism.quiet,
    )


def continued(found: Fit, opened: tuple[Nuisance, ...], effort: Effort = FINAL) -> Fit | None:
    """A fit gone on from its optimum with this geometry open (about the file's); None where that cannot be simulated.

    The geometry stands behind the fit's own effects. What is open already keeps its values and takes the new standard
    deviations; what was open and is not asked for counts as exact again.
    """
    before = found.likelihood.mechanism
    own = tuple(effect for effect in before.effects if effect not in _geometry(before.robot))
    wanted: list[Newcomer] = []
    for one in opened:
        size = len(one.sd)
        start = found.values[found.place_of(one.effect)].tolist() if one.effect in before.effects else [0.0] * size
        sd = prior_sd((one,)).tolist()
        wanted.append(Newcomer(one.effect, start, sd, [-np.inf] * size, [np.inf] * size, [0.0] * size))
    return rearranged(found, (*own, *wanted), effort)


def _geometry(robot: Robot) -> set[NamedEffect]:
    return {one.effect for one in _usual(robot, ONCE)}
