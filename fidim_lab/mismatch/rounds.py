"""Rounds of cleaning, fitting and searching: from a cleaned campaign to the end of its search.

A round is begun again where what it found says that the campaign was not what it should be: a push that only the best
model shows is cut out, clocks that run apart are put right, a geometry that the robot file gets wrong is opened. Each
time the new round is kept only where it explains as much by no more effects. What differs between windows is for
`corrected`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.cleaning.residual_checks import audit
from fidim_lab.mismatch.cleaning.restored import restored
from fidim_lab.mismatch.conclusion.timing import RATE, one_clock, retimed
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline, ready
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.beside_terms import Beside
from fidim_lab.mismatch.selection.general_geometry import FirstLook, opened, rival
from fidim_lab.mismatch.selection.select import Selection, select
from fidim_lab.mismatch.session.changes import SessionChanges
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import Say

MOST_CUTS = 2
"""how often pushes that only the best model shows are cut out"""


@dataclass(frozen=True, eq=False)
class Round:
    """The result of one search."""

    cleaned: Cleaned
    """what was searched"""
    baseline: Baseline
    found: Selection
    retimed: bool = False
    """whether the cameras' clock was put right for it"""
    surveyed: bool = False
    """whether it was searched with an open geometry, too"""

    @property
    def unexplained(self) -> tuple[bool, float]:
        """Whether anything is left, and then how much; else by how many effects nothing is."""
        best = self.found.best
        return (not best.is_white, len(best.model.tried) if best.is_white else best.whiteness.excess)


@dataclass(frozen=True, eq=False)
class Reached:
    """The result of all rounds."""

    mechanism: Mechanism
    """the model as it is, without any effect"""
    recorded: Baseline
    """fitted to the campaign as it was recorded"""
    exact: Baseline
    """fitted to the readings as they should have been, with the robot file's own geometry"""
    first: Round
    """by the clocks as they were recorded"""
    last: Round
    changes: SessionChanges | None = None
    """between windows, for which the campaign was corrected"""

    @property
    def terms(self) -> int:
        """Effects and changes together."""
        return len(self.last.found.best.model.tried) + (0 if self.changes is None else len(self.changes.found))

    @property
    def before(self) -> Baseline:
        """The model as it is, beside which the answer is told."""
        if self.changes is not None:
            return self.recorded
        return self.exact if self.last.baseline.geometry else self.first.baseline


