"""One side of a comparison: what a run, campaign or result file says. `read_session` reads any of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app.formats.explanation_file import EXPLANATION, ExplanationTable, read_explanation
from fidim_lab.app.report.contents.folder import Contents, read_folder
from fidim_lab.app.report.sections.tables import MARKS
from fidim_lab.app.report.sections.windows import measured_tension
from fidim_lab.data.records import Campaign, Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.results.result_file import ResultTable, read_result

RESULT = "result.json"


@dataclass(frozen=True, eq=False)
class ComparedSession:
    """What is compared. Without a folder only the result is known."""

    name: str
    place: Path
    result: ResultTable | None
    origin: str
    """of the result: where it was read, how it was made, or why there is none"""
    contents: Contents | None = None
    explanation: ExplanationTable | None = None

    @property
    def says(self) -> str:
        """Which session this is."""
        return f"{self.name} ({self.place}); {self.origin}"

    @property
    def tension(self) -> tuple[float, float] | None:
        """Lowest and highest tension of all windows but for single samples, N; None where nothing measured it."""
        if self.contents is None:
            return None
        return measured_range(self.contents.campaign)

    @property
    def held_out(self) -> float | None:
        """Median χ²/dof of held-out windows; None without any."""
        rows = () if self.result is None else self.result.windows
        known = [w.chi2_per_dof for w in rows if w.role is Role.VALIDATE and w.chi2_per_dof is not None]
        return float(np.median(known)) if known else None

    @property
    def run(self) -> str:
        """How the run ended; empty where nothing was run."""
        story = None if self.contents is None else self.contents.story
        if story is None:
            return ""
        accepted = sum(window.outcome.usable for window in story.windows)
        return f"{MARKS[story.outcome]}; {accepted} of {len(story.windows)} windows accepted"


def measured_range(campaign: Campaign) -> tuple[float, float] | None:
    """Between which tensions 98 % of the samples of motor currents or load cells lie, N: single ones are noise."""
    found = [measured_tension(campaign.robot, window) for window in campaign.windows]
    values = [one[1][np.isfinite(one[1])] for one in found if one is not None]
    together = np.concatenate(values) if values else np.zeros(0)
    if not len(together):
        return None
    low, high = np.percentile(together, (1.0, 99.0))
    return float(low), float(high)


def read_session(place: Path) -> ComparedSession:
    """Read a folder or a "fidim-result/1" file.

    A folder's result.json is taken where it is about the folder's windows; otherwise the body is identified here.
    Raises FileError for what is missing or wrong.
    """
    if place.is_file():
        result = read_result(place)
        return ComparedSession(result.campaign, place, result, "a result file only")
    contents = read_folder(place)
    result, origin = _result(place, contents)
    path = place / EXPLANATION
    explanation = read_explanation(path) if path.exists() else None
    return ComparedSession(contents.campaign.name, place, result, origin, contents, explanation)


def _result(place: Path, contents: Contents) -> tuple[ResultTable | None, str]:
    from fidim_lab.app.workflows.identify import run_identify

    path = place / RESULT
    if path.exists():
        kept = read_result(path)
        if {w.id for w in kept.windows} == {w.id for w in contents.campaign.windows}:
            return kept, f"parameters from its {RESULT}"
    if not contents.campaign.windows:
        return None, "no window was accepted"
    try:
        return ResultTable.model_validate(run_identify(place).to_json()), "identified now"
    except RefusedError as refusal:
        return None, f"nothing identified: {refusal}"
