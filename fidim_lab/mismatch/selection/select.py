"""From the model without effects to the best set: compute all scores, fit the best few, take one, repeat.

First over the first seconds, wherever whole windows are not followed: cheap, and no phase can slip there. What survives
is fitted to whole windows, and the search continues there. A term is taken when the evidence supports it (> 5 nats)
and, of whole windows, when held-out ones are predicted better; a term that another has made needless is dropped again
(together: a swap). At most three terms.
"""

from dataclasses import dataclass, replace

from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.scores.views import PERIODIC, View
from fidim_lab.mismatch.selection.beside_terms import Beside, ChangesBeside
from fidim_lab.mismatch.selection.candidates import (
    Candidate,
    accepted,
    best_of,
    candidate,
    common_scale,
    evidence_of_all,
    price,
    rank,
)
from fidim_lab.mismatch.selection.confounders import in_their_place
from fidim_lab.mismatch.selection.general_geometry import Opening
from fidim_lab.mismatch.selection.search import Search, SearchState
from fidim_lab.mismatch.selection.single_force import LoneWrench
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class Selection:
    """The result of the search, and the models tried."""

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
    beside: Opening | ChangesBeside | None = None
    """the best model's terms, for which the search was broken off"""
    cut_short: str = ""
    """why it was not gone on with, where structure stays and the budget is spent"""
    alone: UnknownForce | None = None
    """one unknown wrench, where it was asked for: without terms where none explains nearly all"""
    outdone: Completed | None = None
    """the best model of the first seconds, where that wrench says more, so that the search went no further"""

    @property
    def opening(self) -> Opening | None:
        """Of the geometry, where it was broken off for that."""
        return self.beside if isinstance(self.beside, Opening) else None

    @property
    def changes(self) -> ChangesBeside | None:
        """Between windows, where it was broken off for these."""
        return self.beside if isinstance(self.beside, ChangesBeside) else None


def select(
    start: Baseline,
    say: Say,
    *,
    pushes: bool = True,
    known: Completed | None = None,
    budget: Budget | None = None,
    seen: View | None = None,
    beside: Beside | None = None,
) -> Selection:
    """Search for what was left out, starting from the fits of the model as it is.

    pushes: break off where a push within a few windows is all that is left, so that it can be cut out. known: the model
    with which a search of nearly the same windows ended; where it leaves only noise of these, it is where this begins.
    seen: all scores at a baseline, where they are known. beside: what to break off for where it says more than effects.
    """
    search = Search(start, say, pushes, budget or Budget(), seen, beside)
    baseline = candidate(start.as_it_is, start.predicted)
    say(f"without any effect: {baseline.held_out.says}")
    settled = None if baseline.is_white else search.known_to_do(known)
    best, lone = settled or baseline, LoneWrench(baseline, start.campaign, say)
    hands: tuple[Contact, ...] = ()
    if settled is None and not start.follows:
        short, other = search.over_first_seconds(lambda model: lone.seek([model]).outdoes([model]))
        outdone = other is None and lone.seek(short).outdoes(short)
        if other is None and not outdone:
            best, hands = search.best_over_all(baseline, short, lone.leaves_noise)
            outdone = lone.leaves_noise and not best.is_white
        first = search.trials.first
        if first is not None and (outdone or other is not None):
            tried = tuple(sorted([baseline, *search.trials.tried], key=rank))
            done = Selection(baseline, baseline, tried, tuple(search.trials.passing), first, first, beside=other)
            return replace(done, alone=lone.found, outdone=short[0]) if outdone else done
    standing = search.over_whole_windows(best, hands)
    # a model with which a search ended stood among its imitators already
    if not (standing.is_broken_off or standing.best is settled or search.budget.is_spent):
        standing = _with_siblings(search, _with_imitators(search, standing))
    if not (standing.is_broken_off or start.follows or search.budget.is_spent):
        standing = _without_the_doubtful(search, standing)
    best = standing.best
    return Selection(
        best=best,
        baseline=baseline,
        tried=tuple(sorted([baseline, *search.trials.tried], key=rank)),
        passing=tuple(search.trials.passing),
        first=standing.last if search.trials.first is None else search.trials.first,
        last=standing.last,
        pushes=standing.pushes,
        beside=standing.beside,
        cut_short=search.budget.says if search.budget.is_spent and not best.is_white else "",
        alone=lone.found,
    )


def _with_imitators(search: Search, standing: SearchState) -> SearchState:
    """The search on from what may stand in the place of a term, where that is more convincing.

    Each term was chosen before those that came after it: beside them another may do the same with less freedom.
    """
    best = standing.best
    if not best.model.whole:
        return standing
    fresh = [
        search.trials.judged(model) for model in in_their_place(standing.last, search.start.whole_ground, search.say)
    ]
    search.trials.tried += fresh
    scale = common_scale([best.model, *(one.model for one in fresh)])
    chosen = max(fresh, key=lambda one: evidence_of_all(one, best, scale), default=None)
    if chosen is None or evidence_of_all(chosen, best, scale) < SHARED.enough:
        return standing
    return search.over_whole_windows(search.trials.without_needless(chosen))


def _with_siblings(search: Search, standing: SearchState) -> SearchState:
    """The search on from a model that fits and does not predict, with an effect in it exchanged for its sibling.

    What a drag of the speed imitates of a drag of its square comes out elsewhere, and not where it swings wildest.
    """
    fitting = [
        c.model for c in search.trials.tried if c.model.whole and c.model.excess < SHARED.little and c.model.tried
    ]
    if standing.best.is_white or not fitting:
        return standing
    seen = search.trials.look(best_of(fitting))
    exchanged = in_their_place(seen, search.start.whole_ground, search.say, SELECTION.search_siblings)
    fresh = [search.trials.judged(model) for model in exchanged]
    search.trials.tried += fresh
    further = accepted(standing.best, fresh)
    if further is None:
        return standing
    return search.over_whole_windows(search.trials.without_needless(further), standing.pushes)


def _without_the_doubtful(search: Search, standing: SearchState) -> SearchState:
    """The search once more without what the best model may have in another's place, where structure stays."""
    found = standing
    for kept in _less_doubtful(standing.best):
        without = search.trials.keeping(standing.best.model, kept)
        if without is None or found.best.is_white:
            continue
        again = search.over_whole_windows(search.trials.judged(without))
        if again.best.whiteness.excess < found.best.whiteness.excess:
            found = again
    return found


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
    if len(model.tried) == SHARED.most_terms:
        cheapest = min(every, key=lambda k: price(model, k))
        dearer = [k for k in every if k != cheapest]
        options += [dearer] if dearer not in options else []
    return options
