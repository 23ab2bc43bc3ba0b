"""Trials of `benchmarks.separate` and the page that counts them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.page import table
from benchmarks.sealed.statistics import Share
from fidim_lab.app.judging.judgement import HOPEFUL
from fidim_lab.mismatch.next_experiment.thresholds import NEXT_EXPERIMENT

IDENTIFY, VALIDATE = 3, 2
MORE = 4
"""windows that may be proposed, as in `compare`"""
EVIDENT = 60.0
"""non-centrality against no effect at all that it must have: one that is not seen is named by nobody"""
Pair = tuple[str, str]


@dataclass(frozen=True)
class Row:
    """One sealed trial."""

    pair: Pair
    trial: int
    hidden: str
    size: float
    before: str
    """of the first explanation: right, alike (the pair left open), wrong (the other alone), else"""
    promised: float | None = None
    """odds of the windows that were proposed, the last time"""
    windows: int = 0
    recorded: bool = False
    says: str = ""
    after: str = ""
    """of the second one, as `before`"""
    seconds: float = 0.0
    """of CPU"""

    @property
    def is_sure(self) -> bool:
        """What was recorded in the end was likely to separate them."""
        return (self.promised or 0.0) >= NEXT_EXPERIMENT.proposal_clear

    @property
    def is_likely(self) -> bool:
        """It was worth recording."""
        return HOPEFUL <= (self.promised or 0.0) < NEXT_EXPERIMENT.proposal_clear

    @property
    def is_unable(self) -> bool:
        """It says that free motion does not, at once or after windows that told it from others."""
        return self.promised is not None and self.promised < HOPEFUL


HEAD = (
    "pair",
    "trials",
    "told apart at once",
    "left open",
    "promised ≥ 90 %, then right",
    "promised 50–90 %, then right",
    "says that it cannot",
    "wrong in the end",
    "neither named at first",
    "… in the end",
)


def report(rows: Sequence[Row]) -> str:
    """One line for each pair, and all together."""
    lines = [
        _line(" / ".join(pair), [r for r in rows if r.pair == pair]) for pair in dict.fromkeys(r.pair for r in rows)
    ]
    sure = [r for r in rows if r.is_sure]
    likely = [r for r in rows if r.is_likely]
    open_ = [r for r in rows if r.before == "alike"]
    mean = float(np.mean([r.windows for r in rows if r.recorded])) if any(r.recorded for r in rows) else np.nan
    wrong = [f"- {_wrong(r)}" for r in rows if "wrong" in (r.before, r.after)]
    unable = sum(r.is_unable for r in open_)
    kept = [f"Where ≥ 90 % were promised: right in {_share(sure)}."] if sure else []
    if likely:
        odds = 100 * float(np.mean([r.promised or 0.0 for r in likely]))
        kept.append(f"Where 50–90 % were promised ({odds:.0f} % on average): right in {_share(likely)}.")
    return f"""{len(rows)} trials on the paper's robot: {IDENTIFY} windows to identify from and {VALIDATE} held out,
then {mean:.1f} further windows on average, at most {MORE}. A pair is right when the effect that was hidden is named, or
may stand in the place of a third, and the other may not. Sizes are so small that the first windows should leave the
pair open, yet so large that the effect is seen in them (non-centrality {EVIDENT:g} at least).

{table(HEAD, [*lines, _line("all", list(rows))])}

{" ".join(kept)} Of {len(open_)} that were left open, {unable} were said to be beyond {MORE} windows of free motion.
CPU time of a trial: median {float(np.median([r.seconds for r in rows])):.0f} s, longest
{max(r.seconds for r in rows):.0f} s.
{chr(10).join(["", "Wrong:", "", *wrong]) if wrong else ""}"""


def _share(rows: Sequence[Row]) -> Share:
    return Share(sum(r.after == "right" for r in rows), len(rows))


def _line(name: str, rows: Sequence[Row]) -> Sequence[object]:
    sure = [r for r in rows if r.is_sure]
    likely = [r for r in rows if r.is_likely]
    unable = [r for r in rows if r.is_unable]
    return (
        name,
        len(rows),
        sum(r.before == "right" for r in rows),
        sum(r.before == "alike" for r in rows),
        _of(sure),
        _of(likely),
        len(unable),
        sum("wrong" in (r.before, r.after) for r in rows),
        sum(r.before == "else" for r in rows),
        sum((r.after or r.before) == "else" for r in rows),
    )


def _of(rows: Sequence[Row]) -> str:
    return f"{sum(r.after == 'right' for r in rows)}/{len(rows)}" if rows else "–"


def _wrong(row: Row) -> str:
    other = row.pair[1 - row.pair.index(row.hidden)]
    when = (
        "at once"
        if row.before == "wrong"
        else f"after {row.windows} windows with {100 * (row.promised or 0):.0f} % promised"
    )
    return f"{row.hidden} ({row.size:.2g}) called {other} {when}: trial {row.trial}"
