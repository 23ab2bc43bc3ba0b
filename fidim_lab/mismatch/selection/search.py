"""Additions to a model, one after the other: for the first seconds where needed, then for whole windows.

The search may end early: at pushes within a few windows that are all that is left, or where an open geometry, or what
differs between windows, says more than any further effect. What a search that has ended thinks better of is in
`select`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.cleaning.common_push import find_common_push
from fidim_lab.mismatch.cleaning.contacts import Contact, find_contacts
from fidim_lab.mismatch.cleaning.restarts import find_pushes
from fidim_lab.mismatch.cleaning.segments import predict_segments
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, again, evidence, refit
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.additions import Addition
from fidim_lab.mismatch.selection.beside_terms import Beside, ChangesBeside
from fidim_lab.mismatch.selection.candidates import (
    Candidate,
    accepted,
    advantage,
    best_of,
    common_scale,
    more_convincing,
    most_convincing,
    of_model,
)
from fidim_lab.mismatch.selection.confounders import in_their_place
from fidim_lab.mismatch.selection.general_geometry import Opening
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.selection.trials import Trials
from fidim_lab.mismatch.selection.unions import unions
from fidim_lab.mismatch.selection.whole_windows import WholeWindows
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import found_side_by_side
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class SearchState:
    """How far a search over whole windows has come."""

    best: Candidate
    last: View
    """all scores at the best model"""
    pushes: tuple[Contact, ...] = ()
    """that are all that is left, for which it was broken off"""
    beside: Opening | ChangesBeside | None = None
    """the terms, for which it was broken off"""

    @property
    def is_broken_off(self) -> bool:
        """Whether windows are to be cut or corrected, or the geometry is to be opened, before it goes on."""
        return bool(self.pushes) or self.beside is not None


class Search:
    """What is tried in which order, and what is accepted."""

    def __init__(
        self,
        start: Baseline,
        say: Say,
        look_for_pushes: bool,
        budget: Budget,
        seen: View | None = None,
        beside: Beside | None = None,
    ) -> None:
        self.start, self.say, self.look_for_pushes, self.budget = start, say, look_for_pushes, budget
        self.beside = beside or Beside()
        self.trials = Trials(start, say, budget, seen)

    def known_to_do(self, known: Completed | None) -> Candidate | None:
        """A known model fitted to these windows, where it leaves only noise."""
        if known is None or not known.tried:
            return None
        short = again(self.start.short_ground, self.start.short, known, self.start.context)
        whole = None if short is None else again(self.start.whole_ground, short.fit, short, self.start.context)
        # a term that the cuts had made needful may be needless now
        judged = None if whole is None else self.trials.judged(self.trials.pruned(whole))
        if judged is None or not judged.is_white:
            return None
        self.trials.tried.append(judged)
        return judged

    def over_first_seconds(
        self, is_outdone: Callable[[Completed], bool]
    ) -> tuple[list[Completed], Opening | ChangesBeside | None]:
        """The few best models of the first seconds, the best first; and what it was broken off for.

        is_outdone: says of several effects that leave structure there, whether it is in vain to go on.
        """
        best = Completed((), self.start.short, whole=False)
        while True:
            seen = self.trials.look(best)
            if self.budget.is_spent:
                break
            beside = self.beside.leading(seen, self.start.campaign)
            if beside is not None:
                return [best], beside
            fresh = self.trials.over_first_seconds(self.trials.additions(seen))
            further = more_convincing(best, fresh) or self._exchanged(seen) or self._found_anew(seen)
            if further is None:
                break
            beside = self._instead_of(further, fresh)
            if beside is not None:
                return [beside.beside], beside
            best = self.trials.in_best_form(self.trials.pruned(further))
            self.say(f"over the first seconds: {best.label}, χ²/dof {best.fit.chi2_per_dof:.3f}")
            if best.is_white or (len(best.tried) > 1 and is_outdone(best)):
                break
        if not (_is_simple(best) and best.is_white):
            best = most_convincing(best, self._together())
        scale = common_scale([best, *self.trials.passing])
        near = [m for m in self.trials.passing if m is not best and evidence(best, m, scale) < SHARED.close]
        near.sort(key=lambda m: evidence(best, m, scale))
        return [m for m in _distinct([best, *near])[: SHARED.leaders] if m.tried], None

    def _instead_of(self, further: Completed, fresh: Sequence[Completed]) -> ChangesBeside | None:
        """Changes between windows beside a model with fewer terms than the one that is to be accepted."""
        fewer = [model for model in fresh if 0 < len(model.tried) < len(further.tried)]
        return self.beside.instead_of(further, fewer, self.start.campaign, self.trials.look)

    def _exchanged(self, seen: View) -> Completed | None:
        """The model that was looked at with another effect in the place of a term, where that is more convincing.

        What came first bends to take the share of what was not there yet; beside that another may say more.
        """
        best = seen.model
        if best.is_white:
            return None
        fresh = in_their_place(seen, self.start.short_ground, self.say, SELECTION.search_siblings)
        self.trials.passing += fresh
        return more_convincing(best, fresh)

    def _found_anew(self, seen: View) -> Completed | None:
        """The same, with a term that has many optima (a frequency) taken out, and scanned for once more."""
        best = seen.model
        many = [k for k, term in enumerate(best.tried) if term.has_scan]
        for k in many if len(best.tried) > 1 and not best.is_white else ():
            less = self.trials.keeping(best, [j for j in range(len(best.tried)) if j != k])
            if less is None or self.budget.is_spent:
                continue
            fresh = self.trials.over_first_seconds(self.trials.additions(self.trials.look(less)))
            further = more_convincing(best, fresh)
            if further is not None:
                return further
        return None

    def _together(self) -> list[Completed]:
        """Terms of models that did well over the first seconds, fitted together from nothing."""
        start, well = self.start, [*self.trials.raced, *self.trials.passing]
        fits = [
            partial(refit, start.short_ground, start.short, terms, [h.absent for h in terms], start.context)
            for terms in (() if self.budget.is_spent else unions(well, SHARED.most_terms))
        ]
        fresh = found_side_by_side(fits)
        self.trials.passing += fresh
        return fresh

    def best_over_all(
        self, baseline: Candidate, short: Sequence[Completed], rivalled: bool = False
    ) -> tuple[Candidate, tuple[Contact, ...]]:
        """Models of the first seconds fitted to whole windows, and the best of them; hands where none follows.

        rivalled: a wrench without a name leaves only noise there: no model is gone on with that does not follow.
        """
        hopeless = SHARED.near if rivalled else SHARED.hopeless
        best, followed = WholeWindows(self.start, self.say, self.budget, self.trials, hopeless).best(baseline, short)
        return best, () if followed or rivalled else self._hands_beside(short)

    def _hands_beside(self, short: Sequence[Completed]) -> tuple[Contact, ...]:
        """Hands in whole windows of which only the first seconds are followed, by the best model of these."""
        if not self.look_for_pushes or self.budget.is_spent:
            return ()
        model = next((model for model in short if model.is_white), None)
        if model is None:
            return ()
        self.say(f"looking for hands, with {model.label}")
        return find_contacts(predict_segments(model, self.start.campaign.windows))

    def over_whole_windows(self, best: Candidate, pushes: tuple[Contact, ...] = ()) -> SearchState:
        """Additions until none is asked for, or pushes are all that is left; the view from the last model.

        Where structure stays, and only the first seconds were looked at, tones are listened for in whole windows.
        pushes: for which the search is broken off already.
        """
        seen = self.trials.look(best.model)
        if pushes:
            return SearchState(best, seen, pushes)
        if best.model.whole and self._in_vain(best):
            return SearchState(best, seen, self._pushes_left(best))
        while best.model.whole:
            left = self._pushes_left(best, *_best_score(seen))
            if left:
                return SearchState(best, seen, left)
            beside = None if best.is_white else self.beside.leading(seen, self.start.campaign)
            if beside is not None:
                return SearchState(best, seen, beside=beside)
            further, fresh = self._one_further(best, self._tones(best, seen) or self.trials.additions(seen))
            if further is None:
                return SearchState(best, seen, self._pushes_left(best) or self._pushes_alike(best))
            beside = self._instead_of(further.model, [one.model for one in fresh])
            if beside is not None:
                return SearchState(best, seen, beside=beside)
            pushed = self._with_pushes(further, fresh, seen)
            if pushed is not None:
                return pushed
            best = further
            self.say(f"accepted: {best.model.label}, {best.held_out.says}")
            seen = self.trials.look(best.model)
        return SearchState(best, seen)

    def _tones(self, best: Candidate, seen: View) -> tuple[Addition, ...]:
        """Tones that take most of what is left of whole windows, where only the first seconds were looked at."""
        if not seen.races or best.is_white or best.model.excess > SHARED.hopeless or self.budget.is_spent:
            return ()
        heard = self.trials.look_for_tones(best.model)
        if not heard.singles or heard.singles[0].gain < SCORES.by_a_tone * heard.rest:
            return ()
        return self.trials.additions(heard)

    def _one_further(self, best: Candidate, additions: Sequence[Addition]) -> tuple[Candidate | None, list[Candidate]]:
        """The best with one addition, None where none is accepted; and what was tried for it.

        The simplest first; once one more term leaves only noise, what said less is not fitted any more.
        """
        fresh: list[Candidate] = []
        done = -np.inf
        for addition in sorted(additions, key=lambda addition: addition.score.size):
            if self.budget.is_spent:
                break
            if addition.score.log_evidence < done:
                continue
            self.say(f"fitting {' + '.join([best.model.label, addition.score.label][not best.model.tried :])}")
            found = self.trials.added(addition, [one.model for one in fresh])
            if found is None:
                continue
            fresh.append(self.trials.judged_or_wider(self.trials.pruned(found), addition.score.tried))
            if fresh[-1].is_white and len(addition.score.tried) == 1:
                done = max(done, addition.score.log_evidence)
        further = accepted(best, fresh)
        if further is not None:
            fresh += self.trials.wider_rivals(further, [best, *fresh])
            further = accepted(best, fresh)
        self.trials.tried += fresh
        return further, fresh

    def _in_vain(self, best: Candidate) -> bool:
        """Whether additions to the model as it is were already tried: over the first seconds, and then in full."""
        return not (best.model.tried or self.start.follows) and bool(self.trials.passing)

    def _with_pushes(self, further: Candidate, fresh: Sequence[Candidate], seen: View) -> SearchState | None:
        """A model with fewer terms beside which pushes say more than the others do: a hand is no friction.

        Where the other terms leave structure, also one beside which every window is pushed at the same time.
        """
        fewer = [one for one in fresh if len(one.model.tried) < len(further.model.tried) and not one.is_white]
        for one in sorted(fewer, key=lambda c: len(c.model.tried)):
            left = self._pushes_left(one, advantage(further.model, one.model))
            if left:
                return SearchState(one, seen, left)
        if not fewer or further.is_white:
            return None
        least = min(len(one.model.tried) for one in fewer)
        simple = [one for one in fewer if len(one.model.tried) == least]
        best = of_model(best_of([one.model for one in simple]), simple)
        alike = () if best is None else self._pushes_alike(best)
        return None if best is None or not alike else SearchState(best, seen, alike)

    def _pushes_left(self, best: Candidate, least: float = -np.inf, inflation: float = 1.0) -> tuple[Contact, ...]:
        """Pushes that are all that is left, where they say more than so many nats.

        inflation: χ²/dof that counts as noise, beyond what all but the pushed windows show.
        """
        if not self.look_for_pushes:
            return ()
        found = find_pushes(best.model, best.held_out, self.start.held_out)
        gain = sum(push.gain or 0.0 for push in found)
        said = 0.5 * gain / inflation - SELECTION.push_cost * len(found)
        return found if said > least else ()

    def _pushes_alike(self, best: Candidate) -> tuple[Contact, ...]:
        """A push at the same time of every window, softer than what the model as it is misses elsewhere."""
        if not self.look_for_pushes or best.is_white or best.model.excess > SHARED.near:
            return ()
        return find_common_push(best.model, self.start.held_out)


def _distinct(models: Sequence[Completed]) -> list[Completed]:
    """Without what has the same terms as an earlier one, and the same optimum."""
    found: list[Completed] = []
    for model in models:
        terms = {h.effect for h in model.tried}
        alike = (one for one in found if {h.effect for h in one.tried} == terms)
        if not any(abs(one.chi2 - model.chi2) < SELECTION.search_same for one in alike):
            found.append(model)
    return found


def _is_simple(model: Completed) -> bool:
    """Whether it is one term of so little freedom that it can have taken no other's share."""
    return len(model.tried) == 1 and len(model.tried[0].scored) <= SELECTION.search_simple


def _best_score(seen: View) -> tuple[float, float]:
    """Nats of the best effect that was looked at, and the χ²/dof that counts as noise there."""
    return seen.singles[0].log_evidence if seen.singles else 0.0, seen.projected.inflation
