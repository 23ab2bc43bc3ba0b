"""General geometry as a rival of every effect: errors of all anchors and attachments, as in a usual survey.

Where the robot file states no survey, its geometry may be exact or off by what surveys usually are. Evidence decides:
before a search and beside each model that is found on its way, where an open geometry is foretold to follow a motion
that the file's does not, and to say more than any one or two further effects; and after it, against the effects that
were found, beside them or in their place.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.evidence import FACTORS, ODDS, Linearised, over_factors
from fidim_lab.identification.survey import usual
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline
from fidim_lab.mismatch.fitting.refit import Completed, prior_of
from fidim_lab.mismatch.scores.score import pair_scores, single_scores
from fidim_lab.mismatch.scores.views import View, view
from fidim_lab.mismatch.selection.candidates import candidate
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.say import Say


@dataclass(frozen=True)
class Rival:
    """A usual survey, opened beside a model's terms or in their place, against the terms and an exact geometry."""

    beside: float
    """nats for terms and open geometry, over the terms alone"""
    instead: float
    """nats for the open geometry alone, over the terms alone"""
    factor: float
    """times a usual survey: the most likely of the better of the two"""
    temper: float
    """χ²/dof (at least 1) that terms and open geometry together are foretold to leave"""

    @property
    def best(self) -> float:
        """Nats of the better of the two."""
        return max(self.beside, self.instead)


@dataclass(frozen=True, eq=False)
class Opening:
    """A model beside which an open geometry says more than any further effect."""

    beside: Completed
    factor: float
    """times a usual survey"""


def rival(seen: View) -> Rival | None:
    """General geometry against the terms of the model that was looked at, to first order.

    None where its geometry is open already.
    """
    model = seen.model
    if model.has_open_geometry:
        return None
    problem, survey = _problem(seen)
    wide, count = prior_of(model.tried), len(prior_of(model.tried))
    body = np.arange(len(problem.information)) < BODY
    terms = np.arange(len(problem.information)) < BODY + count
    offsets = np.concatenate([body[:BODY], survey > 0])
    choice = sum(h.choice for h in model.tried)
    beside, instead, tempers = np.zeros(len(FACTORS)), np.zeros(len(FACTORS)), np.ones(len(FACTORS))
    for k, factor in enumerate(FACTORS):
        with_terms = np.concatenate([wide, factor * survey[count:]])
        every, temper = problem.settled(with_terms)
        alone = problem.where(terms, with_terms, temper).nats(temper) - choice
        general = problem.where(offsets, np.where(survey > 0, factor * survey, 1.0), temper)
        beside[k], instead[k] = every.nats(temper) - choice - alone, general.nats(temper) - alone
        tempers[k] = temper
    (first, k), (second, other) = over_factors(beside), over_factors(instead)
    best = k if first > second else other
    return Rival(first, second, float(FACTORS[best]), float(tempers[best]))


def _problem(seen: View) -> tuple[Linearised, Float[np.ndarray, " theta"]]:
    """Body, terms and the offsets that no term has; and the sd by a usual survey of all θ, 0 for what is no offset."""
    fit, projected, tried = seen.fit, seen.projected, seen.model.tried
    known: dict[NamedEffect, tuple[float, ...]] = {one.effect: one.sd for one in usual(fit.likelihood.mechanism.robot)}
    shared = len(fit.values)
    columns, survey = [np.arange(shared)], [np.zeros(0)]
    survey += [np.array(known.get(h.effect, (0.0,) * len(h.effect.parameters))) for h in tried]
    for h, place in zip(projected.tried, projected.slices, strict=True):
        if h.effect in known:
            columns.append(shared + np.arange(place.start, place.stop))
            survey.append(np.array(known[h.effect]))
    chosen, prior = np.concatenate(columns), fit.prior.sd**-2.0
    information = projected.gram[np.ix_(chosen, chosen)]
    information[range(shared), range(shared)] -= prior
    gradient = projected.gram[chosen, -1]
    gradient[:shared] -= prior * (fit.values - fit.prior.mean)
    away = np.concatenate([np.zeros(0), *(theta - h.absent for h, theta in zip(tried, _thetas(seen), strict=True))])
    theta = np.concatenate([away, np.zeros(len(chosen) - shared)])
    return Linearised(projected.left, projected.dof, information, gradient, theta), np.concatenate(survey)


def _thetas(seen: View) -> list[np.ndarray]:
    """Of the terms at the fit that was looked at."""
    return [seen.fit.values[seen.model.place_of(k)] for k in range(len(seen.model.tried))]


@dataclass(frozen=True, eq=False)
class FirstLook:
    """The model as it is, all scores there, and the same with its geometry open: each found once, where asked for."""

    exact: Baseline
    """with the geometry that the robot file states"""
    say: Say

    @cached_property
    def scores(self) -> View:
        """All scores at the model as it is."""
        return view(self.exact.as_it_is, self.exact.tried, self.exact.context)

    @cached_property
    def seen(self) -> View | None:
        """The same, where the model leaves more than noise; None where nothing is missing."""
        return None if candidate(self.exact.as_it_is, self.exact.predicted).is_white else self.scores

    @cached_property
    def general(self) -> Rival | None:
        """General geometry against the model as it is; None where nothing is missing, or it is open already."""
        return None if self.seen is None else rival(self.seen)

    @cached_property
    def opened(self) -> Baseline:
        """The same with its geometry open, as far off as is most likely."""
        return opened(self.exact, 1.0 if self.general is None else self.general.factor, self.say)

    @property
    def instead_of_a_search(self) -> Baseline | None:
        """With its geometry open, where that alone leaves only noise and one or two effects say less, or None."""
        if self.seen is None or not leads(self.seen, self.general):
            return None
        found = self.opened
        return found if candidate(found.as_it_is, found.predicted).is_white else None


def leads(seen: View, general: Rival | None) -> bool:
    """Whether an open geometry is foretold to follow the motion, and to say more than any effect or pair of effects.

    general: general geometry at the model that was looked at; no rival where the file states how it was surveyed.
    """
    if general is None or seen.model.mechanism.robot.survey is not None:
        return False
    follows = general.temper <= SHARED.near * seen.fit.noise_ratio**2
    return follows and general.best >= ODDS and general.best >= most_of_effects(seen, general.temper) + ODDS


def opening(seen: View) -> Opening | None:
    """To open the geometry beside the terms of the model that was looked at, where that leads; None where not."""
    general = rival(seen) if seen.model.tried and not seen.model.is_white else None
    return Opening(seen.model, general.factor) if general is not None and leads(seen, general) else None


def opened(exact: Baseline, factor: float, say: Say) -> Baseline:
    """The model as it is with its geometry open, so many times as far off as a usual survey."""
    say("fitting the geometry too: it is less exact than the robot file says")
    mechanism = exact.short_ground.likelihood.mechanism
    geometry = usual(exact.campaign.robot, factor)
    return fit_baseline(
        exact.campaign,
        native=mechanism.native,
        say=say,
        mechanism=mechanism,
        geometry=geometry,
        without=exact.without,
    )


def most_of_effects(seen: View, temper: float) -> float:
    """Nats of the best effect or pair of effects, were so much χ²/dof noise."""
    projected = replace(seen.projected, inflation=temper)
    scores = (*single_scores(projected, seen.context)[:1], *pair_scores(projected, seen.context, 1))
    return max((score.log_evidence for score in scores), default=0.0)
