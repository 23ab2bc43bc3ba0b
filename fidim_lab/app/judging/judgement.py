"""Whether what a session has recorded is explained, and which window would tell most: a process of its own.

    python -m fidim_lab.app.judging.judgement FOLDER [NUMBER [REACH]]     writes explanation.json, judgement.json

`judge` is the same in process. A service starts it beside a held robot (`service.judging`). Where effects cannot be
told apart the next window is the one that separates them (`to_separate`), elsewhere the one after which the body is
known best (`to_know`); where no window would do, it says what a person could.
"""

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.app.formats.explanation_file import as_file, claims_of
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.records import Campaign
from fidim_lab.errors import FidimError
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict, write_explanation
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.next_experiment.next_windows import Reach, to_know, to_separate
from fidim_lab.mismatch.next_experiment.proposal import Claim, Proposal
from procedures.protocols.compare import FURTHER
from procedures.steps.compare import Clarity

EXPLANATION, JUDGEMENT = "explanation.json", "judgement.json"
HOPEFUL = 0.5
"""odds of telling effects apart with the windows that are proposed, from which they are worth recording"""
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
    """lengths, displacement of x and y, marker at rest; m"""


def judge(folder: Path, number: int = 1, reach: Reach | None = None) -> Judgement:
    """Explain the campaign in the folder, keep the explanation there, and judge it.

    number: of the look, from 1: each looks at other windows that could be recorded. reach: shortest and longest length
    (m) that each winch allows. Raises FileError for a damaged campaign, RefusedError where nothing can be fitted.
    """
    campaign = read_campaign(folder)
    explanation = explain(campaign)
    write_explanation(folder / EXPLANATION, explanation)
    unclear = why_unclear(explanation)
    if not unclear:
        return Judgement(Clarity.CLEAR, f"{explanation.verdict.value}: {explanation.message}")
    # where something remains, too: the wrong one of two that are alike may be what leaves it
    claims = claims_of(as_file(explanation))
    next_look = _Next(campaign, explanation, number, reach)
    try:
        found = next_look.to_separate(claims) if claims else next_look.to_know()
    except FidimError as error:
        return Judgement(Clarity.STUCK, f"{unclear} No further window could be proposed: {error.message}")
    by_hand = explanation.next_experiment if found.clarity is Clarity.STUCK else None
    return Judgement(found.clarity, " ".join(filter(None, (unclear, found.says, by_hand))), found.window)


def why_unclear(explanation: Explanation) -> str:
    """What is open, as sentences; empty where the verdict stands (a sensor's fault needs repair, not windows)."""
    verdict, said = explanation.verdict, list[str]()
    if verdict in (Verdict.PARTLY_EXPLAINED, Verdict.UNKNOWN_PHYSICS):
        said.append(explanation.message)
    alike = [f"{c.id} from {' or '.join(c.equivalent_to)}" for c in explanation.effects if c.equivalent_to]
    if verdict in (Verdict.EXPLAINED, Verdict.PARTLY_EXPLAINED) and alike:
        said.append(f"The data cannot separate {'; '.join(alike)}.")
    return " ".join(said)


@dataclass(frozen=True, eq=False)
class _Next:
    """The search for the next window. Its answers begin where `why_unclear` ends."""

    campaign: Campaign
    explanation: Explanation
    number: int
    reach: Reach | None

    @property
    def body(self) -> Float[np.ndarray, "9"]:
        """As identified."""
        return np.array([p.value for p in self.explanation.parameters.values()])

    def to_separate(self, claims: Sequence[Claim]) -> Judgement:
        """The window that tells most between a claim and its rivals; the claim with the best odds comes first."""
        proposals = self._proposals(claims, more_markers=False)
        best = max(proposals, key=lambda p: p.after[-1].probability if p.after else 0.0)
        if best.after and best.after[-1].probability >= HOPEFUL:
            first = best.windows[0]
            return self._judgement(_hopeful(best), np.concatenate([first.lengths, first.displacement]))
        better = self._proposals([best.claim], more_markers=True)[0]
        return Judgement(Clarity.STUCK, better.says)

    def to_know(self) -> Judgement:
        """The window after which the body is known best."""
        found = to_know(self.campaign, self.body, seed=self.number, reach=self.reach)
        shares = found.sd_after / found.sd_before
        if float(shares.min()) > WORTH:
            return Judgement(Clarity.STUCK, "No window within the limits would improve the accuracy of the body.")
        name = list(self.explanation.parameters)[int(np.argmin(shares))]
        says = f"The next window is chosen for {name}: its sd falls to {100 * float(shares.min()):.0f} %."
        return self._judgement(says, found.z)

    def _proposals(self, claims: Sequence[Claim], *, more_markers: bool) -> tuple[Proposal, ...]:
        noise = float(np.sqrt(max(1.0, self.explanation.chi2_per_dof.after or 1.0)))
        return to_separate(
            self.campaign,
            claims,
            self.body,
            noise=noise,
            seed=self.number,
            more=max(1, 1 + len(FURTHER) - self.number),
            more_markers=more_markers,
            reach=self.reach,
        )

    def _judgement(self, says: str, z: Float[np.ndarray, " z"]) -> Judgement:
        """A window with where the marker will rest by the nominal body, as plans have it."""
        robot = self.campaign.robot
        task = DesignTask(robot, equilibria=1)
        position, aside = place(task.mechanism(), task, z).marker_at(robot.marker)
        window = (*map(float, z[: robot.n]), *map(float, aside), *map(float, position))
        return Judgement(Clarity.UNCLEAR, says, window)


def _hopeful(found: Proposal) -> str:
    """What the windows promise that will be recorded."""
    count, last = len(found.windows), found.after[-1]
    windows = "The next window separates" if count == 1 else f"{count} more windows, this one and later ones, separate"
    said = f"{windows} {found.claim.id} from {last.rival} in {100 * last.probability:.0f} % of cases."
    return f"{said} Free motion can hardly separate it from {' or '.join(found.beyond)}." if found.beyond else said


def main(arguments: list[str]) -> int:
    """The process: judgement.json is there when it ends with 0; else standard error says why not."""
    os.nice(POLITE)
    folder, number, reach = Path(arguments[0]), *_options(arguments[1:])
    try:
        found = judge(folder, number, reach)
    except FidimError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    write_json(folder / JUDGEMENT, found)
    return 0


def _options(arguments: list[str]) -> tuple[int, Reach | None]:
    number = int(arguments[0]) if arguments else 1
    return number, json.loads(arguments[1]) if len(arguments) > 1 else None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
