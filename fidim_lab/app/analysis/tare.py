"""`fidim identify LOADED --tare EMPTY`: what was put on the platform, as the difference of two identified bodies."""

from pathlib import Path

from rich.table import Table

from fidim_lab.app.analysis.identified import summary
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.app.workflows.identify import UNUSABLE, run_identify
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import RefusedError
from fidim_lab.identification.payload_mass import refuse_other_geometry
from fidim_lab.identification.results.result import Estimated, InertialParameter
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.identification.tare import Difference, difference
from fidim_lab.units import millimetres


def tare_command(
    campaign: Path, empty: Path, mass_sd: float, method: str | None, json_file: Path | None, report: Path | None
) -> int:
    """Identify both campaigns, subtract, print and write; returns the exit code.

    mass_sd: kg, of the mass that each robot file states. Raises as `run_identify`; SetupError for two different robots
    or a platform that is not heavier, RefusedError where one of the campaigns gives no body that may be used.
    """
    robots = [read_campaign(folder).robot for folder in (campaign, empty)]
    refuse_other_geometry(robots[1], robots[0])
    with Working("identifying with the load", windows_of(campaign)):
        loaded = run_identify(campaign, method)
    with Working("identifying the empty platform", windows_of(empty)):
        bare = run_identify(empty, loaded.method.value, predict=False)
    console.out.print(summary(loaded))
    console.out.print(f"Empty: {bare.answer.message}", markup=False)
    for warning in bare.warnings:
        console.out.print(f"warning: empty: {warning}", style="yellow", markup=False)
    if unusable := [one for one in (loaded, bare) if one.outcome in UNUSABLE]:
        reasons = "; ".join(f"{one.campaign}: {one.outcome.value}" for one in unusable)
        raise RefusedError(f"Nothing can be subtracted: {reasons}")
    found = difference(loaded, bare, *(Estimated(robot.mass, mass_sd) for robot in robots))
    if json_file is not None:
        write_result(json_file, loaded, tare=_json(found, bare.campaign))
    console.out.print(_table(found))
    if report is not None:
        console.out.print(f"report      {write_report(campaign, loaded, report)}", markup=False)
    if not found.possible:
        says = f"warning: no body can be that difference, by {found.off:.2g} sd: check both masses."
        console.out.print(says, style="yellow", markup=False)
        return 1
    return 0 if loaded.outcome.answers and bare.outcome.answers else 1


def _table(found: Difference) -> Table:
    mass = found.mass
    title = f"What was added: {mass.value:.4g} kg ± {mass.sd:.2g} kg (s in mm from P, I in 1e-3 kg m²)"
    rows = [(name, *_cells(p, 1.0 if name.startswith("s_") else mass.value)) for name, p in found.parameters.items()]
    rows += [(f"{name} about its G", *_cells(p, mass.value)) for name, p in found.about_com.items()]
    return console.table(title, ("parameter", "CAD", "difference", "±"), rows)


def _cells(parameter: InertialParameter, factor: float) -> tuple[str, str, str]:
    nominal, value, sd = (f"{millimetres(factor * x):.3f}" for x in (parameter.nominal, parameter.value, parameter.sd))
    return (nominal, value, sd) if parameter.seen else (nominal, "not seen", "")


def _json(found: Difference, empty: str) -> dict[str, object]:
    """The key `tare` of a result file (docs/payload.md); per unit of the difference's own mass."""
    return {
        "campaign": empty,
        "mass": {"value": found.mass.value, "sd": found.mass.sd},
        "parameters": {
            name: {"value": p.value if p.seen else None, "sd": p.sd if p.seen else None, "seen": p.seen}
            for name, p in found.parameters.items()
        },
    }
