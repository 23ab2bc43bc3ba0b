"""What became of one spoilt campaign."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.spoilt.kinds import Kind
from fidim_lab.app.analysis.identify import identify_posed
from fidim_lab.app.analysis.pose_from import Posed
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign
from fidim_lab.errors import FidimError

WITHIN = 3.0
"""stated ± of every parameter that counts as right"""


class Verdict(StrEnum):
    RIGHT = "right"
    """exit 0, every parameter within 3 stated ±"""
    SILENT = "wrong and silent"
    """exit 0, and not so"""
    REFUSED = "refused, cause named"
    DOUBTED = "refused, cause not named"
    """exit 1, and no sentence says what was done to the data"""


@dataclass(frozen=True)
class Judged:
    kind: str
    seed: int
    verdict: Verdict
    worst: float
    """largest error in stated ±; nan where none is given"""
    says: str
    seconds: float


def judge(kind: Kind, seed: int, campaign: Campaign, truth: Body) -> Judged:
    try:
        result = identify_posed(Posed(campaign))
    except FidimError as refusal:
        return Judged(kind.name, seed, _refused(kind, str(refusal)), np.nan, str(refusal), 0.0)
    known = dict(zip(PARAMETER_NAMES, truth.vector, strict=True))
    errors = [abs(p.value - known[name]) / p.sd for name, p in result.parameters.items() if p.seen]
    worst = float(max(errors, default=np.nan))
    said = " ".join((result.message, *result.warnings))
    if result.outcome.answers and not result.fallback:
        verdict = Verdict.RIGHT if worst < WITHIN else Verdict.SILENT
    else:
        verdict = _refused(kind, said)
    return Judged(kind.name, seed, verdict, worst, said, result.seconds)


def _refused(kind: Kind, said: str) -> Verdict:
    return Verdict.REFUSED if any(word in said for word in kind.words) else Verdict.DOUBTED
