"""From periods of a pendulum, by stopwatch or light gate, to an IdentificationResult.

Least squares of ln of the periods about what is plausible beforehand: a body that can exist, the nominal one within
`scales`; geometry within its survey (a usual one where the robot file states none) and cords within the tape's error
(`encoder_resolution`) are as linear as noise. Periods determine few of the nine parameters, and some only by their
squares (s_x² of I_zz), so no derivative at the optimum tells the ±: bodies are drawn from what is plausible, readings
from what was measured, each draw is fitted anew, and mean and covariance are those of the fits.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.mle.findings import Figures, FitAnswer, doubtful
from fidim_lab.identification.mle.geometry import with_geometry
from fidim_lab.identification.mle.periods.model import UNNOTED, PeriodModel
from fidim_lab.identification.mle.periods.period_words import CHANCE, Agreement, answer, usual_mistakes, warnings
from fidim_lab.identification.mle.periods.search import Found, searched
from fidim_lab.identification.mle.spread import open_combinations
from fidim_lab.identification.mle.starts.possible import nearest_possible, scales
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    WindowVerdict,
)
from fidim_lab.identification.survey import prior_sd, stated_or_usual
from fidim_lab.model.mechanism import Mechanism

VARIANT, NO_SIGMA = "period", "a period shows no pose, without which there are no equations of motion"
DRAWS = 64
"""fits for mean and covariance: the ± is good to a tenth then, and the mean to an eighth of it"""
STARTS = 16
"""bodies from which the best one is sought"""
MOST = 200
"""times as many bodies are drawn as are wanted; of usual ones a third can exist and hang"""
SEEN = 0.5
"""of the sd beforehand: below it periods know a parameter better than whoever wrote the robot file"""
LOST = 1e-3
"""chance of a fit that is so far from the drawn readings: it found its body in no valley"""
RIVAL = 9.0
"""of the sum of squares, above the best: a hundredth as likely"""
APART = 1.0
"""of the sd beforehand, in one parameter: searches that end so far apart have found two bodies"""


@dataclass(frozen=True, eq=False)
class _Known:
    """What is known beforehand, and what was read, with its errors."""

    model: PeriodModel
    mean: Float[np.ndarray, "9"]
    width: Float[np.ndarray, "9"]
    readings: Float[np.ndarray, " M"]
    covariance: Float[np.ndarray, "M M"]
    """of the readings: noise, amplitudes, geometry and cords"""

    def fitted(self, starts: np.ndarray, readings: np.ndarray, priors: np.ndarray) -> Found:
        """One body for each start."""
        whitener = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return searched(self.model, starts, readings, whitener, priors, self.width)


def identify_by_periods(campaign: Campaign) -> IdentificationResult:
    """Identify what the periods of the campaign show of the body.

    Raises SetupError for lengths at which the body cannot hang, RefusedError where no body like the nominal one has
    these periods.
    """
    begin = perf_counter()
    robot = campaign.robot
    opened = stated_or_usual(robot)
    body = nearest_possible(robot.nominal)
    model = PeriodModel.of(with_geometry(Mechanism(robot), opened), body, campaign.periods)
    refused = model.far_off()
    if refused is not None:
        k, what, hint = refused
        raise RefusedError(f"Period {k + 1}: {what}.", hint=hint)
    geometry = np.concatenate(
        [prior_sd(opened), np.full(robot.n * len(model.hangings), robot.sensors.encoder_resolution)]
    )
    readings, sd = model.measured
    known = _Known(model, body.vector, scales(body), readings, np.diag(sd**2))
    known = _with_geometry(known, body.vector, geometry)
    rng = np.random.default_rng(1)
    before = _existing(known, rng)
    best, rivals = _best(known, before)
    x = best.bodies[0]
    known = _with_geometry(known, x, geometry)
    fits = _drawn(known, before, x, rng)
    figures = _figures(before, fits, robot.nominal)
    by = best.said.slopes[0]
    judged = Agreement.of(
        float(best.cost[0]),
        readings - best.said.readings[0] - by @ (known.mean - x),
        readings,
        known.covariance + (by * known.width) @ (by * known.width).T,
    )
    outcome = _outcome(figures, judged)
    mends = _mends(known, x, judged.chi2) if judged.clear else ()
    told = FitAnswer(
        outcome,
        answer(outcome, figures, judged, campaign.periods, mends),
        tuple(
            WindowVerdict(
                f"{k} {one.name}",
                Role.IDENTIFY,
                used=True,
                variant=VARIANT,
                samples=one.swings,
                chi2_per_dof=float(judged.pulls[k - 1] ** 2),
                no_sigma=NO_SIGMA,
            )
            for k, one in enumerate(campaign.periods, start=1)
        ),
        warnings(
            campaign.periods,
            open_combinations(figures.covariance, known.width, PARAMETER_NAMES),
            rivals,
            model.vague(x, best.said.rests),
            UNNOTED,
            unsurveyed=robot.survey is None,
        ),
        judged.ratio,
    )
    return figures.result(campaign.name, robot, told, begin)


def _with_geometry(known: _Known, x: np.ndarray, sd: np.ndarray) -> _Known:
    """With the errors of geometry and cords in those of the readings, as they are at a body that hangs."""
    model, (_, noise) = known.model, known.model.measured
    near = model.said(x[np.newaxis], model.start(1)).rests
    by = model.by_geometry(x, near) * sd
    if not np.isfinite(by).all():
        return known  # it hardly hangs; periods that contradict each other lead there
    return _Known(model, known.mean, known.width, known.readings, np.diag(noise**2) + by @ by.T)


def _existing(known: _Known, rng: np.random.Generator) -> Float[np.ndarray, "D 9"]:
    """Bodies that can exist and hang at all lengths, drawn from what is plausible. Raises RefusedError without any."""
    found = np.zeros((0, len(known.mean)))
    drawn = 0
    while len(found) < DRAWS and drawn < MOST * DRAWS:
        some = known.mean + known.width * rng.normal(size=(4 * DRAWS, len(known.mean)))
        drawn += len(some)
        some = some[[consistency.can_exist(Body.from_vector(one)) for one in some]]
        hangs = known.model.said(some, known.model.start(len(some))).hangs if len(some) else np.zeros(0, dtype=bool)
        found = np.vstack([found, some[hangs]])
    if len(found) < DRAWS:
        raise RefusedError(
            f"Only {len(found)} of {drawn} bodies like the nominal one can exist and hang at these lengths.",
            hint="Check lengths, nominal_com and nominal_inertia (about P, per unit mass) of the robot file.",
        )
    return found[:DRAWS]


def _best(known: _Known, before: np.ndarray) -> tuple[Found, tuple[Body, ...]]:
    """The best body of several searches, alone, then it and all that are nearly as likely and of another kind.

    Raises RefusedError where there is none.
    """
    starts = np.vstack([known.mean, before[: STARTS - 1]])
    found = known.fitted(starts, np.tile(known.readings, (STARTS, 1)), np.tile(known.mean, (STARTS, 1)))
    order = np.argsort(found.cost)
    first = order[:1]
    if not np.isfinite(found.cost[first[0]]):
        raise RefusedError(
            "No body like the nominal one hangs at these lengths.", hint="Compare lengths with the robot file."
        )
    kinds: list[np.ndarray] = []
    for k in order[found.cost[order] < found.cost[first[0]] + RIVAL]:
        if all(np.abs((found.bodies[k] - one) / known.width).max() > APART for one in kinds):
            kinds.append(found.bodies[k])
    alone = Found(found.bodies[first], found.cost[first], found.left[first], found.said.of(first))
    return alone, tuple(Body.from_vector(one) for one in kinds)


def _drawn(known: _Known, before: np.ndarray, best: np.ndarray, rng: np.random.Generator) -> Float[np.ndarray, "D 9"]:
    """Fits of drawn readings about drawn bodies, from there and from the best one."""
    root = np.linalg.cholesky(known.covariance)
    readings = known.readings + rng.normal(size=(len(before), len(root))) @ root.T
    fits = known.fitted(before.copy(), readings, before)
    fits = fits.best(known.fitted(np.tile(best, (len(before), 1)), readings, before))
    least = float(np.median(fits.left))
    return fits.bodies[fits.left < least + float(chi2.isf(LOST, len(root)))]


def _mends(known: _Known, best: np.ndarray, cost: float) -> tuple[str, ...]:
    """Which mistake of a person, undone, lets all agree; the likeliest."""
    tried = usual_mistakes(known.model.periods, known.readings)
    readings = np.tile(known.readings, (len(tried), 1))
    for row, mend in zip(readings, tried, strict=True):
        row[list(mend.changes)] = list(mend.changes.values())
    means = np.tile(known.mean, (len(tried), 1))
    found = known.fitted(means.copy(), readings, means).best(
        known.fitted(np.tile(best, (len(tried), 1)), readings, means)
    )
    agree = (chi2.sf(found.cost, readings.shape[1]) > CHANCE) & (found.cost < cost - chi2.isf(CHANCE, 1))
    least = np.min(found.cost[agree], initial=np.inf)
    return tuple(mend.says for k, mend in enumerate(tried) if agree[k] and found.cost[k] < least + RIVAL)


def _figures(before: np.ndarray, fits: np.ndarray, nominal: Body) -> Figures:
    """The nine parameters: mean and covariance of the fits."""
    mean, covariance = fits.mean(axis=0), np.cov(fits.T)
    sd = np.sqrt(np.diag(covariance))
    seen = sd < SEEN * before.std(axis=0)
    parameters = {
        name: InertialParameter(float(mean[k]), float(sd[k]), None, None, float(nominal.vector[k]), seen=bool(seen[k]))
        for k, name in enumerate(PARAMETER_NAMES)
    }
    return Figures(parameters, (), covariance, None, 0.0)


def _outcome(figures: Figures, judged: Agreement) -> ResultOutcome:
    if judged.clear:
        return ResultOutcome.MISFIT
    if len(figures.unseen) == len(figures.parameters):
        return ResultOutcome.UNSEEN
    return ResultOutcome.DOUBTFUL if doubtful(figures) else ResultOutcome.CONVERGED
