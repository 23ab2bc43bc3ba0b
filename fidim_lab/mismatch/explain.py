"""`explain`: a campaign in, what physics was left out and how that is known.

A pipeline of stages, each of which hands one frozen value to the next:

    campaign → Cleaned (`clean`) → Baseline (`baseline`) → Cleaned (`audit`), and then a Baseline again
             → Selection (`select`) → Cleaned (`restored`), and where that changed once more Baseline and Selection
             → Judged (`verdict`) → Explanation (`telling`, `timing`, `unnamed`), as recorded (`aftermath`)
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.identification.choice import soft_mode
from fidim_lab.mismatch.aftermath import with_cleaning
from fidim_lab.mismatch.audit import audit
from fidim_lab.mismatch.baseline import fit_baseline, ready
from fidim_lab.mismatch.clean import clean
from fidim_lab.mismatch.explanation import Explanation, Verdict
from fidim_lab.mismatch.restored import restored
from fidim_lab.mismatch.select import select
from fidim_lab.mismatch.soft_cables import compare
from fidim_lab.mismatch.soft_telling import soft_answer
from fidim_lab.mismatch.telling import tell
from fidim_lab.mismatch.timing import with_timing
from fidim_lab.mismatch.unnamed import with_unknown
from fidim_lab.mismatch.verdict import judge

Say = Callable[[str], None]


def explain(campaign: Campaign, *, native: bool = True, say: Say = lambda _: None) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    Raises RefusedError where no window can be fitted at all, or where the robot file is grossly and simply wrong.
    """
    begin = perf_counter()
    mechanism = ready(campaign.robot, native=native)
    cleaned = clean(campaign, say=say)
    baseline = fit_baseline(cleaned.campaign, native=native, say=say, mechanism=mechanism)
    audited = audit(cleaned, baseline, say=say)
    if audited is not cleaned:
        baseline = fit_baseline(audited.campaign, native=native, say=say, mechanism=mechanism)
    found = select(baseline, say)
    kept = restored(cleaned, audited, found.best.model, say)
    if kept is not audited:
        audited = kept
        baseline = fit_baseline(audited.campaign, native=native, say=say, mechanism=mechanism)
        found = select(baseline, say)
    judged = judge(found)
    told = with_timing(tell(baseline, found, judged, perf_counter() - begin), judged.named.model)
    whole = with_unknown(told, judged.named.model, audited.campaign, say)
    whole = _with_soft_mode(whole, audited.campaign, say)
    return with_cleaning(replace(whole, seconds=perf_counter() - begin), audited)


def _with_soft_mode(told: Explanation, campaign: Campaign, say: Say) -> Explanation:
    """Where something stays unexplained and cables hold one direction hardly at all: what elastic ones say.

    Where they say nothing, that rigid ones are the wrong model is said first.
    """
    soft = soft_mode(campaign) if told.verdict in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED) else None
    if soft is None:
        return told
    with suppress(RefusedError):
        answer = soft_answer(told, compare(campaign, say), campaign.robot, soft)
        if answer is not None:
            return answer
    advice = f"The cables hold one direction hardly at all ({soft}). Rigid cables, on which this search stands, are "
    advice += "the wrong model of this robot: `fidim identify` fits elastic ones with what dissipates rotation, and "
    advice += "its remainder is the one to look at."
    return replace(told, message=f"{advice} {told.message}")
