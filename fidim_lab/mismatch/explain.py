"""`explain`: a campaign in; out come the physics that the model leaves out, and the evidence.

A pipeline of stages, each of which hands one frozen value to the next:

    campaign → Cleaned (`clean`) → Reached (`with_corrections`, `rounds`: fits and searches)
             → Judged (`judge`, `unless_outdone`) → Explanation (`tell`)
             → the same with geometry, readings, clocks, what has no name, test windows, whole windows, what was cut out
"""

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from time import perf_counter

from fidim_lab.data.records import Campaign
from fidim_lab.errors import SetupError
from fidim_lab.identification.choice import soft_mode
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.cleaning.clean import Cleaned, clean
from fidim_lab.mismatch.cleaning.restored import without_needless, without_needless_contacts
from fidim_lab.mismatch.conclusion.answer import with_answer
from fidim_lab.mismatch.conclusion.certainty import only_certain, with_swivels
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.merge_cleaning import with_cleaning
from fidim_lab.mismatch.conclusion.message import body_parameters, tell
from fidim_lab.mismatch.conclusion.opened_once import with_unfitted
from fidim_lab.mismatch.conclusion.parsimony_check import unless_outdone
from fidim_lab.mismatch.conclusion.session import with_session
from fidim_lab.mismatch.conclusion.surveyed import with_geometry
from fidim_lab.mismatch.conclusion.timing import with_timing
from fidim_lab.mismatch.conclusion.unnamed import with_unknown
from fidim_lab.mismatch.conclusion.verdict import Judged, judge
from fidim_lab.mismatch.conclusion.whole_motion import with_whole_motion
from fidim_lab.mismatch.corrected import with_corrections
from fidim_lab.mismatch.fitting.baseline import Baseline, ready
from fidim_lab.mismatch.linearised.hypotheses import check_known
from fidim_lab.mismatch.residuals.channels import channels
from fidim_lab.mismatch.rounds import Reached, Rounds
from fidim_lab.mismatch.whole_motion.common_part import elastic, rigid
from fidim_lab.say import Say

OPEN = (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED)
"""verdicts that leave something to be found"""


def explain(
    campaign: Campaign,
    *,
    native: bool = True,
    say: Say = lambda _: None,
    effort: float = 1.0,
    patience: float | None = None,
    without: Collection[str] = (),
) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    effort: times the usual work (`budget`) after which no further model is tried, and what there is, is told; patience:
    s of CPU time after which it is so, too.
    without: ids of effects that are taken as unknown: the catalogue less these.
    Raises SetupError for what cannot be left out or waited for, RefusedError where no window can be fitted at all, or
    where the robot file is grossly and simply wrong.
    """
    check_known(without)
    for name, value in (("effort", effort), ("patience", patience)):
        if value is not None and not value >= 0:
            raise SetupError(f"{name} = {value:g}: it is at least 0.")
    begin, budget = perf_counter(), Budget(effort, patience)
    cleaned = clean(campaign, say=say)
    rounds = Rounds(ready(campaign.robot, native=native), say, budget, frozenset(without))
    reached = with_corrections(rounds, cleaned)
    last = reached.last
    judged = unless_outdone(judge(last.found), last.found, last.cleaned.campaign, say)
    told = tell(last.baseline, last.found, judged, perf_counter() - begin)
    told = _beside(reached.before, told)
    told = with_geometry(told, last.baseline, reached.exact, judged)
    told = with_session(told, reached.changes, cleaned)
    told = with_timing(told, judged.named.model, put_right=last.retimed)
    whole, last_word = with_unknown(told, judged, last.cleaned.campaign, say)
    whole = with_unfitted(whole, last.cleaned.campaign, reached.before, judged.named, last_word)
    shown = last_word.fit
    audited = _audited(campaign, cleaned, reached, judged, whole)
    if whole.verdict in OPEN:
        soft, searched = soft_mode(audited.campaign), last.cleaned.campaign
        common = partial(rigid, searched, reached.mechanism)
        if soft is not None:
            whole, searched = _on_rigid_cables(whole, soft), audited.campaign
            common = partial(elastic, searched, soft)
        if soft is not None or not _has_law(whole, judged, audited):
            tried, longer = last.found.tried, budget.for_whole_windows
            whole, completed = with_whole_motion(whole, searched, common, tried, longer, say, without)
            if completed is not None:
                shown = completed
                audited = without_needless_contacts(cleaned, audited, completed)
    whole = with_swivels(whole, shown)
    whole = replace(whole, seconds=perf_counter() - begin, work=budget.work, channels=channels(shown))
    return with_answer(only_certain(with_cleaning(whole, audited)))


def _beside(before: Baseline, told: Explanation) -> Explanation:
    """The answer beside the model as it is: of the campaign as it was recorded, of the robot as its file has it."""
    held = before.predicted
    return replace(
        told,
        chi2_per_dof=replace(told.chi2_per_dof, before=held.chi2_per_dof),
        rms_mm=replace(told.rms_mm, before=1e3 * held.rms),
        parameters_before=body_parameters(before.fit, before.campaign),
    )


def _audited(campaign: Campaign, cleaned: Cleaned, reached: Reached, judged: Judged, told: Explanation) -> Cleaned:
    """What was cleaned away, less what the model that is told makes needless."""
    found, audited = reached.last.found, reached.last.cleaned
    if found.best.is_white and judged.outdone_by is None:
        right = campaign if reached.changes is None else reached.changes.put_right(campaign)
        audited = without_needless(right, audited, found.best.model)
    if told.unknown is not None:
        audited = without_needless_contacts(cleaned, audited, told.unknown.fit)
    return audited


def _has_law(told: Explanation, judged: Judged, audited: Cleaned) -> bool:
    """Whether a law without a name takes most of what is missing, and the kinematics are as the robot file says.

    Then only a force is missing; all effects that are known were tried for it.
    """
    halves = judged.law is not None if told.unknown is None else told.unknown.halves
    return halves and not audited.screening.contradicts_kinematics


def _on_rigid_cables(told: Explanation, soft: str) -> Explanation:
    """An answer that stands where elastic cables say no more: that rigid ones are the wrong model is said first.

    soft: how that is seen.
    """
    advice = f"The cables hardly hold one direction ({soft}). Rigid cables, which this search assumes, are "
    advice += "the wrong model of this robot: `fidim identify` fits elastic cables with rotational dissipation, and "
    advice += "the residual to look at is that of its fit."
    return replace(told, message=f"{advice} {told.message}")
