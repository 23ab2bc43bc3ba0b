"""Trial models: scored, fitted, pruned and judged; a record of them is kept for the ranking.

What is tried in which order, and what of it is believed, is decided in `select`.
"""

from collections.abc import Sequence
from functools import partial

from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis, general
from fidim_lab.mismatch.scores.views import PERIODIC, View, tones, view
from fidim_lab.mismatch.selection.additions import Addition, additions
from fidim_lab.mismatch.selection.candidates import (
    Candidate,
    advantage,
    candidate,
    common_scale,
    evidence_of_all,
    more_convincing,
    most_convincing,
    price,
    rest_of,
)
from fidim_lab.mismatch.selection.confounders import in_place_of
from fidim_lab.mismatch.selection.generalise import general_forms, widened
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import side_by_side
from fidim_lab.say import Say


class Trials:
    """The input of one search, from the fits of the model without effects."""

    def __init__(self, start: Baseline, say: Say, budget: Budget, seen: View | None = None) -> None:
        """seen: all scores at a baseline, where they are known."""
        self.start, self.say, self.budget = start, say, budget
        self.passing: list[Completed] = []
        """models that were fitted to the first seconds alone"""
        self.raced: list[Completed] = []
        """models that were fitted to a part of these seconds, to see which are worth more"""
        self.tried: list[Candidate] = []
        """models that were fitted to whole windows"""
        self._known: dict[tuple[object, ...], Completed] = {}
        """fits of whole windows by their terms, so that what pruning asks for again and again is made once"""
        self._seen = seen
        self.first: View | None = None
        """what was seen at first"""

    def look(self, model: Completed) -> View:
        """All scores at a model."""
        self.say(f"testing all effects{f' in addition to {model.label}' if model.tried else ''}")
        seen = self._seen
        if seen is None or model.tried or seen.model.fit is not model.fit:
            seen = view(model, self.start.tried, self.start.context)
        self.first = seen if self.first is None else self.first
        return seen

    def look_for_tones(self, model: Completed) -> View:
        """The scores of steady tones at a model, over whole windows."""
        self.say(f"searching for a tone in addition to {model.label}")
        return tones(model, self.start.tried, self.start.context)

    def additions(self, seen: View) -> tuple[Addition, ...]:
        """The hypotheses worth adding to the scored model."""
        room = SHARED.most_terms - len(seen.model.tried)
        return additions(seen, room, self.start.ground(seen.model), self.start.context)

    def added(self, addition: Addition, others: Sequence[Completed]) -> Completed | None:
        """The model with these terms, or with a wider form of the new ones.

        others: models that were fitted beside the same one; those with fewer terms show what these are worth.
        """
        best = addition.seen.model
        found = addition.fitted(self.start.ground(best), self.start.context)
        if found is None:
            return None
        self._remember(found)
        fewer = [best, *(other for other in others if len(other.tried) < len(found.tried))]
        if self.budget.is_spent or rest_of(found) > SHARED.half * min(rest_of(other) for other in fewer):
            return found  # it takes so little that no wider form of it can be the truth
        return widened(self.start, found, addition.score.tried)

    def over_first_seconds(self, beside: Sequence[Addition]) -> list[Completed]:
        """Models with these additions; once one leaves only noise, what costs more than its equals is not fitted."""
        fresh: list[Completed] = []
        self.raced += [addition.near for addition in beside if addition.near is not None]
        cheap = [k for k, addition in enumerate(beside) if not _is_costly(addition)]
        fits = side_by_side([partial(self.added, beside[k], ()) for k in cheap])
        ahead = dict(zip(cheap, fits, strict=True))
        for k, addition in enumerate(beside):
            if k in ahead:
                found = ahead[k]
            elif any(model.is_white for model in fresh):
                continue
            else:
                found = self.added(addition, fresh)
            if found is not None:
                fresh.append(found)
        self.passing += fresh
        return fresh

    def judged_or_wider(self, model: Completed, new: Sequence[Hypothesis]) -> Candidate:
        """A model that fits and does not predict may be a simple form of the truth: then the wider ones are tried."""
        judged = self.judged(model)
        if self.budget.is_spent or judged.is_white or not model.is_white:
            return judged
        wide = more_convincing(model, general_forms(self.start, model, {term.effect for term in new}))
        return judged if wide is None else self.judged(wide)

    def wider_rivals(self, further: Candidate, others: Sequence[Candidate]) -> list[Candidate]:
        """Models with fewer terms that leave only noise, with these in wider forms: another term may stand for one."""
        found: list[Candidate] = []
        for one in others:
            simpler = 0 < len(one.model.tried) < len(further.model.tried) and one.is_white
            if simpler and advantage(further.model, one.model) < SHARED.close:
                wide = general_forms(self.start, one.model, {term.effect for term in one.model.tried})
                found += [self.judged(model) for model in wide]
        return found

    def pruned(self, model: Completed) -> Completed:
        """Without terms, and freedoms of them, that the others have made needless."""
        for k in range(len(model.tried)):
            less = self._simpler(model, k)
            if less is None and len(model.tried) > 1 and price(model, k) < SELECTION.trials_droppable:
                less = self.keeping(model, [j for j in range(len(model.tried)) if j != k])
            if less is not None and advantage(model, less) < SHARED.enough:
                return self.pruned(less)
        return model

    def without_needless(self, one: Candidate) -> Candidate:
        """The same, pruned: what stands in the place of a term may have made another one needless.

        Not where held-out windows speak for what was pruned.
        """
        less = self.pruned(one.model)
        if less is one.model:
            return one
        self.tried.append(self.judged(less))
        scale = common_scale([one.model, less])
        return one if evidence_of_all(one, self.tried[-1], scale) >= SHARED.enough else self.tried[-1]

    def _simpler(self, model: Completed, k: int) -> Completed | None:
        """With the parts into which term k falls in its place, or beside others its simple form; None without any."""
        term, (theta, sd) = model.tried[k], model.theta_of(k)
        narrow = term.effect.narrower(theta) if len(model.tried) > 1 else None
        simple = term.effect.parts(theta, sd) or (() if narrow is None else (narrow,))
        fewer = len(self.start.tried.admitted(simple)) < len(simple)
        if not simple or fewer or len(model.tried) + len(simple) - 1 > SHARED.most_terms:
            return None
        tried = [*model.tried[:k], *(general(term, *one) for one in simple), *model.tried[k + 1 :]]
        thetas = [*model.thetas[:k], *(values for _, values in simple), *model.thetas[k + 1 :]]
        return refit(self.start.ground(model), model.fit, tried, thetas, self.start.context, simpler=model)

    def in_best_form(self, model: Completed) -> Completed:
        """The model with another form of a term, as free, where that has become more convincing beside the others.

        A term alone has chosen its form by its score. Only where it leaves structure the others are tried, from
        nothing: the optimum of one form may be a poor start for another, and nothing beside it is to be kept.
        """
        best, alone = model, len(model.tried) == 1
        ground = self.start.ground(model)
        for k, term in enumerate(() if alone and model.is_white else model.tried):
            forms = term.effect.other_forms(model.thetas[k], self.start.context)
            for effect, theta in self.start.tried.admitted(forms):
                other = general(term, effect, theta)
                if alone:
                    found = refit(ground, self.start.short, [other], [theta], self.start.context)
                else:
                    found = in_place_of(best, k, other, theta, ground, self.start.context)
                best = best if found is None else most_convincing(best, [found])
        return best

    def keeping(self, model: Completed, kept: Sequence[int]) -> Completed | None:
        """The model with these of its terms alone, from where they are; None where no fit gets there."""
        tried, thetas = [model.tried[k] for k in kept], [model.thetas[k] for k in kept]
        known = self._known.get(_terms(tried)) if model.whole else None
        if known is not None and not _falls_short(known, model, kept):
            return known
        found = refit(self.start.ground(model), model.fit, tried, thetas, self.start.context)
        found = None if found is None else self._gone_on(found, model, kept)
        if found is not None:
            self._remember(found)
        return known if found is None else found

    def _gone_on(self, found: Completed, model: Completed, kept: Sequence[int]) -> Completed:
        """A fit with some of a model's terms, from where it ended on, as long as that is too early and helps."""
        ground, turns = self.start.ground(model), 0
        while turns < SHARED.rounds and _falls_short(found, model, kept):
            further = refit(ground, found.fit, found.tried, found.thetas, self.start.context)
            if further is None or further.chi2 > (1 - SHARED.crawl) * found.chi2:
                break
            found, turns = further, turns + 1
        return found

    def _remember(self, found: Completed) -> None:
        """For pruning; not what oscillates: frequencies have many optima."""
        known = self._known.get(_terms(found.tried))
        better = known is None or found.chi2 < known.chi2
        if better and found.whole and not any(h.effect.id in PERIODIC for h in found.tried):
            self._known[_terms(found.tried)] = found

    def judged(self, model: Completed) -> Candidate:
        """A model with what it leaves of held-out windows."""
        return candidate(model, predict(model, self.start.held_out))


def _is_costly(addition: Addition) -> bool:
    terms = addition.score.tried
    return len(terms) > 1 or any(stretches(h.effect) for h in terms)


def _falls_short(known: Completed, model: Completed, kept: Sequence[int]) -> bool:
    """Whether a fit with some of a model's terms leaves far more than doing without the others can cost."""
    foretold = sum(price(model, k) for k in range(len(model.tried)) if k not in kept)
    cost = 0.5 * (known.chi2 - model.chi2) / common_scale([model, known])
    return cost > SELECTION.trials_farther * (foretold + SHARED.enough)


def _terms(tried: Sequence[Hypothesis]) -> tuple[object, ...]:
    return tuple((h.effect, *h.absent) for h in tried)
