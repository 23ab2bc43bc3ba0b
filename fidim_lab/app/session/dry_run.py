"""`fidim dry-run`: the whole experiment on the embedded simulators, from the plan to the report.

The steps, drivers, protocols and identification are those of a real session; only `compose` knows that the world is not
real. A run folder is a campaign with journal, raw CAN log, truth and report beside it.
"""

from dataclasses import replace
from pathlib import Path

from fidim_lab.app import compose
from fidim_lab.app.analysis.identified import next_command, summary
from fidim_lab.app.analysis.possible_robot import require_possible
from fidim_lab.app.formats.dry_run_spec import DryRunSpec, write_dry_run
from fidim_lab.app.formats.run_records import RunRecords
from fidim_lab.app.judging.model_check import Looked, ModelCheck
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.report.sections.tables import parameter_rows, truth_table
from fidim_lab.app.session.dry_run_plan import DryRunOptions, planned
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.run_display import display
from fidim_lab.app.terminal.working import Working, windows_of
from fidim_lab.app.workflows.identify import run_identify
from fidim_lab.data.campaign import ROBOT
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.plan_file import read_plan, write_plan
from fidim_lab.data.records import Body, Plan, Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import HardwareError, of_file
from fidim_lab.identification.results.result_file import write_result
from procedures.events import Event, RunFinished
from procedures.guards.robot_guards import LogGuard
from procedures.protocols.catalogue import experiment as procedure_of
from procedures.recording.resumption import Resumption, read_resumption
from procedures.recording.run_folder import free_folder, one_writer, require_new
from procedures.report import RunReport
from procedures.run import Experiment, run_procedure
from procedures.settings import MotionSettings, Settings

SIMULATED_DAY = "2000-01-01T00:00:00Z"
"""wall time of a simulated journal: the same seed gives the same bytes"""
PLAN = "plan.toml"
TRUTH = "truth.json"
RESULT = "result.json"


def run_dry_run(options: DryRunOptions) -> int:
    """Rehearse, identify, report; returns the exit code. Raises FidimError before anything has moved."""
    robot = read_robot(options.robot or PAPERS_ROBOT)
    if options.robot is not None:
        require_possible(options.robot, robot)
    folder = options.out or free_folder(f"dry-run-{options.seed}")
    if options.ui:
        from fidim_lab.app.session.ui_dry_run import run_ui_dry_run

        return run_ui_dry_run(options, folder)
    require_new(folder)
    spec = DryRunSpec(seed=options.seed, hide=options.hide, real_time=options.real_time, excite=options.excite)
    world = compose.simulated_world(robot, options.seed, options.hide)
    with Working("planning equilibria with room to swing", options.equilibria + options.validation):
        plan = planned(options, robot)
        with of_file(options.plan):
            experiment = _experiment(spec, plan, robot)
    with one_writer(folder):  # makes the folder: nothing is left of a plan that was refused
        return _finish(_Rehearsal(robot, plan, experiment, folder, spec, world), options.json_file)


def resume_dry_run(folder: Path, spec: DryRunSpec, json_file: Path | None) -> int:
    """Go on with what is left of a dry run, in the same world; returns its exit code.

    Windows with their verdict stay as they are. Raises FileError for a damaged folder.
    """
    with one_writer(folder):
        robot = read_robot(folder / ROBOT)
        plan = read_plan(folder / PLAN, robot.n)
        resumption = read_resumption(folder, {window.id: window.role for window in plan.windows})
        world = compose.simulated_world(robot, spec.seed, spec.hide)
        if len(resumption.rows) == len(plan.windows):  # the journal may end while it was identified
            _identify(folder, world.body, json_file)
            return 0
        experiment = _experiment(spec, plan, robot, resumption)
        return _finish(_Rehearsal(robot, plan, experiment, folder, spec, world, resumption), json_file)


def _experiment(spec: DryRunSpec, plan: Plan, robot: Robot, resumption: Resumption | None = None) -> Experiment:
    motion = MotionSettings(length_limits=compose.length_limits(plan))
    settings = compose.hand_settings(Settings(motion=motion))
    return procedure_of("excite" if spec.excite else "identify", plan, robot, settings, resumption=resumption)


