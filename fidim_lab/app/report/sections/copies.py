"""The identified values as texts to copy: TOML, CSV, a URDF inertial, Python."""

import csv
import io
from contextlib import suppress
from dataclasses import dataclass

from fidim_lab.app.formats.body_text import python_snippet, toml, urdf
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.identification.results.result_file import ResultTable


@dataclass(frozen=True)
class Copy:
    """One text."""

    name: str
    text: str


def copies(result: IdentificationResult, mass: float) -> tuple[Copy, ...]:
    """The result in each form. mass (kg): the robot file's, for URDF, which is left out for an impossible body."""
    table = ResultTable.model_validate(result.to_json())
    texts = [
        Copy("TOML: value, sd and CAD of each parameter, SI, about P, per unit mass", toml(table, None)),
        Copy("CSV: the same, one row per parameter", _csv(result)),
        Copy("Python", python_snippet(table, None)),
    ]
    with suppress(InfeasibleError):
        texts.append(Copy(f"URDF inertial, about G, with the robot file's mass of {mass:g} kg", urdf(table, mass)))
    return tuple(texts)


def _csv(result: IdentificationResult) -> str:
    buffer = io.StringIO()
    out = csv.writer(buffer, lineterminator="\n")
    out.writerow(["parameter", "value", "sd", "spread", "nominal", "unit"])
    for name, parameter in result.parameters.items():
        spread = "" if parameter.spread is None else repr(float(parameter.spread))
        values = [repr(float(x)) for x in (parameter.value, parameter.sd)]
        unit = "m" if name.startswith("s_") else "m^2"
        out.writerow([name, *values, spread, repr(float(parameter.nominal)), unit])
    return buffer.getvalue()
