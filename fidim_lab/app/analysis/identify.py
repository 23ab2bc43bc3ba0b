"""`fidim identify`: a campaign folder in; `identified.summary` shows what comes out to a person.

With total least squares it also shows what scaling and weighting are worth: the paper's form, its columns scaled, and
ours. Total least squares is not invariant to the scaling of its columns (spec/model.md §3), and the paper scales none:
the spread between the three columns of that table is uncertainty that no standard deviation contains.
"""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Group, RenderableType
from rich.table import Table

from fidim_lab.app.analysis.identified import next_command, summary
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.report.sections.numerals import fixed, short
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.app.workflows.identify import PosedCampaign, identify_posed, read_posed, run_identify
from fidim_lab.errors import SetupError
from fidim_lab.identification.equations.estimators import Method, method_named
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.identification.results.result import IdentificationResult, InertialParameter
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.units import millimetres


def identify_command(
    campaign_folder: Path,
    method: str | None,
    json_file: Path | None,
    report: Path | None,
    *,
    paper: bool = False,
    poses: PoseSource = PoseSource.MOCAP,
) -> int:
    """What `fidim identify` does: identify, print, write. Returns the exit code; raises as `run_identify`.

    `paper`: the paper's form is the result, and a table shows it beside its columns scaled and our form. `poses`: where
    they come from; other sources than the motion capture are shown beside it where it saw the whole pose.
    """
    if poses is not PoseSource.MOCAP:
        return _from_own_sensors(campaign_folder, poses, method, json_file, report, paper=paper)
    with Working("identifying by the paper" if paper else "identifying", windows_of(campaign_folder)):
        result = run_identify(campaign_folder, method, paper=paper)
        ours = run_identify(campaign_folder, Method.TLS, predict=False) if paper else None
    if json_file is not None:
        write_result(json_file, result)
    console.out.print(summary(result))
    if ours is not None:
        console.out.print(scaling_table(Forms(paper=result, ours=ours)))
    if report is not None:
        console.out.print(f"report      {write_report(campaign_folder, result, report)}", markup=False)
    console.out.print(f"next        {next_command(campaign_folder, result, json_file)}", markup=False)
    return 0 if result.outcome.answers and not result.fallback else 1


def _from_own_sensors(
    folder: Path, poses: PoseSource, method: str | None, json_file: Path | None, report: Path | None, *, paper: bool
) -> int:
    if paper or report is not None:
        raise SetupError(f"--pose-from {poses.value} cannot be used with --paper or --report, which are about markers.")
    if method is not None:
        method_named(method)
    with Working("identifying from own sensors", windows_of(folder)):
        posed = read_posed(folder, poses)
        result = identify_posed(posed, method)
        beside = run_identify(folder, result.method.value, predict=False) if posed.differences else None
    if json_file is not None:
        write_result(json_file, result)
    console.out.print(summary(result))
    if beside is not None:
        console.out.print(comparison(posed, result, beside))
    console.out.print(f"next        {next_command(folder, result, json_file)}", markup=False)
    return 0 if result.outcome.answers and not result.fallback else 1


def comparison(posed: PosedCampaign, here: IdentificationResult, mocap: IdentificationResult) -> RenderableType:
    """Pose differences by window, and parameters from both sources side by side."""
    poses = [
        (one.window, str(one.samples), f"{one.position * 1e3:.2f}", f"{one.rotation * 1e3:.1f}")
        for one in posed.differences
    ]
    both = [
        (name, f"{millimetres(parameter.nominal):.2f}", _shown(parameter), _shown(mocap.parameters[name]))
        for name, parameter in here.parameters.items()
    ]
    of_poses = "Poses against those of the motion capture (rms of one coordinate)"
    of_both = f"Parameters by {here.method.value} (± spread between windows; s in mm, I in 1e-3 m²)"
    return Group(
        console.table(of_poses, ("window", "samples", "position, mm", "rotation, mrad"), poses),
        console.table(of_both, ("parameter", "CAD", "this source", "motion capture"), both),
    )


def _shown(parameter: InertialParameter) -> str:
    spread = parameter.sd if parameter.spread is None else parameter.spread
    return f"{millimetres(parameter.value):.2f} ± {millimetres(spread):.2f}"


@dataclass(frozen=True, eq=False)
class Forms:
    """The same campaign by the paper's form, and by ours."""

    paper: IdentificationResult
    ours: IdentificationResult


def scaling_table(forms: Forms) -> Table:
    """Nine parameters in three forms, each with its nominal sd where it has one."""
    effect = forms.paper.scaling_effect
    rows: list[tuple[str, ...]] = []
    for k, (name, paper) in enumerate(forms.paper.parameters.items()):
        ours = forms.ours.parameters[name]
        scaled = None if effect is None else paper.value + float(effect[k])
        moved = "–" if effect is None or paper.sd == 0 else f"{effect[k] / paper.sd:+.1f}"
        values = (paper.nominal, paper.value, paper.sd, scaled, ours.value, ours.sd)
        shown = [fixed(None if value is None else millimetres(value), 3) for value in values]
        rows.append((name, *shown[:4], moved, *shown[4:]))
    rows += [("σ_W", "", short(forms.paper.sigma_W), "", "", "", short(forms.ours.sigma_W), "")]
    rows += [("C", "", short(forms.paper.C), "", "", "", short(forms.ours.C), "")]
    names = ("parameter", "CAD", "the paper's", "sd", "columns of norm 1", "moves by, sd", "ours", "sd")
    title = "Total least squares in three forms (s in mm, I in 1e-3 m² per unit mass, about P)"
    return console.table(title, names, rows)
