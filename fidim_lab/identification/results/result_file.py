"""Result files, "fidim-result/1" (spec/formats.md): written by `identify --json`, read by `validate --parameters`."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.errors import FileError
from fidim_lab.identification.cleaning.removed import Removed
from fidim_lab.identification.results.result import AnchorByEncoder, Estimated, IdentificationResult, Moved


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


BodyNumber = Annotated[float, Field(ge=-1e6, le=1e6)]
"""m, m²: no platform is 1 km large; with larger ones the arithmetic overflows"""


class ParameterTable(_Strict):
    """`parameters.NAME`."""

    value: BodyNumber | None
    """None where the recordings do not show it"""
    sd: float | None = None
    sd_bootstrap: float | None = None
    nominal: BodyNumber | None = None
    seen: bool = True

    @property
    def best(self) -> float:
        """The value, or what the robot file (CAD) says where the recordings do not show it."""
        return self.value if self.value is not None else self.nominal or 0.0


class ResultWindow(_Strict):
    """One of `windows`."""

    id: str
    role: Role
    chi2_per_dof: float | None
    rms_mm: float | None
    sigma_perp: float | None
    used: bool


class PayloadTable(_Strict):
    """`mass.payload`: what was added to the platform, and the campaign recorded with it."""

    campaign: str
    mass: float
    mass_sd: float
    at: tuple[float, float, float]
    at_sd: float


class TareParameter(_Strict):
    """One parameter of a difference; null where one of the campaigns does not show it."""

    value: float | None
    sd: float | None
    seen: bool


class TareTable(_Strict):
    """`tare`: there only after `identify --tare`."""

    campaign: str
    mass: Estimated
    parameters: dict[str, TareParameter]


class MassTable(_Strict):
    """`mass`: there only after `identify --payload`; kg."""

    value: float
    sd: float
    nominal: float
    components: dict[Literal["x", "y", "z"], Estimated | None]
    with_inertia: Estimated | None
    chi2: float
    dof: int
    p: float
    payload: PayloadTable


class GeometryTable(_Strict):
    """`geometry`: what the recordings say of the robot file's geometry."""

    chi2_gain: float
    moved: tuple[Moved, ...]
    encoders: tuple[AnchorByEncoder, ...] = ()

    @property
    def pieces(self) -> dict[tuple[str, int | None], tuple[float, ...]]:
        """By key and cable, as `survey.as_found` asks for them."""
        return {(one.what, one.cable): one.by for one in self.moved}


class CrossWindowTable(_Strict):
    """One window of `joint.cross`."""

    id: str
    rms_mm: float | None
    chi2_per_dof: float | None
    seconds: float


class CrossTable(_Strict):
    """One of `joint.cross`: a campaign predicted by a fit of others, or its held-out windows by the fit of all."""

    fitted: tuple[str, ...]
    predicted: str
    rms_mm: float | None
    pose_mm: float | None
    median_mm: float | None
    windows: tuple[CrossWindowTable, ...]


class JointTable(_Strict):
    """`joint`: there only after `identify` of several campaigns."""

    campaigns: tuple[str, ...]
    shared: tuple[str, ...]
    dissipation: dict[str, Estimated]
    cross: tuple[CrossTable, ...]


class ResultTable(_Strict):
    """The whole file."""

    format: Literal["fidim-result/1"]
    campaign: str
    method: Literal["mle", "tls", "ls", "iv"]
    outcome: str
    message: str
    parameters: dict[str, ParameterTable]
    non_essential: tuple[str, ...]
    sigma_W: float | None
    C: float | None
    windows: tuple[ResultWindow, ...]
    seconds: Annotated[float, Field(ge=0)]
    geometry: GeometryTable | None = None
    removed: tuple[Removed, ...] = ()
    mass: MassTable | None = None
    joint: JointTable | None = None
    tare: TareTable | None = None

    @property
    def body(self) -> Body:
        """The identified body, by CAD in what was not seen."""
        return Body.from_vector(np.array([self.parameters[name].best for name in PARAMETER_NAMES]))


def write_result(
    path: Path,
    result: IdentificationResult,
    *,
    mass: dict[str, object] | None = None,
    joint: dict[str, object] | None = None,
    tare: dict[str, object] | None = None,
) -> None:
    """Write a result whole or not at all.

    mass: what a payload showed; joint: what several campaigns did; tare: what was added. None is no key of the file.
    """
    further = {"mass": mass, "joint": joint, "tare": tare}
    table = {**result.to_json(), **{key: value for key, value in further.items() if value is not None}}
    write_json(path, table)


def read_result(path: Path) -> ResultTable:
    """Read a result file. Raises FileError with the key that is wrong."""
    try:
        table = read_json_as(path, ResultTable.model_validate)
    except FileError as error:
        error.hint = error.hint or "A result file is what fidim identify --json writes."
        raise
    missing = [name for name in PARAMETER_NAMES if name not in table.parameters]
    unknown = [name for name in table.parameters if name not in PARAMETER_NAMES]
    if missing or unknown:
        which = f"{', '.join(missing)} missing" if missing else f"{', '.join(unknown)} unknown"
        raise FileError(path, "parameters", f"{which}; all of {', '.join(PARAMETER_NAMES)} are expected")
    return table
