"""The service's process: a `RunSpec` in, a run in its folder, an exit code out.

Started by `fidim run` and `fidim resume`; `run_service` may also be called in process.
"""

import gc
import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from drivers.cia402.dictionary import WinchConfig
from drivers.disk import DiskThreads
from drivers.ports import Disk
from fidim_lab.app import compose
from fidim_lab.app.compose.proofs import ProofKeeper
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.app.formats.aligned import PROCEDURE as ALIGN
from fidim_lab.app.formats.aligned import AlignmentKeeper, known_alignment
from fidim_lab.app.formats.run_records import RunRecords, bytes_a_second
from fidim_lab.app.formats.run_spec import NAME as SPEC
from fidim_lab.app.formats.run_spec import PLAN, RIG, RunSpec, overridden, write_spec
from fidim_lab.app.judging.model_check import Looked, ModelCheck
from fidim_lab.app.service.lock import Lock, held
from fidim_lab.app.service.place import ServicePlace, place_of
from fidim_lab.app.service.process.board import DefaultAnswer
from fidim_lab.app.service.process.broadcast import wall_time
from fidim_lab.app.service.process.judging import explain_step
from fidim_lab.app.service.process.opening import HOMING, Opened, open_rig
from fidim_lab.app.service.process.service import Identity, Service, new_token
from fidim_lab.app.service.process.unattended import PatienceGuard, QuietMove, local_time, run_hook, write_summary
from fidim_lab.data.design_file import read_plan_or_design
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Alignment, Plan
from fidim_lab.data.rigs.alignment_file import NAME as ALIGNMENT
from fidim_lab.data.rigs.alignment_file import write_alignment
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import FidimError, HardwareError, of_file
from procedures.guards.guard import Guard
from procedures.guards.host_guards import host_guards, require_space
from procedures.guards.robot_guards import LogGuard
from procedures.handlers import HANDLERS
from procedures.protocols.catalogue import experiment
from procedures.protocols.listing import Outline
from procedures.recording.disk import sync
from procedures.recording.resumption import Resumption, read_resumption
from procedures.recording.run_folder import one_writer
from procedures.report import RunReport, WindowRow
from procedures.run import Experiment, run_procedure
from procedures.settings import Settings
from procedures.steps import MoveTo
from procedures.steps.compare import Explain
from procedures.timing import uninterrupted


@dataclass(frozen=True, eq=False)
class Work:
    """All that a service needs before it opens anything."""

    spec: RunSpec
    file: RigFile
    winches: tuple[WinchConfig, ...]
    """with the proofs of their stops, fitted to what their drives can do"""
    plan: Plan
    experiment: Experiment
    resumption: Resumption | None = None
    alignment: Alignment | None = None
    """of motion capture against the encoders, as it was measured with this rig"""


def prepare(spec: RunSpec) -> Work:
    """Read files, check the plan (some seconds). Raises FidimError; nothing is opened, nothing moves."""
    file = read_rig(spec.rig)
    if spec.embedded:
        file = compose.rehearsal_file(file, compose.Ports())
        compose.simulated_world(file.robot, spec.seed, spec.hide)  # refuses an effect that nobody knows
    plan_file = spec.out / PLAN if spec.resume else spec.plan
    plan = read_plan_or_design(plan_file, file.robot.n)
    resumption = None
    if spec.resume:
        resumption = read_resumption(spec.out, {window.id: window.role for window in plan.windows})
        if spec.accept_place:
            resumption = replace(resumption, place=None)
    winches = winch_configs(file, homing=spec.procedure == HOMING, on_trial=bool(spec.by))
    own = spec.procedure.endswith(".py")  # whose mistakes are said of that file
    with of_file(None if own else plan_file):
        made = experiment(spec.procedure, plan, file.robot, _settings(spec, file, winches), resumption=resumption)
    require_space(spec.out, Outline(made.procedure).between[1], bytes_a_second(file), made.settings.guard)
    alignment = None if spec.resume or spec.procedure == ALIGN else known_alignment(file)
    return Work(spec, file, winches, plan, made, resumption, alignment)


def run_service(work: Work) -> int:
    """Serve until the run has ended; returns the exit code. Raises SetupError where another service has the rig."""
    gc.collect()
    place = place_of(work.file, embedded=work.spec.embedded, run=work.spec.own_place)
    ended: list[RunReport] = []
    try:
        with held(place, work.spec.out, work.spec.stopped) as lock:
            return compose.run_loop(_serve(work, place, lock, ended), real_time=True)
    finally:
        if ended and (wrong := run_hook(work.spec, ended[-1])):
            sys.stderr.write(f"fidim: {wrong}\n")


async def _serve(work: Work, place: ServicePlace, lock: Lock, ended: list[RunReport]) -> int:
    spec = work.spec
    place_left = work.resumption.place if work.resumption else None
    left = place_left.end if place_left else None
    async with AsyncExitStack() as stack:
        disk = stack.enter_context(DiskThreads())
        opened = await stack.enter_async_context(open_rig(spec, work.file, work.winches, work.plan, left))
        service = _service(work, opened)
        gc.freeze()  # what is there stays: looking through it again takes 40 ms, three periods of SYNC
        await service.hub.listen_unix(place.socket)
        if spec.tcp_port is not None:
            lock.tell(await service.hub.listen_tcp(spec.tcp_port, new_token(place.token)))

        async def carry(service: Service) -> RunReport:
            try:
                return await _carry_out(work, opened, service, disk)
            finally:
                if service.watcher.report is not None:
                    ended.append(service.watcher.report)

        return await service.serve(carry)