def _finish(rehearsal: "_Rehearsal", json_file: Path | None) -> int:
    """Carry it out, and identify what was recorded; returns the exit code."""
    report, folder = rehearsal.run(), rehearsal.folder
    console.out.print(_says(report), markup=False)
    if not report.accepted:
        console.out.print(f"There is no window to identify from. Run folder: {folder}", markup=False)
        return report.exit_code
    further = ""
    if report.exit_code == 0:
        try:
            further = _identify(folder, rehearsal.world.body, json_file)
        except OSError as error:
            what = f"{error.filename or folder}: cannot be written: {error.strerror or error}."
            hint = f"All windows are recorded. Free some space, then: fidim identify {folder}"
            raise HardwareError(what, hint=hint) from error
    console.out.print(f"run folder  {folder}", markup=False)
    if further:
        console.out.print(f"next        {further}", markup=False)
    if report.exit_code:
        console.out.print(f"next        fidim identify {folder}     uses the accepted windows", markup=False)
    return report.exit_code


def _says(report: RunReport) -> str:
    return f"run {report.outcome}: {report.reason or 'all windows are judged.'} {report.held_says}"


def _identify(folder: Path, true: Body, json_file: Path | None) -> str:
    """Identify and show it; returns the command that follows where something is missing, else nothing."""
    with Working("identifying", windows_of(folder)):
        result = run_identify(folder)
    write_result(folder / RESULT, result)
    if json_file is not None:
        write_result(json_file, result)
    console.out.print(summary(result))
    console.out.print(truth_table(parameter_rows(result, true)).on_screen)
    report = write_report(folder, result)
    console.out.print(f"report      {report}", markup=False)
    return "" if result.outcome.answers else next_command(folder, result, json_file)


class _Rehearsal:
    """One run of the experiment in the simulated laboratory, with its displays and logs."""

    def __init__(
        self,
        robot: Robot,
        plan: Plan,
        experiment: Experiment,
        folder: Path,
        spec: DryRunSpec,
        world: compose.World,
        resumption: Resumption | None = None,
    ) -> None:
        self.folder, self.world = folder, world
        self._robot, self._plan, self._experiment = robot, plan, experiment
        self._spec, self._resumption = spec, resumption
        self._records: RunRecords | None = None
        self._ended: RunReport | None = None

    def run(self) -> RunReport:
        """Carry it out. Ctrl-C ends in a report too: the robot is held, and what was recorded is there."""
        title = "dry run" + (" in real time" if self._spec.real_time else "")
        with display(console.err, title) as shown:
            try:
                report = compose.run_loop(self._carry_out(shown), real_time=self._spec.real_time)
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

    async def _carry_out(self, shown: object) -> RunReport:
        spec, resumption = self._spec, self._resumption
        place = None if resumption is None else resumption.place
        async with compose.simulated_rig(
            self._robot,
            self._plan,
            self.world,
            spec.seed,
            real_time=spec.real_time,
            start=None if place is None else place.end,
            part=0 if resumption is None else resumption.part,
        ) as simulated:
            self._records = records = RunRecords(self.folder, simulated.rig, self._write_inputs)
            simulated.transport.tap(records.on_frame)
            planned = len(self._experiment.roles) if spec.real_time else 0  # time that jumps waits for nobody
            check = ModelCheck(self.folder, planned, _say_checked)
            try:
                report = await run_procedure(
                    self._experiment,
                    simulated.rig,
                    self.folder,
                    wall_time=_wall_time if spec.real_time else lambda: SIMULATED_DAY,
                    listeners=(records.on_event, self._on_event, shown, check),  # type: ignore[arg-type]
                    guards=(LogGuard(records.error),),
                    resumption=resumption,
                )
                await records.after_run()
                await check.close()
            finally:
                await check.close(patience=0.0)
            return report

    def _on_event(self, event: Event) -> None:
        if isinstance(event, RunFinished):
            self._ended = event.report

    def _write_inputs(self) -> None:
        if self._resumption is not None:
            return  # they are there
        write_plan(self.folder / PLAN, self._plan)
        truth = compose.world_truth(self.world, self._plan.name, self._spec.seed)
        write_json(self.folder / TRUTH, truth)
        write_dry_run(self.folder, self._spec)


def _say_checked(checked: Looked) -> None:
    console.err.print(f"{checked.window}  {checked.says}", markup=False)


def _wall_time() -> str:
    from datetime import UTC, datetime

    return datetime.now(UTC).isoformat(timespec="milliseconds")
