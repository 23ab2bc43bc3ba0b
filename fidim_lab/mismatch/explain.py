"""`explain`: a campaign in, what physics was left out and how that is known.

A pipeline of stages, each of which hands one frozen value to the next:

    campaign → Baseline (`baseline`) → Selection (`select`) → Judged (`verdict`) → Explanation (`telling`)
"""

from collections.abc import Callable
from time import perf_counter

from fidim_lab.data.records import Campaign
from fidim_lab.mismatch.baseline import fit_baseline
from fidim_lab.mismatch.explanation import Explanation
from fidim_lab.mismatch.select import select
from fidim_lab.mismatch.telling import tell
from fidim_lab.mismatch.verdict import judge

Say = Callable[[str], None]


def explain(campaign: Campaign, *, native: bool = True, say: Say = lambda _: None) -> Explanation:
    """Name what the model leaves out of this campaign.

    native: with compiled C where there is a compiler, as `identify`. say: is told of progress, in sentences.
    Raises RefusedError where no window can be fitted at all.
    """
    begin = perf_counter()
    baseline = fit_baseline(campaign, native=native, say=say)
    found = select(baseline, say)
    judged = judge(found)
    return tell(baseline, found, judged, perf_counter() - begin)
