"""What became of one spoilt campaign: written as files, read and identified as `fidim identify` does."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from benchmarks.spoilt.spoiling import Kind
from fidim_lab.app.workflows.identify import run_identify
from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.records import Body, Campaign
from fidim_lab.errors import FidimError
from fidim_lab.identification.results.result import IdentificationResult

WITHIN = 3.0
"""stated ± of every parameter that counts as right"""


class Verdict(StrEnum):
    RIGHT = "right"
    """exit 0, every parameter that is given within 3 stated ±"""
    SILENT = "wrong and silent"
    """exit 0, and not so"""
    REFUSED = "refused, cause named"
    DOUBTED = "refused, cause not named"
    """exit 1 or 2, and no sentence says what was done to the data"""


@dataclass(frozen=True)
class Judged:
    kind: str
    """both of them where there are two"""
    first: str
    number: int
    verdict: Verdict
    worst: float
    """largest error in stated ±; nan where none is given"""
    says: str
    seconds: float
    """of CPU"""


def judge(kind: Kind, second: Kind | None, number: int, campaign: Campaign, truth: Body) -> Judged:
    """By the exit code, the parameters that are given, and the words."""
    kinds = [kind] if second is None else [kind, second]
    worst, begin = np.nan, process_time()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "campaign"
        try:
            write_campaign(path, campaign)
            result = run_identify(path)
            said = " ".join((result.answer.message, *result.warnings))
            worst, answers = largest_error(result, truth), result.outcome.answers and not result.fallback
        except FidimError as refusal:
            said, answers = str(refusal), False
    if answers:
        verdict = Verdict.RIGHT if worst < WITHIN else Verdict.SILENT
    else:
        named = any(word in said for each in kinds for word in each.words)
        verdict = Verdict.REFUSED if named else Verdict.DOUBTED
    name = " + ".join(each.name for each in kinds)
    return Judged(name, kind.name, number, verdict, worst, said, process_time() - begin)


def largest_error(result: IdentificationResult, truth: Body) -> float:
    """In stated ±, of all parameters that are given: about P, and about G."""
    central = truth.inertia_about_com[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    told = [*result.parameters.values(), *result.about_com().values()]
    errors = [abs(p.value - true) / p.sd for p, true in zip(told, [*truth.vector, *central], strict=True) if p.seen]
    return float(max(errors, default=np.nan))
