"""`fidim identify A --payload B --mass KG --at X,Y,Z`: the platform's mass from a second campaign (Eq. 23–24)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from fidim_lab.app.analysis.identified import summary
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.app.workflows.identify import UNUSABLE, run_identify
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.payload_mass import (
    KnownBody,
    MassResult,
    Payload,
    find_mass,
    refuse_other_geometry,
)
from fidim_lab.identification.results.result import Estimated, IdentificationResult
from fidim_lab.identification.results.result_file import write_result


@dataclass(frozen=True, eq=False)
class PayloadOption:
    """The second campaign and what was added to the platform for it."""

    campaign: Path
    payload: Payload


def parse_payload(
    campaign: Path | None, mass: float | None, at: str | None, mass_sd: float, at_sd: float
) -> PayloadOption | None:
    """The options of the payload together; None without any. Raises SetupError where they do not go together."""
    if campaign is None:
        given = [name for name, value in (("--mass", mass), ("--at", at)) if value is not None]
        if given:
            raise SetupError(f"{' and '.join(given)}: only with --payload, the campaign recorded with the payload.")
        return None
    if mass is None or at is None:
        raise SetupError("--payload needs --mass KG and --at X,Y,Z: what was added, and where (body frame, m).")
    if not (np.isfinite(mass) and mass > 0):
        raise SetupError(f"--mass {mass:g}: the payload's mass is a positive number of kilograms.")
    return PayloadOption(campaign, Payload(mass, _place(at), mass_sd, at_sd))


def _place(text: str) -> np.ndarray:
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise SetupError(f"--at {text}: three numbers X,Y,Z in metres are expected, for example 0,0.1,0.05.")
    if np.abs(values).max() > 10:
        raise SetupError(f"--at {text}: metres are expected; {np.abs(values).max():g} m is too far from any platform.")
    return values


def payload_command(
    campaign: Path,
    option: PayloadOption,
    method: str | None,
    json_file: Path | None,
    report: Path | None,
    *,
    paper: bool = False,
) -> int:
    """Identify both campaigns, find the mass, print and write; returns the exit code.

    Raises as `run_identify`; SetupError for two different robots, RefusedError where the mass does not show or one of
    the campaigns gives no body that may be used.
    """
    robot = read_campaign(campaign).robot
    refuse_other_geometry(robot, read_campaign(option.campaign).robot)
    with Working("identifying without the payload", windows_of(campaign)):
        empty = run_identify(campaign, method, paper=paper)
    with Working("identifying with the payload", windows_of(option.campaign)):
        loaded = run_identify(option.campaign, empty.method.value, paper=paper, predict=False)
    console.out.print(summary(empty))
    console.out.print(f"With the payload: {loaded.answer.message}", markup=False)
    for warning in loaded.warnings:
        console.out.print(f"warning: with the payload: {warning}", style="yellow", markup=False)
    if unusable := [r for r in (empty, loaded) if r.outcome in UNUSABLE]:
        reasons = "; ".join(f"{r.campaign}: {r.outcome.value}" for r in unusable)
        raise RefusedError(f"No mass can be found: {reasons}")
    found = find_mass(KnownBody.of(empty), KnownBody.of(loaded), option.payload)
    if json_file is not None:
        write_result(json_file, empty, mass=mass_json(found, option.payload, robot.mass, loaded))
    console.out.print(mass_table(found, robot.mass))
    for sentence in mass_sentences(found, option.payload):
        console.out.print(sentence, markup=False)
    if report is not None:
        console.out.print(f"report      {write_report(campaign, empty, report)}", markup=False)
    return 0


def mass_table(found: MassResult, nominal: float) -> Table:
    """The mass from each component, from all three, and with the inertia."""
    rows = [
        *(
            (f"{axis} of the centre of mass", *_figures(estimate), f"{1e3 * shift:.3f}")
            for (axis, estimate), shift in zip(found.components.items(), found.shift, strict=True)
        ),
        ("all three, weighted", *_figures(found.mass), f"{1e3 * np.linalg.norm(found.shift):.3f}"),
        ("the same and the inertia of a point", *_figures(found.with_inertia), ""),
        ("robot file", f"{nominal:.4g}", "", ""),
    ]
    names = ("from", "mass", "sd", "centre of mass moved by, mm")
    return console.table("Mass of the platform (kg) from the payload (Eq. 24)", names, rows)


def mass_sentences(found: MassResult, payload: Payload) -> list[str]:
    """What to believe."""
    figures = f"χ² = {found.chi2:.1f} with {found.dof} degrees of freedom, p = {found.p:.2g}"
    digits = max(0, 1 - int(np.floor(np.log10(found.mass.sd)))) if found.mass.sd > 0 else 6
    said = [f"The platform's mass is {found.mass.value:.{digits}f} ± {found.mass.sd:.{digits}f} kg (1 sd)."]
    if found.consistent:
        said.append(f"The three components agree ({figures}).")
    else:
        said.append(
            f"warning: the three components contradict each other ({figures}); the sd is widened by it. Check --at, "
            "and what the model lacks."
        )
    if found.with_inertia is None:
        said.append("The inertia gives no mass: the payload is not a point, or the model lacks something.")
    else:
        said.append(_about_inertia(found, found.with_inertia, payload))
    return said


def _about_inertia(found: MassResult, other: Estimated, payload: Payload) -> str:
    apart = abs(other.value - found.mass.value) / max(found.mass.sd, 1e-300)
    agrees = "agrees with it" if apart < 3 else f"differs from it by {apart:.1f} sd: the payload is not a point"
    gain = (
        f"would reduce the sd to {other.sd:.2g} kg if the payload's {payload.mass:g} kg were a point"
        if found.inertia_helps
        else "does not help"
    )
    return f"The inertia {gain}; the mass that it gives together with the centre of mass {agrees}."


def mass_json(found: MassResult, payload: Payload, nominal: float, loaded: IdentificationResult) -> dict[str, object]:
    """The key `mass` that a result file has when there was a payload (docs/payload.md)."""
    return {
        "value": found.mass.value,
        "sd": found.mass.sd,
        "nominal": nominal,
        "components": found.components,
        "with_inertia": found.with_inertia,
        "chi2": found.chi2,
        "dof": found.dof,
        "p": found.p,
        "payload": {
            "campaign": loaded.campaign,
            "mass": payload.mass,
            "mass_sd": payload.mass_sd,
            "at": payload.at,
            "at_sd": payload.at_sd,
        },
    }


def _figures(estimate: Estimated | None) -> tuple[str, str]:
    return ("–", "–") if estimate is None else (f"{estimate.value:.4f}", f"{estimate.sd:.2g}")
