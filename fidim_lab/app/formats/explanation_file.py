"""explanation.json, "fidim-explanation/1" (spec/formats.md), as a report reads it: `read_explanation`, `as_file`.

What `fidim explain` has just found goes the same way as what a file holds: `as_file`.
"""

from pathlib import Path
from typing import Literal

import numpy as np

from fidim_lab.app.formats.explanation_parts import EffectTable, ExplanationPart, WhereTable
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.identification.results.result_file import BodyNumber, GeometryTable
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.parts import HeldOutFigures, LawTerm, Ranked
from fidim_lab.mismatch.next_experiment.proposal import Claim
from fidim_lab.mismatch.residuals.channels import Channel
from fidim_lab.mismatch.unknown_force.field import Field

EXPLANATION = "explanation.json"
Triple = tuple[float, float, float]


class BodyParameterTable(ExplanationPart):
    """One of the nine."""

    value: BodyNumber
    sd: float
    nominal: BodyNumber


class FamilyTable(ExplanationPart):
    """One kind of unknown wrench that was compared."""

    label: str
    explained: float | None
    left_out: float | None
    log_evidence: float | None


class FieldTable(ExplanationPart):
    """Samples of the wrench along the motion, SI, world frame."""

    windows: tuple[str, ...]
    t: list[float]
    places: list[Triple]
    centres: list[Triple]
    velocities: list[Triple]
    spins: list[Triple]
    forces: list[Triple]
    torques: list[Triple]

    @property
    def field(self) -> Field:
        """For pictures."""
        names = ("t", "places", "centres", "velocities", "spins", "forces", "torques")
        return Field(self.windows, *(np.array(getattr(self, name), dtype=float) for name in names))


class UnknownTable(ExplanationPart):
    """The model of what has no name."""

    words: tuple[str, ...]
    tried: tuple[FamilyTable, ...] = ()
    field: FieldTable | None = None


class ExplanationTable(ExplanationPart):
    """The whole file."""

    format: Literal["fidim-explanation/1"]
    campaign: str
    verdict: Verdict
    effects: tuple[EffectTable, ...]
    where: tuple[WhereTable, ...]
    held_out: HeldOutFigures
    ranking: tuple[Ranked, ...]
    parameters: dict[str, BodyParameterTable]
    parameters_before: dict[str, BodyParameterTable]
    next_experiment: str | None
    message: str
    seconds: float | None = None
    untested: tuple[str, ...] = ()
    unknown: UnknownTable | None = None
    law: tuple[LawTerm, ...] = ()
    geometry: GeometryTable | None = None
    test: HeldOutFigures | None = None
    left_out: HeldOutFigures | None = None
    channels: tuple[Channel, ...] = ()


def as_file(explanation: Explanation) -> ExplanationTable:
    """What was just found, as its file will say it."""
    return ExplanationTable.model_validate(explanation.table)


def read_explanation(path: Path) -> ExplanationTable:
    """Read the file. Raises FileError with the key that is wrong."""
    return read_json_as(path, ExplanationTable.model_validate)


def claims_of(explained: ExplanationTable) -> list[Claim]:
    """The effects that something else may stand for."""
    return [
        Claim(e.id, e.cable, tuple(float(p.value or 0.0) for p in e.parameters.values()), e.alike)
        for e in explained.effects
        if e.alike and e.parameters
    ]
