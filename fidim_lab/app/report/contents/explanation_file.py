"""explanation.json, "fidim-explanation/1" (spec/formats.md), as a report reads it: `read_explanation`, `as_file`.

What `fidim explain` has just found goes the same way as what a file holds: `as_file`.
"""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from fidim_lab.app.formats.equivalence import EquivalenceTable
from fidim_lab.data.files.json_file import read_json_as
from fidim_lab.identification.results.result_file import BodyNumber, GeometryTable
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict, finite
from fidim_lab.mismatch.unknown_force.field import Field

Triple = tuple[float, float, float]


class _Part(BaseModel):
    """A later version may say more."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class EffectParameterTable(_Part):
    """One parameter of an effect, SI."""

    value: float | None
    sd: float | None = None
    unit: str = ""


class EffectTable(EquivalenceTable, _Part):
    """One effect that was left out."""

    id: str
    cable: int | None = None
    parameters: dict[str, EffectParameterTable] = {}
    says: str = ""

    @property
    def label(self) -> str:
        """For people."""
        return self.id if self.cable is None else f"{self.id} (cable {self.cable})"


class PlaceTable(_Part):
    """Where it shows."""

    window: str
    t: tuple[float, float]
    says: str


class RankedTable(_Part):
    """One model that was tried."""

    effects: tuple[str, ...]
    held_out_chi2_per_dof: float | None
    plausible: bool
    why: str = ""


class BodyParameterTable(_Part):
    """One of the nine."""

    value: BodyNumber
    sd: float
    nominal: BodyNumber


class BeforeTable(_Part):
    """A figure without and with the effects."""

    before: float | None
    after: float | None


class HeldOutTable(_Part):
    """Of windows that no fit has seen."""

    chi2_per_dof: BeforeTable
    rms_mm: BeforeTable


class FamilyTable(_Part):
    """One kind of wrench without a name that was weighed."""

    label: str
    explained: float | None
    left_out: float | None
    log_evidence: float | None


class FieldTable(_Part):
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


class UnknownTable(_Part):
    """The model of what has no name."""

    words: tuple[str, ...]
    tried: tuple[FamilyTable, ...] = ()
    field: FieldTable | None = None


class ExplanationTable(_Part):
    """The whole file."""

    format: Literal["fidim-explanation/1"]
    campaign: str
    verdict: Verdict
    effects: tuple[EffectTable, ...]
    where: tuple[PlaceTable, ...]
    held_out: HeldOutTable
    ranking: tuple[RankedTable, ...]
    parameters: dict[str, BodyParameterTable]
    parameters_before: dict[str, BodyParameterTable]
    next_experiment: str | None
    message: str
    seconds: float | None = None
    untested: tuple[str, ...] = ()
    unknown: UnknownTable | None = None
    geometry: GeometryTable | None = None


def as_file(explanation: Explanation) -> ExplanationTable:
    """What was just found, as its file will say it."""
    return ExplanationTable.model_validate(finite(explanation.table))


def read_explanation(path: Path) -> ExplanationTable:
    """Read the file. Raises FileError with the key that is wrong."""
    return read_json_as(path, ExplanationTable.model_validate)
