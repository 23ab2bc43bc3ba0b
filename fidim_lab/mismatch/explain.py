"""`explain`: a campaign in, what physics was left out and how that is known.

A pipeline of stages, each of which hands one frozen value to the next:

    campaign → Cleaned (`clean`) → Baseline (`baseline`) → Cleaned (`audit`), and then a Baseline again
             → Selection (`select`), and where a push is all that is left, without it from Baseline on (`restarts`)
             → Cleaned (`restored`), and where that changed once more Baseline and Selection;
               and so once more where the clocks run apart (`timing`);
               and all with the geometry open, where that says more (`general_geometry`)
             → Judged (`verdict`, `outdone`) → Explanation (`telling`, `timing`, `unnamed`), as recorded (`aftermath`)
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from time import perf_counter

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.identification.choice import soft_mode
from fidim_lab.identification.cleaning.free_motion import whole_id
from fidim_lab.identification.mle.geometry import ODDS
from fidim_lab.mismatch.cleaning.clean import Cleaned, clean
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.cleaning.residual_checks import audit
from fidim_lab.mismatch.cleaning.restored import restored, without_needless_contacts, without_needless_faults
from fidim_lab.mismatch.conclusion.answer import with_answer
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.merge_cleaning import with_cleaning
from fidim_lab.mismatch.conclusion.message import body_parameters, tell
from fidim_lab.mismatch.conclusion.opened_once import with_test
from fidim_lab.mismatch.conclusion.parsimony_check import unless_outdone
from fidim_lab.mismatch.conclusion.soft_cables import compare
from fidim_lab.mismatch.conclusion.soft_message import soft_answer
from fidim_lab.mismatch.conclusion.surveyed import with_geometry
from fidim_lab.mismatch.conclusion.timing import retimed, with_timing
from fidim_lab.mismatch.conclusion.unnamed import with_unknown
from fidim_lab.mismatch.conclusion.verdict import judge
from fidim_lab.mismatch.conclusion.whole_motion import with_whole_motion
from fidim_lab.mismatch.fitting.baseline import Baseline, fit_baseline, ready
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.budget import PATIENCE, Patience
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.general_geometry import first_look, instead_of_a_search, opened, rival
from fidim_lab.mismatch.selection.select import Selection, select
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import Say

MOST_CUTS = 2
"""how often pushes that only the best model shows are cut out"""
OPEN = (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED)
"""verdicts that leave something to be found"""


def explain(
    campaign: Campaign,
    *,
    native: bool = True,
    say: Say = lambda _: None,
    patience: float = PATIENCE,
    without: Collection[str] = (),
) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    patience: s of CPU time after which no further model is tried, and what there is, is told.
    without: ids of effects that are taken as unknown: the catalogue less these.
    Raises RefusedError where no window can be fitted at all, or where the robot file is grossly and simply wrong.
    """
    begin, until = perf_counter(), Patience(patience)
    cleaned = clean(campaign, say=say)
    mechanism = ready(campaign.robot, native=native)
    left_out = frozenset(without)
    exact = fit_baseline(cleaned.campaign, native=native, say=say, mechanism=mechanism, without=left_out)
    way = _Way(mechanism, say, until)
    seen = first_look(exact)
    surveyed = instead_of_a_search(exact, seen, say)
    first, last = way.gone(cleaned, surveyed or exact, seen)
    if surveyed is None:
        first, last = _with_geometry_open(way, cleaned, exact, first, last)
    judged = unless_outdone(judge(last.found), last.found, last.cleaned.campaign, say)
    told = tell(last.baseline, last.found, judged, perf_counter() - begin)
    if last is not first or last.baseline.geometry:
        told = _before(exact if last.baseline.geometry else first.baseline, told)
    told = with_geometry(told, last.baseline, exact, judged)
    told = with_timing(told, judged.named.model, put_right=last is not first)
    whole = with_unknown(told, judged.named, last.cleaned.campaign, say, judged.outdone_by)
    last_word = judged.named.model if whole.unknown is None else Completed((), whole.unknown.fit, whole=True)
    whole = with_test(whole, last.cleaned.campaign, exact, last_word)
    audited = last.cleaned
    if last.found.best.is_white and judged.outdone_by is None:
        audited = without_needless_faults(campaign, audited, last.found.best.model)
    if whole.unknown is not None and audited.contacts:
        audited = without_needless_contacts(cleaned, audited, whole.unknown.fit)
    if whole.verdict in OPEN:
        soft = soft_mode(audited.campaign)
        if soft is None:
            whole = with_whole_motion(whole, last.cleaned.campaign, mechanism, say, left_out)
        else:
            whole = _with_soft_mode(whole, audited.campaign, soft, say)
    return with_answer(with_cleaning(replace(whole, seconds=perf_counter() - begin), audited))


