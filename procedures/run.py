"""One run: check the plan, record into a folder, and leave the robot held whatever happens.

`run_procedure` carries out an experiment, which `procedures.protocols.catalogue` makes. What is wrong before the first
command raises; after it, every end (done, refused, fault, Ctrl-C) is a `RunReport` and a held robot.
"""

import asyncio
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path

from drivers.disk import InlineDisk
from drivers.ports import Disk, Rig
from fidim_lab.data.records import Robot
from fidim_lab.errors import FidimError, HardwareError, RefusedError, SetupError
from procedures.control import Control
from procedures.engine import Engine, ProcedureEnd
from procedures.events import Listener, Publisher, RunFinished, RunStarted
from procedures.expected.limits import check_moves
from procedures.guards import geometry_guard
from procedures.guards.device_guards import device_guards
from procedures.guards.guard import Guard, Reacting, Reaction
from procedures.guards.robot_guards import LogGuard, standard_guards
from procedures.handlers import HANDLERS, Handler
from procedures.outcomes import Outcome
from procedures.protocols.experiment import Experiment
from procedures.protocols.listing import Outline
from procedures.recording.disk import settled
from procedures.recording.journal import FORMAT, Journal, LineKind, WallTime
from procedures.recording.ledger import Ledger
from procedures.recording.recorder import Recorder, WriteBytes
from procedures.recording.resumption import Resumption
from procedures.recording.run_folder import RunFolder
from procedures.report import RunReport
from procedures.stand import Stand
from procedures.steps import Step
from procedures.stopping import POWERED
from procedures.teardown import UNTOUCHED, Held, deferred_interrupts, hold_robot
from procedures.timing import uninterrupted


async def run_procedure(
    experiment: Experiment,
    rig: Rig,
    folder: Path,
    *,
    wall_time: WallTime,
    listeners: Sequence[Listener] = (),
    guards: Sequence[Guard] = (),
    handlers: Mapping[type[Step], Handler] = HANDLERS,
    control: Control | None = None,
    resumption: Resumption | None = None,
    write: WriteBytes = os.write,
    disk: Disk | None = None,
) -> RunReport:
    """Carry an experiment out into a new folder, which is a campaign as spec/formats.md fixes it.

    wall_time: the time of day as ISO 8601 text, for the journal (a constant in simulations).
    guards: besides the standard ones. control: by which people pause, skip, retry, abort and stop.
    resumption: the folder is an earlier run's, which goes on; the procedure has only what is left to do.
    disk: takes all that is written; without one everything is written at once, in whatever time that takes.
    Raises SetupError or InfeasibleError before anything is commanded; CancelledError after the robot is held when it
    was cancelled (the report goes to the listeners in `RunFinished`); and what only a bug can raise, likewise after
    the robot is held.
    """
    outline = Outline(experiment.procedure)
    check_moves(outline.steps, experiment.robot, experiment.workspace)
    import_module("procedures.recording.marker_drift")  # scipy takes a second: before anything moves
    kept = None if resumption is None else resumption.entries
    disk = InlineDisk() if disk is None else disk

    def opened() -> tuple[RunFolder, Journal]:
        made = RunFolder(folder, experiment.name, experiment.robot, rig.markers.rate, kept)
        return made, Journal(made.journal, rig.clock, wall_time, disk)

    factors = _newton_per_ampere(experiment.robot, rig)
    files = await disk.do(opened)
    run = _Run(experiment, rig, outline, files, factors, listeners, control or Control(), write, resumption, disk)
    return await run.carry_out(handlers, guards)