def _service(work: Work, opened: Opened) -> Service:
    spec = work.spec
    identity = Identity(spec.out, work.file.name, spec.stay, spec.stopped)
    known = work.resumption.rows if work.resumption else {}
    rows = [known.get(window, WindowRow(window, role)) for window, role in work.experiment.roles.items()]
    answers = spec.unattended.answers if spec.unattended else {}
    defaults = {kind: DefaultAnswer(answer.choice, answer.after) for kind, answer in answers.items()}
    return Service(work.experiment, opened, identity, rows, defaults)


async def _carry_out(work: Work, opened: Opened, service: Service, disk: Disk) -> RunReport:
    logs = RunRecords(work.spec.out, opened.rig, lambda: write_inputs(work), disk)
    opened.tap(logs.on_frame)
    guards = (LogGuard(logs.error), *_more_guards(work, disk))
    service.broadcast.more_guards(guards)
    if work.resumption is not None:
        known, planned = len(work.resumption.rows), len(work.experiment.roles)
        says = f"{known} windows are judged, {planned - known} remain"
        service.event_log.note(kind="resumed", reason=says)
    check = ModelCheck(work.spec.out, len(work.experiment.roles), partial(_tell_checked, service))
    spec, warn = work.spec, service.event_log.warn
    alignments = AlignmentKeeper(work.file, spec.out, wall_time, warn, disk)
    proofs = ProofKeeper(work.file, work.winches, spec.out, spec.by, wall_time, warn, disk)
    handlers = {**HANDLERS, Explain: explain_step}
    unattended = spec.unattended
    if unattended is not None and unattended.quiet_hours is not None:
        says = partial(service.event_log.note, kind="paused")
        handlers[MoveTo] = QuietMove(unattended.quiet_hours, local_time, lambda text: says(reason=text))
    try:
        report = await run_procedure(
            work.experiment,
            service.rig,
            work.spec.out,
            wall_time=wall_time,
            listeners=(logs.on_event, *service.listeners(), check, alignments, proofs),
            guards=guards,
            handlers=handlers,
            control=service.control,
            resumption=work.resumption,
            disk=disk,
        )
        await proofs.closed()
        await logs.after_run()
        await check.close()
        return report
    finally:
        await uninterrupted(_ended(work, service, logs, check, disk))


async def _ended(work: Work, service: Service, logs: RunRecords, check: ModelCheck, disk: Disk) -> None:
    """What is written when a run has ended, however it did."""
    await check.close(patience=0.0)
    report = service.watcher.report
    if report is not None:
        with suppress(OSError, HardwareError):  # a full disk: the journal has said so
            await disk.do(lambda: write_summary(work.spec.out, report))
    await logs.closed()  # writes the manifest, of all that is there


def _tell_checked(service: Service, checked: Looked) -> None:
    outcome = {True: "holds", False: " ".join(checked.suspected) or "does not hold", None: ""}[checked.holds]
    service.event_log.note(kind="model-checked", window=checked.window, outcome=outcome, text=checked.says)


def _more_guards(work: Work, disk: Disk) -> tuple[Guard, ...]:
    unattended = work.spec.unattended
    host = host_guards(work.spec.out, work.experiment.settings.guard, time.time, disk)
    if unattended is None or unattended.max_hours is None:
        return host
    return (*host, PatienceGuard(unattended.max_hours))


def write_inputs(work: Work) -> None:
    """What a run's folder needs beside its windows. Raises OSError, HardwareError."""
    if work.resumption is not None:
        return  # they are there
    shutil.copyfile(work.spec.rig, work.spec.out / RIG)
    write_plan(work.spec.out / PLAN, work.plan)
    write_spec(work.spec.out, work.spec)
    if work.alignment is not None:
        write_alignment(work.spec.out / ALIGNMENT, work.alignment)
    for name in (RIG, PLAN, SPEC, ""):  # without them no run goes on after a power cut
        sync(work.spec.out / name)


def _settings(spec: RunSpec, file: RigFile, winches: tuple[WinchConfig, ...]) -> Settings:
    settings = compose.rig_settings(file, winches=winches)
    found = overridden(compose.patient_settings(settings) if spec.embedded else settings, spec.settings)
    compose.require_what_winches_do(file, found, winches)
    return found


def main(arguments: Sequence[str]) -> int:
    """The process: a file with a RunSpec as its argument. What goes wrong is said on standard error."""
    try:
        spec = read_json_as(Path(arguments[0]), RunSpec.model_validate)
        with one_writer(spec.out):  # before what is there is read
            return run_service(prepare(spec))
    except FidimError as error:
        sys.stderr.write(f"fidim: {error}\n")
        return error.exit_code
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
