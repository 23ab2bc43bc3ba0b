"""`fidim dry-run`: the whole experiment on the embedded simulators, from the plan to the report.

The steps, drivers, protocols and identification are those of a real session; only `compose` knows that the world is not
real. A run folder is a campaign with journal, raw CAN log, truth and report beside it.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from rich.table import Table

from fidim_lab.app import compose, console
from fidim_lab.app.identify import run_identify, summary
from fidim_lab.app.model_check import Checked, ModelCheck
from fidim_lab.app.report.write import write_report
from fidim_lab.app.run_display import display
from fidim_lab.app.run_records import RunRecords
from fidim_lab.app.working import Working, windows_of
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Plan, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import HardwareError
from fidim_lab.identification.random_plan import Taste, random_plan
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.identification.results.result_file import write_result
from procedures.catalogue import experiment as procedure_of
from procedures.events import Event, RunFinished
from procedures.report import RunReport
from procedures.robot_guards import LogGuard
from procedures.run import Experiment, run_procedure
from procedures.run_folder import require_new
from procedures.settings import MotionSettings, Settings

SIMULATED_DAY = "2000-01-01T00:00:00Z"
"""wall time of a simulated journal: the same seed gives the same bytes"""
PLAN = "plan.toml"
TRUTH = "truth.json"
UNTOUCHED = Taste(taut=1.0, tight=1.0)
"""places where the swing that a hand would give keeps all tension limits: winches keep them whatever the body is"""
RESULT = "result.json"


@dataclass(frozen=True)
class DryRunOptions:
    """As on the command line."""

    out: Path | None
    seed: int
    robot: Path | None
    equilibria: int
    validation: int
    hide: tuple[str, ...]
    real_time: bool
    json_file: Path | None
    ui: bool = False
    excite: bool = False
    """the winches excite, instead of a hand"""
    light: bool = False
    """the UI dark on light"""


def run_dry_run(options: DryRunOptions) -> int:
    """Rehearse, identify, report; returns the exit code. Raises FidimError before anything has moved."""
    robot = read_robot(options.robot or PAPERS_ROBOT)
    folder = options.out or _free_folder(options.seed)
    if options.ui:
        from fidim_lab.app.ui_dry_run import run_ui_dry_run

        return run_ui_dry_run(options, folder)
    require_new(folder)
    world = compose.simulated_world(robot, options.seed, options.hide)
    with Working("planning: equilibria where the robot can rest and swing", options.equilibria + options.validation):
        taste = UNTOUCHED if options.excite else None
        plan = random_plan(robot, "dry run", options.equilibria, options.validation, options.seed, taste)
        motion = MotionSettings(length_limits=compose.length_limits(plan))
        procedure = "excite" if options.excite else "identify"
        experiment = procedure_of(procedure, plan, robot, Settings(motion=motion))
    truth = compose.world_truth(world, plan.name, options.seed)
    rehearsal = _Rehearsal(robot, plan, experiment, folder, options, truth)
    report = rehearsal.run(world)
    console.out.print(_says(report), markup=False)
    if not report.accepted:
        console.out.print(f"Nothing to identify. The run folder is {folder}", markup=False)
        return report.exit_code
    if report.exit_code == 0:
        try:
            _identify(folder, truth, options)
        except OSError as error:
            what = f"{error.filename or folder}: cannot be written: {error.strerror or error}."
            hint = f"All windows are recorded. Free some space, then: fidim identify {folder}"
            raise HardwareError(what, hint=hint) from error
    console.out.print(f"run folder  {folder}", markup=False)
    return report.exit_code


def _says(report: RunReport) -> str:
    return f"run {report.outcome}: {report.reason or 'all windows have their verdict.'} {report.held_says}"


def _identify(folder: Path, truth: dict[str, object], options: DryRunOptions) -> None:
    with Working("identifying", windows_of(folder)):
        result = run_identify(folder)
    write_result(folder / RESULT, result)
    if options.json_file is not None:
        write_result(options.json_file, result)
    console.out.print(summary(result))
    console.out.print(truth_table(result, truth))
    report = write_report(folder, result)
    console.out.print(f"report      {report}", markup=False)


def truth_table(result: IdentificationResult, truth: dict[str, object]) -> Table:
    """Identified parameters beside the hidden true ones, the error in units of the stated uncertainty."""
    true = [*_numbers(truth["s"]), *_numbers(truth["I"])]
    table = Table(title="Identified beside the hidden truth (s in mm, I in 1e-3 m² per unit mass, about P)")
    for column in ("parameter", "identified", "±", "true", "error", "error, %", "error / ±"):
        table.add_column(column, justify="left" if column == "parameter" else "right")
    for (name, parameter), value in zip(result.parameters.items(), true, strict=True):
        error = parameter.value - value
        stated = max(parameter.sd, parameter.spread or 0.0)
        table.add_row(
            name,
            f"{parameter.value * 1e3:.4f}",
            f"{stated * 1e3:.4f}",
            f"{value * 1e3:.4f}",
            f"{error * 1e3:+.4f}",
            f"{100 * error / value:+.3f}" if value else "",
            f"{error / stated:+.1f}" if stated else "",
        )
    return table


def _numbers(values: object) -> list[float]:
    return [float(v) for v in values] if isinstance(values, list) else []


class _Rehearsal:
    """One run of the experiment in the simulated laboratory, with its displays and logs."""

    def __init__(
        self,
        robot: Robot,
        plan: Plan,
        experiment: Experiment,
        folder: Path,
        options: DryRunOptions,
        truth: dict[str, object],
    ) -> None:
        self._robot, self._plan, self._experiment, self._folder = robot, plan, experiment, folder
        self._options = options
        self._truth = truth
        self._records: RunRecords | None = None
        self._ended: RunReport | None = None

    def run(self, world: compose.World) -> RunReport:
        """Carry it out. Ctrl-C ends in a report too: the robot is held, and what was recorded is there."""
        title = "dry run" + (" in real time" if self._options.real_time else "")
        with display(console.err, title) as shown:
            try:
                report = compose.run_loop(self._carry_out(world, shown), real_time=self._options.real_time)
            except KeyboardInterrupt:
                if self._ended is None:
                    raise
                report = replace(self._ended, interrupted=True)
            except Exception:  # a bug beside the run (the drives' control loop): how the run ended is said all the same
                if self._ended is not None:
                    console.err.print(_says(self._ended), markup=False)
                raise
            finally:
                if self._records is not None:
                    self._records.close()
        if self._records is not None and (error := self._records.error()) is not None:
            console.warn([error])
        return report

    async def _carry_out(self, world: compose.World, shown: object) -> RunReport:
        options = self._options
        async with compose.simulated_rig(
            self._robot, self._plan, world, options.seed, real_time=options.real_time
        ) as simulated:
            self._records = records = RunRecords(self._folder, simulated.rig, self._write_papers)
            simulated.transport.tap(records.on_frame)
            planned = len(self._experiment.roles) if options.real_time else 0  # time that jumps waits for nobody
            check = ModelCheck(self._folder, planned, _say_checked)
            try:
                report = await run_procedure(
                    self._experiment,
                    simulated.rig,
                    self._folder,
                    wall_time=_wall_time if options.real_time else lambda: SIMULATED_DAY,
                    listeners=(records.on_event, self._on_event, shown, check),  # type: ignore[arg-type]
                    guards=(LogGuard(records.error),),
                )
                await records.after_run()
                await check.close()
            finally:
                await check.close(patience=0.0)
            return report

    def _on_event(self, event: Event) -> None:
        if isinstance(event, RunFinished):
            self._ended = event.report

    def _write_papers(self) -> None:
        write_plan(self._folder / PLAN, self._plan)
        (self._folder / TRUTH).write_text(json.dumps(self._truth, indent=1) + "\n", encoding="utf-8")


def _say_checked(checked: Checked) -> None:
    console.err.print(f"{checked.window}  {checked.says}", markup=False)


def _wall_time() -> str:
    from datetime import UTC, datetime

    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _free_folder(seed: int) -> Path:
    """runs/dry-run-SEED, or the first numbered one that does not exist."""
    folder = Path("runs") / f"dry-run-{seed}"
    number = 1
    while folder.exists():
        number += 1
        folder = Path("runs") / f"dry-run-{seed}-{number}"
    return folder
