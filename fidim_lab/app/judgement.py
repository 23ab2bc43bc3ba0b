"""Whether what a session has recorded is explained, and which window would tell most: a process of its own.

    python -m fidim_lab.app.judgement FOLDER        writes explanation.json and judgement.json into it

`judge` is the same in process. A service starts it beside a held robot (`service.judging`).
"""

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Body, Campaign, Role
from fidim_lab.errors import FidimError
from fidim_lab.identification.design.next_window import NextWindow, next_window
from fidim_lab.identification.design.pool import draw
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.mle.fit import fit
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.explanation import Explanation, Verdict, write_explanation
from fidim_lab.model.mechanism import Mechanism
from procedures.steps.compare import Clarity

EXPLANATION, JUDGEMENT = "explanation.json", "judgement.json"
CANDIDATES = 24
"""windows from which the next one is chosen"""
WORTH = 0.97
"""a window that leaves every standard deviation above this part of what it was tells nothing"""
POLITE = 10
"""niceness: the control loop of the held robot goes first"""


@dataclass(frozen=True)
class Judgement:
    """What comes of one look."""

    clarity: Clarity
    says: str
    window: tuple[float, ...] = ()
    """lengths, displacement, marker at rest; m"""


def judge(folder: Path, seed: int = 0) -> Judgement:
    """Explain the campaign in the folder, keep the explanation there, and judge it.

    Raises FileError for a damaged campaign, RefusedError where nothing can be fitted.
    """
    campaign = read_campaign(folder)
    explanation = explain(campaign)
    write_explanation(folder / EXPLANATION, explanation)
    unclear = why_unclear(explanation)
    if not unclear:
        return Judgement(Clarity.CLEAR, f"{explanation.verdict.value}: {explanation.message}")
    try:
        found, position = _next(campaign, explanation, seed)
    except FidimError as error:
        return Judgement(Clarity.STUCK, f"{unclear} No further window could be proposed: {error.message}")
    shares = found.sd_after / found.sd_before
    if float(shares.min()) > WORTH:
        return Judgement(Clarity.STUCK, f"{unclear} No window within the limits would tell more.")
    name = list(explanation.parameters)[int(np.argmin(shares))]
    says = f"{unclear} The next window is chosen for {name}: its sd falls to {100 * float(shares.min()):.0f} %."
    return Judgement(Clarity.UNCLEAR, says, (*map(float, found.z), *map(float, position)))


def why_unclear(explanation: Explanation) -> str:
    """What is open, as a sentence; empty where the verdict stands (a sensor's fault needs repair, not windows)."""
    verdict = explanation.verdict
    if verdict in (Verdict.PARTLY_EXPLAINED, Verdict.UNKNOWN_PHYSICS):
        return " ".join(filter(None, (explanation.message, explanation.next_experiment)))
    alike = [f"{c.id} or {' or '.join(c.equivalent_to)}" for c in explanation.effects if c.equivalent_to]
    if verdict is Verdict.EXPLAINED and alike:
        return f"The data cannot tell {'; '.join(alike)} apart. {explanation.next_experiment or ''}".strip()
    return ""


def _next(campaign: Campaign, explanation: Explanation, seed: int) -> tuple[NextWindow, np.ndarray]:
    """The window after which the body is known best, and where the marker then rests. Raises FidimError."""
    task = DesignTask(campaign.robot, equilibria=CANDIDATES, criterion=Criterion.A)
    mechanism: Mechanism = task.mechanism()
    windows = [window for window in campaign.windows if window.role is Role.IDENTIFY]
    body = Body.from_vector(np.array([p.value for p in explanation.parameters.values()]))
    covariance = fit(mechanism, windows, start=body).covariance[:9, :9]
    pool = draw(mechanism, task, CANDIDATES, np.random.default_rng([seed, len(windows)]), lambda _: None)
    found = next_window(mechanism, task, covariance, pool, body.vector)
    rest = place(mechanism, task, found.z).rest
    return found, rest.position + rest.rotation @ campaign.robot.marker


def main(arguments: list[str]) -> int:
    """The process: judgement.json is there when it ends with 0; else standard error says why not."""
    os.nice(POLITE)
    folder = Path(arguments[0])
    try:
        found = judge(folder)
    except FidimError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    (folder / JUDGEMENT).write_text(json.dumps(asdict(found), indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
