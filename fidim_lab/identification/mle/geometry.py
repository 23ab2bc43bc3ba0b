"""A fit with the geometry as its survey leaves it, and whether the recordings ask for that.

Where the robot file states its survey, that is the prior. Where it states nothing, two models are weighed by their
evidence: the file's geometry to the micrometre, and a usual survey whose standard deviations are multiplied by a common
factor that the evidence chooses too. Evidence is Laplace's: half the fall of the sum of squares, prior included, less
the Occam factor ½ ln det(I + prior covariance × information). Where the model misses more than noise (χ²/dof above 1)
residuals are no independent samples: the data's part of both is divided by χ²/dof.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Window
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.linearised import Linearised
from fidim_lab.identification.mle.trajectories.likelihood import Point
from fidim_lab.identification.mle.trajectories.normal import Prior
from fidim_lab.identification.mle.trajectories.optimise import FINAL, Effort
from fidim_lab.identification.mle.warm_start import gone_on
from fidim_lab.identification.survey import Nuisance, prior_sd, stated, usual
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

ODDS = 3.0
"""nats of evidence (odds of 20) by which either of the two must lead before the file's geometry is called exact or
not; between them the geometry is left open, which only widens the standard deviations"""
FACTORS = np.geomspace(0.1, 30.0, 50)
"""times a usual survey: what robot files are off by, from a tenth of a millimetre to three centimetres"""
SPREAD_OF_FACTORS = np.log(3.0)
"""standard deviation of the factor's logarithm about 0, before any data: two of three surveys are within a factor 3"""
GLANCE = replace(FINAL, rounds=0)
"""one simulation with derivatives, no step"""
SAME = 1.3
"""factors nearer than this change standard deviations by less than the spread of 24 draws tells"""


@dataclass(frozen=True, eq=False)
class Surveyed:
    """A fit whose geometry has its own prior, and what the recordings say of it."""

    found: Fit
    geometry: tuple[Nuisance, ...] = ()
    """what was left open; nothing where the geometry counts as exact"""
    chi2_gain: float = 0.0
    """by how much the sum of squares falls with an open geometry, in units of χ²/dof; 0 where that was not tried"""
    log_bayes: float | None = None
    """evidence of the open geometry over the exact one, nats; None where the survey is stated"""
    factor: float = 1.0
    """times a usual survey, chosen by evidence where the file states none"""


def begin_surveyed(mechanism: Mechanism, windows: list[Window]) -> Fit:
    """The first fit of body and geometry: with the survey that the file states, else with its geometry as it stands.

    Raises RefusedError as `fit`.
    """
    opened = stated(mechanism.robot)
    return _opened(mechanism, windows, opened) if opened else fit(mechanism, windows)


def fit_surveyed(begun: Fit, windows: list[Window]) -> Surveyed:
    """What `begin_surveyed` found; where the file states no survey, with what the recordings say of it (see above)."""
    robot = begun.likelihood.mechanism.robot
    return _weighed(begun, windows) if robot.survey is None else Surveyed(begun, stated(robot))


def _weighed(exact: Fit, windows: list[Window]) -> Surveyed:
    """The exact geometry against a usual survey."""
    robot = exact.likelihood.mechanism.robot
    opened = usual(robot)
    begun = continued(exact, opened, GLANCE)
    if begun is not None and exact.settled:
        foretold = _evidence(exact, begun, opened)
        if foretold.log_bayes < -ODDS:
            return Surveyed(exact, (), foretold.gain, foretold.log_bayes)
    found = continued(begun, opened) if begun is not None and not exact.journey.lost else None
    found = _opened(exact.likelihood.mechanism, windows, opened) if found is None else found
    weighed = _evidence(exact, found, opened)
    if not 1 / SAME < weighed.factor < SAME:
        opened = usual(robot, weighed.factor)
        found = continued(found, opened) or found
    if weighed.log_bayes < -ODDS or (exact.settled and not found.settled):
        return Surveyed(exact, (), weighed.gain, weighed.log_bayes)
    return Surveyed(found, opened, weighed.gain, weighed.log_bayes, weighed.factor)


def _opened(mechanism: Mechanism, windows: list[Window], opened: tuple[Nuisance, ...]) -> Fit:
    return fit(with_geometry(mechanism, opened), windows, theta_sd=prior_sd(opened))


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

    The geometry stands behind the fit's own effects. One that is open already keeps its values and takes the new
    standard deviations.
    """
    before = found.likelihood
    sd = prior_sd(opened)
    nowhere = np.zeros(len(sd))
    is_open = before.mechanism.effects[-len(opened) :] == tuple(one.effect for one in opened)
    kept = len(found.values) - (len(sd) if is_open else 0)
    values = np.concatenate([found.values, nowhere])[: kept + len(sd)]
    mechanism = before.mechanism if is_open else with_geometry(before.mechanism, opened)
    likelihood = replace(before, mechanism=mechanism)
    plausible = np.concatenate([found.plausible[:kept], sd])
    mean, spread = found.prior.mean[:kept], found.prior.sd[:kept]
    prior = Prior(np.concatenate([mean, nowhere]), np.concatenate([spread, sd]), firm=kept)
    return gone_on(found, likelihood, Point(values, found.journey.optimum.point.states), prior, plausible, effort)


@dataclass(frozen=True)
class _Evidence:
    """An open geometry against the exact one."""

    log_bayes: float
    """nats, averaged over the factor's prior"""
    factor: float
    """the most likely"""
    gain: float
    """fall of the sum of squares over χ²/dof of the open geometry"""


def _evidence(exact: Fit, found: Fit, opened: tuple[Nuisance, ...]) -> _Evidence:
    """From the linearised problem at a point of the open geometry; see the module."""
    problem, survey = _linearised(found), prior_sd(opened)
    before = _cost(exact)
    gains, evidences = np.zeros(len(FACTORS)), np.zeros(len(FACTORS))
    for k, factor in enumerate(FACTORS):
        there, temper = problem.settled(factor * survey)
        gains[k] = (before - there.left) / temper
        evidences[k] = 0.5 * (gains[k] - there.strain - there.occam + problem.occam_of_body(temper))
    log_bayes, best = over_factors(evidences)
    return _Evidence(log_bayes, float(FACTORS[best]), float(gains[best]))


def over_factors(evidences: Float[np.ndarray, " F"]) -> tuple[float, int]:
    """Evidence averaged over the prior of `FACTORS`, and which of them is the most likely."""
    weights = -0.5 * (np.log(FACTORS) / SPREAD_OF_FACTORS) ** 2
    average = float(np.logaddexp.reduce(evidences + weights) - np.logaddexp.reduce(weights))
    return average, int(np.argmax(evidences + weights))


def _linearised(found: Fit) -> Linearised:
    dof = sum(left.dof for left in found.remainders)
    return Linearised.of(found.tables, _cost(found), dof, found.values[BODY:])


def _cost(found: Fit) -> float:
    """Of markers, lengths and the windows' own priors: what the shared parameters' prior adds is counted apart."""
    return found.journey.optimum.simulation.cost
