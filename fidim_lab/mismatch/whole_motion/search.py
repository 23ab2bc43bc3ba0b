"""Terms added one by one, by evidence and by the gain of held-out windows; then their rivals.

The geometry comes first: where whole windows ask for it, it is open under its survey in every model, so that no term is
named for what a usual survey misses. Then every step looks at all effects to first order, fits those that take most,
and keeps the most evident that held-out windows confirm. Scores only propose.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Role
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.identification.survey import stated, usual
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.linearised.columns_sprung import scorer_of
from fidim_lab.mismatch.linearised.hypotheses import Hypotheses, Hypothesis, general, hypotheses
from fidim_lab.mismatch.scores.score import Score, project, single_scores
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.whole_motion.common_part import CommonPart
from fidim_lab.mismatch.whole_motion.factors import likeliest_survey, surprise
from fidim_lab.mismatch.whole_motion.models import ModelFits, WholeModel
from fidim_lab.mismatch.whole_motion.weighing import excludes, log_odds, taken
from fidim_lab.say import Say

Rivals = tuple[tuple[WholeModel, ...] | None, ...]
"""for each term of a model those with another one in its place, None where the search was ended before"""
SURVEY_ROUNDS = 2
"""of offsets and of how many times a usual survey they are, in turn"""


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """The result of the search."""

    base: WholeModel
    """the model as it is"""
    best: WholeModel
    rivals: Rivals
    """for each term of the best: models with another one in its place that are not excluded, the most evident first"""
    tried: tuple[WholeModel, ...]
    """every model that was fitted, the most evident first"""
    cut_short: str = ""
    """that the search was ended before everything was tried; empty where it was not"""

    @property
    def temper(self) -> float:
        """Sum of squares for each independent value of what the best leaves."""
        return self.best.temper


def search(
    campaign: Campaign, common: CommonPart, budget: Budget, say: Say, without: Collection[str] = ()
) -> SearchOutcome:
    """Look for what whole windows lack beside `common`. without: ids of effects that are taken as unknown.

    Once the budget is spent no term and no rival is tried any more.
    """
    trial = ModelFits(common, common.prepared(campaign, Role.VALIDATE, say))
    steps = _Steps(trial, hypotheses(campaign.robot, without), budget, say)
    base = trial.as_it_is
    say(f"whole windows without any effect: fitted {1e3 * base.fitted:.3g} mm, held out {1e3 * base.held_out:.3g} mm")
    best, rivals = steps.beside_rivals(base)
    for _ in range(SHARED.most_terms):
        better = steps.better(best, rivals)
        if better is None:
            break
        best, rivals = steps.beside_rivals(better)
    every = {one.label: one for one in (base, *steps.tried, best)}
    tried = sorted(every.values(), key=lambda one: -log_odds(one, best))
    return SearchOutcome(base, best, rivals, tuple(tried), budget.says if budget.is_spent else "")


class _Steps:
    """What one search tries."""

    def __init__(self, trial: ModelFits, every: Hypotheses, budget: Budget, say: Say) -> None:
        self.trial, self.budget, self.say = trial, budget, say
        known = {one.id for one in trial.common.nuisances if isinstance(one, NamedEffect)}
        left = (h for h in every.direct if not stretches(h.effect) and h.effect.id not in known)
        self.every = replace(every, periodic=(), direct=tuple(left))
        self.tried: list[WholeModel] = []

    def surveyed(self, best: WholeModel) -> WholeModel:
        """With its geometry open where evidence asks for that; exact where it does not, or not any more."""
        opened, exact = self._opened(best), self.trial.closed(best) if best.geometry else best
        if opened is None or exact is None:
            return best
        chosen = opened if log_odds(opened, exact) > ODDS else exact
        self.tried += [opened] if opened is not chosen else [exact]
        return self._piece_by_piece(chosen) if chosen.geometry else chosen

    def _piece_by_piece(self, opened: WholeModel) -> WholeModel:
        """With an error of its own size for each piece, where evidence asks for that and held-out windows agree."""
        if opened.found.likelihood.mechanism.robot.survey is not None:
            return opened
        own = opened
        for _ in range(SURVEY_ROUNDS):
            own = self.trial.opened(own, likeliest_survey(own, alike=False)) or own
        price = surprise(own.geometry) - surprise(opened.geometry)
        asked = log_odds(own, opened) > max(price, 0.0) and taken(opened, own) > 0.0
        self.tried += [opened] if asked else []
        return own if asked else opened

    def beside_rivals(self, begun: WholeModel) -> tuple[WholeModel, Rivals]:
        """Where the search goes from a model, at its optimum, and the rivals of each of its terms."""
        best = self.forward(self.surveyed(begun))
        best = self.trial.finished(best) if best.size else best
        return best, tuple(self.rivals(best, k) for k in range(len(best.terms)))

    def forward(self, best: WholeModel) -> WholeModel:
        """With as many further terms as are asked for, each in the form that is, and without those made needless."""
        while len(best.terms) < SHARED.most_terms and not self.budget.is_spent:
            further = self.further(best)
            if further is None:
                break
            best = self.surveyed(self.simpler(further))
            out = f"fitted {1e3 * best.fitted:.3g} mm, held out {1e3 * best.held_out:.3g} mm"
            self.say(f"whole windows: {best.label}, {out}")
        return self.simpler(best if self.budget.is_spent else self.widened(best))

    def further(self, best: WholeModel) -> WholeModel | None:
        """The most evident model with one more term that held-out windows confirm, or None.

        Of a term that is evident and that they do not confirm, the more general forms are tried.
        """
        fresh = [self.trial.with_term(best, score.tried[0], score.theta[0]) for score in self._shortlist(best)]
        asked = self._evident(fresh, best)
        while asked:
            chosen = most_evident(asked)
            if taken(best, chosen) > SHARED.some:
                return chosen
            asked.remove(chosen)
            asked += self._evident(self._wider(chosen, len(chosen.terms) - 1), best)
        return None

    def widened(self, best: WholeModel) -> WholeModel:
        """With more general forms of its terms, where these are as evident as a term must be and predict no worse."""
        for k in range(len(best.terms)):
            wider = [one for one in self._evident(self._wider(best, k), best) if taken(best, one) >= 0.0]
            best = most_evident(wider) if wider else best
        return best

    def simpler(self, best: WholeModel) -> WholeModel:
        """Without terms that another one has made needless: at its optimum, a model without them is as evident."""
        while len(best.terms) > 1:
            every = (self.trial.without(best, k) for k in range(len(best.terms)))
            settled = (self.trial.finished(one) for one in every if one is not None)
            less = [one for one in settled if log_odds(best, one) < ODDS]
            if not less:
                break
            self.tried.append(best)
            best = max(less, key=lambda one: log_odds(one, less[0]))
        return best

    def better(self, best: WholeModel, rivals: Rivals) -> WholeModel | None:
        """The most evident rival where it is more evident than the best and predicts no worse, or None."""
        known = (one for every in rivals for one in every or ())
        more = [one for one in known if log_odds(one, best) > 0.0 and taken(best, one) >= 0.0]
        return max(more, key=lambda one: log_odds(one, best)) if more else None

    def _simple(self, model: WholeModel, k: int) -> WholeModel:
        """With the simple form of term k in its place, where it has a more general one."""
        form = model.terms[k].effect.narrower(model.theta_of(k))
        known = self.every.admitted(() if form is None else (form,))
        return (self._in_form(model, k, *known[0]) or model) if known else model

    def _evident(self, fresh: Sequence[WholeModel | None], best: WholeModel) -> list[WholeModel]:
        """Those of these models that evidence prefers to the best so far as a term must be."""
        models = [one for one in fresh if one is not None]
        self.tried += models
        return [one for one in models if log_odds(one, best) > ODDS]

    def _wider(self, model: WholeModel, k: int) -> list[WholeModel | None]:
        """With each more general form of term k in its place."""
        forms = model.terms[k].effect.wider(model.theta_of(k), model.found.likelihood.mechanism.robot)
        return [self._in_form(model, k, *form) for form in self.every.admitted(forms)]

    def _in_form(self, model: WholeModel, k: int, effect: NamedEffect, theta: np.ndarray) -> WholeModel | None:
        """With another form of term k in its place, from these θ."""
        form = general(model.terms[k], effect, theta)
        return self.trial.instead(model, k, form, theta[list(form.scored)])

    def rivals(self, best: WholeModel, k: int) -> tuple[WholeModel, ...] | None:
        """Models with another term in the place of one, that the windows do not exclude; None where none was tried.

        They are held against its simple form: a more general law says more of how it acts, not of what acts.
        """
        if self.budget.is_spent:
            return None
        less = self.trial.without(best, k)
        if less is None:
            return ()
        self.tried.append(less)
        found: list[WholeModel] = []
        for score in self._shortlist(less):
            new = score.tried[0]
            if new.effect.id != best.terms[k].effect.id or new.effect.cable != best.terms[k].effect.cable:
                other = self.trial.instead(best, k, new, score.theta[0])
                found += [] if other is None else [other]
        self.tried += found
        against = self._simple(best, k) if found else best
        kept = [one for one in found if not excludes(against, one)]
        return tuple(sorted(kept, key=lambda one: -log_odds(one, best)))

    def _shortlist(self, model: WholeModel) -> list[Score]:
        """What takes most beside a model, to first order: one of each effect, all cables alike before each alone."""
        self.say(f"whole windows: testing all effects in addition to {model.label}")
        inside = {h.effect for h in model.terms} | {one.effect for one in model.geometry}
        left = tuple(h for h in self.every.direct if h.effect not in inside)
        scorer = scorer_of(model.found.likelihood.mechanism, replace(self.every, direct=left))
        found = model.found
        seen = project(scorer, found, found.likelihood, found.journey.optimum.simulation)
        scores = single_scores(replace(seen, inflation=model.temper), self.trial.common.context)
        chosen: dict[tuple[str, bool], Score] = {}
        for score in scores:
            chosen.setdefault(_kind(score.tried[0]), score)
        best = max((score.log_evidence for score in chosen.values()), default=0.0)
        least = max(ODDS, SHARED.nearly * best)
        return [score for score in chosen.values() if score.log_evidence > least][: SHARED.shortlist]

    def _opened(self, model: WholeModel) -> WholeModel | None:
        """With its geometry as the robot file's survey leaves it, or as a usual one does, so many times as large."""
        robot = model.found.likelihood.mechanism.robot
        inside = {h.effect for h in model.terms}
        if robot.survey is not None:
            geometry = tuple(one for one in stated(robot) if one.effect not in inside)
            return self.trial.opened(model, geometry) if geometry else None
        known = {one.effect: one for one in (likeliest_survey(model, alike=True) if model.geometry else ())}
        wide = (one for one in usual(robot, SHARED.wide) if one.effect not in inside)
        found = self.trial.opened(model, tuple(known.get(one.effect, one) for one in wide))
        for _ in range(SURVEY_ROUNDS - 1):
            found = None if found is None else self.trial.opened(found, likeliest_survey(found, alike=True))
        return found


def most_evident(models: list[WholeModel]) -> WholeModel:
    """By evidence; where it does not tell by odds of 20, the fewest parameters, and all cables before one of them."""
    top = max(models, key=lambda one: log_odds(one, models[0]))
    near = [one for one in models if log_odds(top, one) < ODDS]
    return min(near, key=lambda one: (one.parameters, _picked(one), -log_odds(one, top)))


def _picked(model: WholeModel) -> int:
    """Terms of one cable."""
    return sum(h.effect.cable is not None for h in model.terms)


def _kind(tried: Hypothesis) -> tuple[str, bool]:
    """What is shortlisted once: an effect of all cables alike, and its best single cable."""
    return tried.effect.id, tried.effect.cable is None
