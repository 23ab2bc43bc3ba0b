"""`explain`: a campaign in, what physics was left out and how that is known.

A pipeline of stages, each of which hands one frozen value to the next:

    campaign → Cleaned (`clean`) → Baseline (`baseline`) → Cleaned (`audit`), and then a Baseline again
             → Selection (`select`) → Judged (`verdict`) → Explanation (`telling`, `unnamed`), as recorded (`aftermath`)
"""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from fidim_lab.data.records import Campaign
from fidim_lab.mismatch.aftermath import with_cleaning
from fidim_lab.mismatch.audit import audit
from fidim_lab.mismatch.baseline import fit_baseline
from fidim_lab.mismatch.clean import clean
from fidim_lab.mismatch.explanation import Explanation
from fidim_lab.mismatch.select import select
from fidim_lab.mismatch.telling import tell
from fidim_lab.mismatch.unnamed import with_unknown
from fidim_lab.mismatch.verdict import judge

Say = Callable[[str], None]


def explain(campaign: Campaign, *, native: bool = True, say: Say = lambda _: None) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    Raises RefusedError where no window can be fitted at all, or where the robot file is grossly and simply wrong.
    """
    begin = perf_counter()
    cleaned = clean(campaign, say=say)
    baseline = fit_baseline(cleaned.campaign, native=native, say=say)
    audited = audit(cleaned, baseline.fit, say=say)
    if audited is not cleaned:
        baseline = fit_baseline(audited.campaign, native=native, say=say)
    found = select(baseline, say)
    judged = judge(found)
    told = tell(baseline, found, judged, perf_counter() - begin)
    whole = with_unknown(told, judged.named.model, audited.campaign, say)
    return with_cleaning(replace(whole, seconds=perf_counter() - begin), audited)