@dataclass(frozen=True, eq=False)
class Rounds:
    """The data that all rounds of one campaign share."""

    mechanism: Mechanism
    """the model as it is"""
    say: Say
    budget: Budget
    without: frozenset[str] = frozenset()
    """ids of effects that are not tried"""
    beside: Beside = field(default_factory=partial(Beside, changes=True))
    """what a search is broken off for, besides an open geometry"""

    def of_robot(self, robot: Robot) -> "Rounds":
        """The same of a robot whose sensors have another noise."""
        return (
            self
            if robot is self.mechanism.robot
            else replace(self, mechanism=ready(robot, native=self.mechanism.native))
        )

    def searched(
        self, cleaned: Cleaned, recorded: Baseline, look: FirstLook, known: Completed | None = None
    ) -> Reached:
        """Where the search ends, with the clocks and the geometry as they say most.

        look: at these windows. known: a model that may leave only noise of them.
        """
        exact, surveyed = look.exact, look.instead_of_a_search
        first, last = self._gone(cleaned, surveyed or exact, known, seen=look.seen if surveyed is None else None)
        if surveyed is None:
            first, last = self._with_geometry_open(cleaned, exact, first, last)
        return Reached(self.mechanism, recorded, exact, first, last)

    def _gone(
        self, cleaned: Cleaned, baseline: Baseline, known: Completed | None = None, seen: View | None = None
    ) -> tuple[Round, Round]:
        """As recorded, and as the clocks have it: the same where nothing is wrong with these.

        known: a model that may leave only noise. seen: all scores at the baseline, where they are known.
        """
        audited = audit(cleaned, baseline, say=self.say)
        begun = baseline if audited is None else self.fitted(audited.campaign, baseline)
        first = self._look(audited or cleaned, begun, known, seen)
        if first.found.changes is not None:
            return first, first
        kept = restored(cleaned, first.cleaned, first.found.best.model, self.say)
        if kept is not None:
            all_put_back = kept.campaign.windows == cleaned.campaign.windows
            again = baseline if all_put_back else self.fitted(kept.campaign, baseline)
            first = self._look(kept, again, first.found.best.model)
        return first, self._by_the_right_clock(first)

    def fitted(self, campaign: Campaign, like: Baseline | None = None) -> Baseline:
        """The baseline of these windows, with the same geometry open. Raises RefusedError where none can be fitted."""
        return fit_baseline(
            campaign,
            native=self.mechanism.native,
            say=self.say,
            mechanism=self.mechanism,
            geometry=None if like is None else like.geometry,
            without=self.without,
        )

    def _look(
        self, cleaned: Cleaned, baseline: Baseline, known: Completed | None = None, seen: View | None = None
    ) -> Round:
        """Search; where it is broken off for pushes, cut these out and search again.

        Where the geometry says more than any further effect, it is opened and searched so; where it is what differs
        between windows, that is for `corrected`. Where the windows without
        pushes leave structure too, the pushes were none: the last round that was broken off is then searched to its end
        instead. So it is with the geometry, which stays open where it leaves less than half.
        """
        broken_off: list[Round] = []
        free = baseline.campaign.robot.survey is None and not baseline.geometry
        beside = replace(self.beside, geometry=free)
        found = select(baseline, self.say, known=known, budget=self.budget, seen=seen, beside=beside)
        while found.pushes or found.opening is not None:
            broken_off.append(Round(cleaned, baseline, found))
            known = found.best.model
            if found.opening is not None:
                known, beside = found.opening.beside, replace(beside, geometry=False)
                baseline = opened(baseline, found.opening.factor, self.say)
            else:
                cleaned = _without(cleaned, found.pushes, self.say)
                baseline = self.fitted(cleaned.campaign, baseline)
            more = len(broken_off) < MOST_CUTS
            found = select(baseline, self.say, pushes=more, known=known, budget=self.budget, beside=beside)
        reached = Round(cleaned, baseline, found)
        if found.changes is not None:
            return reached
        surveyed = any(before.found.opening is not None for before in broken_off)
        for before in reversed(broken_off):
            if reached.found.best.is_white or self.budget.is_spent:
                break
            found = select(before.baseline, self.say, pushes=False, budget=self.budget)
            again = Round(before.cleaned, before.baseline, found, surveyed=surveyed)
            alike = bool(before.baseline.geometry) == bool(reached.baseline.geometry)
            reached = again if alike or takes_more(again, reached) else reached
        return reached

    def _by_the_right_clock(self, first: Round) -> Round:
        """The search with the cameras' stamps put right, where currents say that they run away; else `first` itself.

        A clock of another rate looks like gravity of another strength, and blurs what is missing besides. Where the
        model has such a rate and currents say that there is none, the search is repeated without it. The other time, or
        model, is kept where as much is explained with it by no more effects.
        """
        if one_clock(first.found.best.model):
            self.say("by the motor currents cameras and winches have one clock: repeating without another rate")
            without_rate = replace(self, without=self.without | {RATE}).fitted(first.cleaned.campaign, first.baseline)
            again = self._look(first.cleaned, without_rate)
            return again if again.unexplained <= first.unexplained else first
        campaign = retimed(first.cleaned.campaign, first.found.best.model)
        if campaign is None:
            return first
        self.say("by the motor currents the clocks differ: repeating with corrected camera times")
        cleaned = replace(first.cleaned, campaign=campaign)
        again = self._look(cleaned, self.fitted(cleaned.campaign, first.baseline))
        return replace(again, retimed=True) if again.unexplained <= first.unexplained else first

    def _with_geometry_open(self, cleaned: Cleaned, exact: Baseline, first: Round, last: Round) -> tuple[Round, Round]:
        """The rounds with an open geometry, where that says more than what was found and explains as much."""
        best = last.found.best
        settled = last.surveyed or last.found.changes is not None or (best.is_white and not best.model.tried)
        if settled or exact.campaign.robot.survey is not None or self.budget.is_spent:
            return first, last
        seen = last.found.last
        general = rival(seen)
        if general is None or general.best < ODDS:
            return first, last
        noise = max(1.0, seen.fit.noise_ratio**2)  # what is foretold, and what was seen, are at least 1 as well
        left = SHARED.half * (seen.projected.inflation - noise)
        if not (best.is_white or general.temper - noise < left):
            return first, last
        again, end = self._gone(cleaned, opened(exact, general.factor, self.say), best.model)
        after = end.found.best
        if best.is_white or after.is_white:
            return (again, end) if end.unexplained <= last.unexplained else (first, last)
        return (first, last) if takes_more(last, end) else (again, end)


def takes_more(exact: Round, surveyed: Round) -> bool:
    """Whether a round with the robot file's geometry leaves only noise, or not twice what an open geometry leaves."""
    best, other = exact.found.best, surveyed.found.best
    return best.is_white or other.whiteness.excess >= SHARED.half * best.whiteness.excess


def _without(cleaned: Cleaned, pushes: Sequence[Contact], say: Say) -> Cleaned:
    """The campaign without pushes that only the best model shows."""
    for push in pushes:
        say(push.says)
    contacts = tuple(replace(push, window=whole_id(push.window)) for push in pushes)
    campaign = without(cleaned.campaign, pushes)
    return replace(cleaned, campaign=campaign, contacts=(*cleaned.contacts, *contacts))