class _Run:
    """One run: what belongs together while it lasts."""

    def __init__(
        self,
        experiment: Experiment,
        rig: Rig,
        outline: Outline,
        files: tuple[RunFolder, Journal],
        factors: tuple[float, ...],
        listeners: Sequence[Listener],
        control: Control,
        write: WriteBytes,
        resumption: Resumption | None,
        disk: Disk,
    ) -> None:
        robot, settings = experiment.robot, experiment.settings
        self._experiment = experiment
        self._rig = rig
        self._factors = factors
        self._outline = outline
        self._resumption = resumption
        self._disk = disk
        self._folder, self._journal = files
        folder = self._folder.path
        self._ledger = Ledger(folder, experiment.roles, None if resumption is None else resumption.rows)
        age, markers = settings.guard.sample_age, len(robot.markers)
        self._recorder = Recorder(
            folder, rig.clock, rig.markers, rig.winches, markers, age, write, factors, rig.gauges, disk
        )
        self._publish = Publisher([self._recorder.on_event, *listeners])
        self._engine = Engine(rig, self._outline, self._journal, self._publish, self._ledger, control)

    async def carry_out(self, handlers: Mapping[type[Step], Handler], guards: Sequence[Guard]) -> RunReport:
        """Perform the steps, then hold the robot; raises only after that."""
        begin = self._rig.clock.now()
        error: BaseException | None = None
        with self._journal:
            try:
                ending = await self._perform(handlers, guards)
            except FidimError as problem:
                ending = ProcedureEnd(_outcome(problem), str(problem), isinstance(problem, SetupError))
            except BaseException as problem:  # cancelled, or a bug: held first, raised afterwards
                error, ending = problem, self._broken_off(problem)
            with deferred_interrupts():
                report = await uninterrupted(self._close(ending, begin, error))
        if error is not None:
            raise error
        return report

    async def _perform(self, handlers: Mapping[type[Step], Handler], more: Sequence[Guard]) -> ProcedureEnd:
        experiment, settings = self._experiment, self._experiment.settings
        stand = Stand(
            rig=self._rig,
            robot=experiment.robot,
            settings=settings,
            workspace=experiment.workspace,
            recorder=self._recorder,
            folder=self._folder,
            newton_per_ampere=self._factors,
            progress=self._engine.progress,
            prompted=self._engine.prompted,
            rest=experiment.rest,
            place=None if self._resumption is None else self._resumption.place,
            news=self._engine.news,
            disk=self._disk,
        )
        names = [winch.name for winch in self._rig.winches]
        limits = experiment.robot.limits.tension
        guards = (
            *standard_guards(names, self._factors, limits, settings.guard),
            *self._geometry(stand),
            *device_guards(self._rig, settings.guard),
            LogGuard(lambda: self._disk.error),
            *more,
        )
        outline, windows = self._outline, tuple(experiment.roles)
        data = {
            "format": FORMAT,
            "windows": windows,
            "seconds": round(outline.seconds, 1),
            "seconds_between": [round(seconds, 1) for seconds in outline.between],
            "settings": asdict(settings),
        }
        kind = LineKind.RUN_STARTED if self._resumption is None else LineKind.CONTINUED
        self._journal.write(kind, text=experiment.name, data=data)
        self._publish(RunStarted(self._rig.clock.now(), experiment.name, windows, outline.seconds, outline.between))
        return await self._engine.run(experiment.procedure, stand, handlers, guards, settings.guard)

    def _geometry(self, stand: Stand) -> tuple[Guard, ...]:
        """What watches encoders by markers, where the robot allows it."""
        robot, settings = stand.robot, stand.settings
        if stand.rest is None or geometry_guard.lacks(robot):
            return ()

        def compared() -> geometry_guard.Place | None:
            last = stand.places.last
            return None if last is None else (last[0].lengths, last[0].marker)

        guard = geometry_guard.GeometryGuard(
            robot, compared, stand.rest.pose, settings, self._factors, stand.places.doubt
        )
        return (Reacting.by(settings.guard, guard),)

    async def _close(self, ending: ProcedureEnd, begin: float, error: BaseException | None) -> RunReport:
        """Hold the robot, keep what was recorded, write it down. Cannot be cut short."""
        held = await self._hold()
        await self._engine.ended()
        kept = await self._recorder.abandon()
        reason = ending.reason
        if kept is not None:
            reason += f" What was recorded of the open window is kept in {kept.relative_to(self._folder.path)}."
        if self._publish.failed:
            reason += f" A step after the run failed, which is a bug of fidim-lab: {'; '.join(self._publish.failed)}."
        report = RunReport(
            name=self._experiment.name,
            folder=self._folder.path,
            outcome=ending.outcome,
            reason=reason,
            windows=self._ledger.rows,
            held=held.ok,
            held_says=held.says,
            stopped=held.winches,
            seconds=self._rig.clock.now() - begin,
            interrupted=isinstance(error, asyncio.CancelledError | KeyboardInterrupt),
            wrong_input=ending.wrong_input,
        )
        unwritten = await self._write_down(report)
        if unwritten and (report.wrong_input or report.outcome is not Outcome.ERROR):
            reason = f"{report.reason} {unwritten}".strip()
            report = replace(report, outcome=Outcome.ERROR, reason=reason, wrong_input=False)
        self._publish(RunFinished(self._rig.clock.now(), report))
        return report

    async def _hold(self) -> Held:
        pulse, settings = self._engine.pulse, self._experiment.settings
        samples = (winch.latest() for winch in self._rig.winches)
        powered = any(sample is not None and sample.state in POWERED for sample in samples)
        if not pulse.touched and not powered:
            return UNTOUCHED
        latched = pulse.trip is not None and pulse.trip.reaction is Reaction.QUICK_STOP
        by_markers = pulse.trip is not None and pulse.trip.guard == geometry_guard.NAME
        return await hold_robot(
            self._rig.clock,
            self._rig.winches,
            settings.hold,
            settings.guard,
            latched=latched,
            doubt="markers contradict the encoders" * by_markers,
        )

    async def _write_down(self, report: RunReport) -> str:
        """The journal's last lines; returns why the disk did not take all, which must not hide the report."""
        trip = self._engine.pulse.trip
        if trip is not None:
            told = {"guard": trip.guard, "reaction": trip.reaction.value, "at": round(trip.t, 6)}
            self._journal.write(LineKind.TRIPPED, outcome=Outcome.ERROR, reason=trip.says, data=told)
        outcome = Outcome.PASS if report.held else Outcome.ERROR
        samples = [winch.latest() for winch in self._rig.winches]
        lengths = [round(sample.length, 6) for sample in samples if sample is not None]
        data: dict[str, object] = {"lengths": lengths} if len(lengths) == len(samples) else {}
        data["winches"] = [one.values for one in report.stopped]
        self._journal.write(LineKind.HELD, outcome=outcome, reason=report.held_says, data=data)
        windows = {row.id: row.outcome.value for row in report.windows}
        data = {"windows": windows, "seconds": round(report.seconds, 3)}
        self._journal.write(LineKind.RUN_FINISHED, outcome=report.outcome, reason=report.reason, data=data)
        try:
            await settled(self._disk)
        except HardwareError as error:
            return str(error)
        return ""

    def _broken_off(self, error: BaseException) -> ProcedureEnd:
        step = self._engine.pulse.step
        where = f" at “{step.text}”" if step else ""
        if isinstance(error, asyncio.CancelledError | KeyboardInterrupt):
            return ProcedureEnd(Outcome.ABORTED, f"Interrupted{where}.")
        return ProcedureEnd(Outcome.ERROR, f"A bug of this program{where}: {type(error).__name__}: {error}.")


def _outcome(error: FidimError) -> Outcome:
    return Outcome.FAIL if isinstance(error, RefusedError) else Outcome.ERROR


def _newton_per_ampere(robot: Robot, rig: Rig) -> tuple[float, ...]:
    if len(rig.winches) != robot.n:
        raise SetupError(f"The rig has {len(rig.winches)} winches, the robot file {robot.n} cables.")
    if robot.winches is None:
        raise SetupError(
            "The robot file has no [winch] table, so motor currents give no tension and no limit can be checked.",
            hint="Add drum_radius, gear_ratio, efficiency and torque_constant.",
        )
    return tuple(winch.newton_per_ampere for winch in robot.winches)
