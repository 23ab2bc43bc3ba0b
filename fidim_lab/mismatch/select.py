"""From the model as it is to the best set of effects: look at all scores, fit the best few, take one, look again.

First over the first seconds, wherever whole windows are not followed: cheap, and no phase can slip there. What survives
is fitted to whole windows, and the search goes on there. A term is taken when the evidence asks for it (> 5 nats) and,
of whole windows, when those that no fit has seen get better; a term that another has made needless is dropped again
(together: a swap). At most three terms.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.mismatch.baseline import Baseline
from fidim_lab.mismatch.candidates import (
    Candidate,
    accepted,
    candidate,
    common_scale,
    most_convincing,
    price,
    rank,
)
from fidim_lab.mismatch.contacts import Contact
from fidim_lab.mismatch.imitators import in_their_place
from fidim_lab.mismatch.refit import Completed, again, evidence, refit
from fidim_lab.mismatch.restarts import find_pushes
from fidim_lab.mismatch.trials import MOST_TERMS, Trials
from fidim_lab.mismatch.views import ENOUGH, PERIODIC, View
from fidim_lab.mismatch.whiteness import whiteness
from fidim_lab.mismatch.wider import widened

CLOSE = 25.0
"""nats: how near the best over the first seconds a model must be to be fitted to whole windows too"""
SHORTLIST = 3
HOPELESS = 30.0
"""χ²/dof of a model of the first seconds that is not tried on whole windows; of whole windows, what is not judged"""
PUSH_COST = 20.0
"""nats: what the freedom of another start costs, as a few terms of a wide prior do"""
Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Selection:
    """Where the search ended and what was looked at on the way."""

    best: Candidate
    """the baseline where nothing was accepted"""
    baseline: Candidate
    tried: tuple[Candidate, ...]
    """every model that was fitted to whole windows, the best first by held-out χ²"""
    passing: tuple[Completed, ...]
    """every model that was fitted to the first seconds alone"""
    first: View
    """all scores at the model as it is"""
    last: View
    """all scores at the best model: what could still be added, or stand in the place of what is in"""
    pushes: tuple[Contact, ...] = ()
    """for which the search was broken off: all but these windows follow the best model"""


def select(start: Baseline, say: Say, *, pushes: bool = True, known: Completed | None = None) -> Selection:
    """Search for what was left out, starting from the fits of the model as it is.

    pushes: break off where a push within a few windows is all that is left, so that it can be cut out. known: the model
    with which a search of nearly the same windows ended; where it leaves only noise of these, it is where this begins.
    """
    return _Search(start, say, pushes).run(known)


class _Search:
    """One search: what is tried in which order, and what of it is believed."""

    def __init__(self, start: Baseline, say: Say, look_for_pushes: bool) -> None:
        self.start, self.say, self.look_for_pushes = start, say, look_for_pushes
        self.pushes: tuple[Contact, ...] = ()
        self.trials = Trials(start, say)

    def run(self, known: Completed | None) -> Selection:
        """First seconds where needed, then whole windows; from a known model on where that does."""
        start = self.start
        baseline = candidate(start.as_it_is, start.predicted)
        self.say(f"held-out windows without any effect: χ²/dof {baseline.held_out.chi2_per_dof:.3f}")
        settled = self._known_to_do(known)
        best = settled or baseline
        if best is baseline and not start.follows:
            best = self._best_over_all(baseline, self._over_first_seconds())
        best, last = self._over_whole_windows(best)
        if not (self.pushes or best is settled):  # a model with which a search ended stood among its imitators already
            best, last = self._with_imitators(best, last)
        if not (self.pushes or start.follows):
            best, last = self._without_the_doubtful(best, last)
        return Selection(
            best=best,
            baseline=baseline,
            tried=tuple(sorted([baseline, *self.trials.tried], key=rank)),
            passing=tuple(self.trials.passing),
            first=last if self.trials.first is None else self.trials.first,
            last=last,
            pushes=self.pushes,
        )

    def _known_to_do(self, known: Completed | None) -> Candidate | None:
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

    def _over_first_seconds(self) -> list[Completed]:
        """The few best models of the first seconds, the best first."""
        best = Completed((), self.start.short, whole=False)
        while True:
            seen = self.trials.look(best)
            if seen.unfitted is not None:
                break
            fresh = self.trials.over_first_seconds(self.trials.additions(seen))
            further = most_convincing(best, fresh)
            if further is best:
                break
            best = self.trials.pruned(further)
            self.say(f"over the first seconds: {best.label}, χ²/dof {best.fit.chi2_per_dof:.3f}")
            if whiteness(best.leftovers).is_white:
                break
        scale = common_scale([best, *self.trials.passing])
        near = [m for m in self.trials.passing if m is not best and evidence(best, m, scale) < CLOSE]
        near.sort(key=lambda m: evidence(best, m, scale))
        return [m for m in (best, *near[: SHORTLIST - 1]) if m.tried]

    def _best_over_all(self, baseline: Candidate, short: Sequence[Completed]) -> Candidate:
        """Models of the first seconds fitted to whole windows, and the best of them."""
        fresh: list[Candidate] = []
        in_vain: list[set[NamedEffect]] = []
        for model in (model for model in short if model.excess < HOPELESS):
            terms = {h.effect for h in model.tried}
            if any(terms <= more for more in in_vain):
                continue  # with fewer terms it can follow no better
            if any(one.is_white for one in fresh) and not self._follows_first_seconds(model):
                continue  # where another follows whole windows
            self.say(f"fitting {model.label} to whole windows")
            whole, as_it_is = self.start.whole_ground, baseline.model
            found = refit(whole, model.fit, model.tried, model.thetas, self.start.context, simpler=as_it_is)
            if found is not None and found.excess >= HOPELESS:
                in_vain.append(terms)
            elif found is not None:
                # what made good for the first seconds alone may be needless beside the whole
                found = self.trials.pruned(widened(self.start, found, found.tried))
                fresh.append(self.trials.judged_or_wider(found, found.tried))
        self.trials.tried += fresh
        return accepted(baseline, fresh, feeble=True)

    def _follows_first_seconds(self, model: Completed) -> bool:
        """Whether it leaves only noise of all the first seconds, too, where it was fitted to fewer."""
        if not whiteness(model.leftovers).is_white:
            return False
        start = self.start
        if (model.fit.journey.ends == start.short.journey.ends).all():
            return True
        longer = refit(start.short_ground, start.short, model.tried, model.thetas, start.context)
        return longer is not None and whiteness(longer.leftovers).is_white

    def _over_whole_windows(self, best: Candidate) -> tuple[Candidate, View]:
        """Additions until none is asked for, or a push is all that is left; the view from the last model.

        The simplest first; once one more term leaves only noise, what said less is not fitted any more.
        """
        seen = self.trials.look(best.model)
        if best.model.whole and self._in_vain(best):
            self._pushed(best, None)
            return best, seen
        while best.model.whole and seen.unfitted is None and not self._pushed(best, seen):
            fresh: list[Candidate] = []
            done = -np.inf
            for addition in sorted(self.trials.additions(seen), key=lambda addition: addition.score.size):
                if addition.score.log_evidence < done:
                    continue
                self.say(f"fitting {' + '.join([best.model.label, addition.score.label][not best.model.tried :])}")
                found = self.trials.added(addition, [one.model for one in fresh])
                if found is None:
                    continue
                fresh.append(self.trials.judged_or_wider(self.trials.pruned(found), addition.score.tried))
                if fresh[-1].is_white and len(addition.score.tried) == 1:
                    done = max(done, addition.score.log_evidence)
            self.trials.tried += fresh
            further = accepted(best, fresh)
            if further is best:
                self._pushed(best, None)
                break
            best = further
            self.say(f"accepted: {best.model.label}, held-out χ²/dof {best.held_out.chi2_per_dof:.3f}")
            seen = self.trials.look(best.model)
        return best, seen

    def _in_vain(self, best: Candidate) -> bool:
        """Whether additions to the model as it is were already tried: over the first seconds, and then in full."""
        return not (best.model.tried or self.start.follows) and bool(self.trials.passing)

    def _pushed(self, best: Candidate, seen: View | None) -> bool:
        """Whether pushes are all that is left; with a view, only where they say more than any effect would."""
        if not self.look_for_pushes:
            return False
        found = find_pushes(best.model, best.held_out, self.start.held_out)
        gain = sum(push.gain or 0.0 for push in found)
        if seen is not None and found:
            evidence = 0.5 * gain / seen.projected.inflation - PUSH_COST * len(found)
            least = seen.singles[0].log_evidence if seen.singles else 0.0
            found = found if evidence > least else ()
        self.pushes = found
        return bool(found)

    def _with_imitators(self, best: Candidate, last: View) -> tuple[Candidate, View]:
        """The search on from what may stand in the place of a term, where that is more convincing.

        Each term was chosen before those that came after it: beside them another may do the same with less freedom.
        """
        if not best.model.whole:
            return best, last
        fresh = [self.trials.judged(model) for model in in_their_place(last, self.start.whole_ground, self.say)]
        self.trials.tried += fresh
        as_good = {id(c.model): c for c in fresh if c.held_out.chi2 < best.held_out.chi2 + 2 * ENOUGH}
        chosen = as_good.get(id(most_convincing(best.model, [c.model for c in as_good.values()])))
        return (best, last) if chosen is None else self._over_whole_windows(chosen)

    def _without_the_doubtful(self, best: Candidate, last: View) -> tuple[Candidate, View]:
        """The search once more without what the best model may have in another's place, where structure stays."""
        first, pushes = best, self.pushes
        for kept in _less_doubtful(first):
            without = self.trials.keeping(first.model, kept)
            if without is None or best.is_white:
                continue
            found, seen = self._over_whole_windows(self.trials.judged(without))
            if found.whiteness.excess < best.whiteness.excess:
                best, last, pushes = found, seen, self.pushes
        self.pushes = pushes
        return best, last


def _less_doubtful(best: Candidate) -> list[list[int]]:
    """Which terms to keep: all that do not oscillate; and of a full model all but the cheapest.

    The first seconds hardly tell one phase for all windows from a phase of each, nor the frequency.
    """
    model = best.model
    if best.is_white or not model.whole:
        return []
    every = range(len(model.tried))
    steady = [k for k in every if model.tried[k].effect.id not in PERIODIC]
    options = [steady] if 0 < len(steady) < len(model.tried) else []
    if len(model.tried) == MOST_TERMS:
        cheapest = min(every, key=lambda k: price(model, k))
        dearer = [k for k in every if k != cheapest]
        options += [dearer] if dearer not in options else []
    return options