@dataclass(frozen=True, eq=False)
class _Way:
    """From a cleaned campaign to where its search ends."""

    mechanism: Mechanism
    """the model as it is"""
    say: Say
    patience: Patience

    def gone(self, cleaned: Cleaned, baseline: Baseline, seen: View | None = None) -> "tuple[_Looked, _Looked]":
        """As recorded, and as the clocks have it: the same where nothing is wrong with these.

        seen: all scores at the baseline, where they are known.
        """
        audited = audit(cleaned, baseline, say=self.say)
        begun = baseline if audited is cleaned else self._fitted(audited, baseline)
        first = self._look(audited, begun, seen=seen)
        kept = restored(cleaned, first.cleaned, first.found.best.model, self.say)
        if kept is not first.cleaned:
            again = baseline if _all_put_back(cleaned, kept) else self._fitted(kept, baseline)
            first = self._look(kept, again, first.found.best.model)
        return first, self._by_the_right_clock(first)

    def _fitted(self, cleaned: Cleaned, like: Baseline) -> Baseline:
        """The baseline of other windows, with the same geometry open and the same effects tried."""
        return fit_baseline(
            cleaned.campaign,
            native=self.mechanism.native,
            say=self.say,
            mechanism=self.mechanism,
            geometry=like.geometry,
            without=like.without,
        )

    def _look(
        self,
        cleaned: Cleaned,
        baseline: Baseline,
        known: Completed | None = None,
        cuts: int = MOST_CUTS,
        seen: View | None = None,
    ) -> "_Looked":
        found = select(baseline, self.say, pushes=cuts > 0, known=known, patience=self.patience, seen=seen)
        if not found.pushes:
            return _Looked(cleaned, baseline, found)
        less = _without(cleaned, found.pushes, self.say)
        again = self._look(less, self._fitted(less, baseline), known=found.best.model, cuts=cuts - 1)
        if again.found.best.is_white or self.patience.ended:
            return again
        return _Looked(cleaned, baseline, select(baseline, self.say, pushes=False, patience=self.patience))

    def _by_the_right_clock(self, first: "_Looked") -> "_Looked":
        """The search with the cameras' stamps put right, where currents say that they run away; else `first` itself.

        A clock that runs fast looks like a little more gravity, and blurs what is missing besides. The other time is
        kept where as much is explained with it by no more effects.
        """
        best = first.found.best
        campaign = retimed(first.cleaned.campaign, best.model)
        if campaign is None:
            return first
        self.say("by the motor currents the clocks run apart: looking again with the cameras' put right")
        cleaned = replace(first.cleaned, campaign=campaign)
        again = self._look(cleaned, self._fitted(cleaned, first.baseline))
        return again if _unexplained(again.found.best) <= _unexplained(best) else first


def _with_geometry_open(
    way: _Way, cleaned: Cleaned, exact: Baseline, first: "_Looked", last: "_Looked"
) -> "tuple[_Looked, _Looked]":
    """The way with an open geometry, where that says more than what was found and explains as much; else as it was."""
    best = last.found.best
    settled = best.is_white and not best.model.tried
    if settled or exact.campaign.robot.survey is not None or way.patience.ended:
        return first, last
    seen = last.found.last
    general = rival(seen)
    if general is None or general.best < ODDS:
        return first, last
    noise = seen.fit.noise_ratio**2
    if not (best.is_white or general.temper - noise < SELECTION.geometry_takes * (seen.projected.inflation - noise)):
        return first, last
    again, end = way.gone(cleaned, opened(exact, general, way.say))
    after = end.found.best
    if best.is_white or after.is_white:
        return (again, end) if _unexplained(after) <= _unexplained(best) else (first, last)
    takes = after.whiteness.excess < SELECTION.geometry_takes * best.whiteness.excess
    return (again, end) if takes else (first, last)


def _all_put_back(cleaned: Cleaned, kept: Cleaned) -> bool:
    """Whether nothing is cut out any more, so that the first fit of the model as it is still holds."""
    before, after = cleaned.campaign.windows, kept.campaign.windows
    return len(before) == len(after) and all(one is other for one, other in zip(before, after, strict=True))


def _without(cleaned: Cleaned, pushes: Sequence[Contact], say: Say) -> Cleaned:
    """The campaign without pushes that only the best model shows."""
    for push in pushes:
        say(push.says)
    contacts = tuple(replace(push, window=whole_id(push.window)) for push in pushes)
    campaign = without(cleaned.campaign, pushes)
    return replace(cleaned, campaign=campaign, contacts=(*cleaned.contacts, *contacts))


@dataclass(frozen=True, eq=False)
class _Looked:
    """Where one search ended."""

    cleaned: Cleaned
    """what was searched"""
    baseline: Baseline
    found: Selection


def _unexplained(best: Candidate) -> tuple[bool, float]:
    """Whether anything is left, and then how much; else by how many effects nothing is."""
    return (not best.is_white, len(best.model.tried) if best.is_white else best.whiteness.excess)


def _before(first: Baseline, told: Explanation) -> Explanation:
    """The answer beside the model as it is: of the campaign as its clocks have it, of the robot as its file has it."""
    held = first.predicted
    return replace(
        told,
        chi2_per_dof=replace(told.chi2_per_dof, before=held.chi2_per_dof),
        rms_mm=replace(told.rms_mm, before=1e3 * held.rms),
        parameters_before=body_parameters(first.fit, first.campaign),
    )


def _with_soft_mode(told: Explanation, campaign: Campaign, soft: str, say: Say) -> Explanation:
    """Where something stays unexplained and cables hold one direction hardly at all: what elastic ones say.

    soft: how that is seen. Where elastic cables say nothing, that rigid ones are the wrong model is said first.
    """
    with suppress(RefusedError):
        answer = soft_answer(told, compare(campaign, say), campaign.robot, soft)
        if answer is not None:
            return answer
    advice = f"The cables hold one direction hardly at all ({soft}). Rigid cables, on which this search stands, are "
    advice += "the wrong model of this robot: `fidim identify` fits elastic ones with what dissipates rotation, and "
    advice += "its remainder is the one to look at."
    return replace(told, message=f"{advice} {told.message}")
