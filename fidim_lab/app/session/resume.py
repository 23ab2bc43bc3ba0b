"""`fidim resume`: go on with a run, however it ended, from its folder alone.

The service does the work: it reads what is left, takes over the drives in whatever state they are, and compares where
the robot is with the journal before anything moves. Nothing heavy is imported here: a robot waits.
"""

import asyncio
import shlex
from dataclasses import dataclass
from pathlib import Path

from drivers.ports import DriveState
from fidim_lab.app.formats.answer_file import write_summary
from fidim_lab.app.formats.dry_run_spec import read_dry_run
from fidim_lab.app.formats.run_spec import RunSpec, again, read_spec, read_summary
from fidim_lab.app.service.lock import holder
from fidim_lab.app.service.own_process import end_service, serves
from fidim_lab.app.service.place import place_of
from fidim_lab.app.session.after_run import advise
from fidim_lab.app.session.run_process import start_and_watch
from fidim_lab.app.session.undo_stop import confirmed, says_yes
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import RefusedError
from fidim_lab.say import printable


@dataclass(frozen=True)
class ResumeOptions:
    """As on the command line."""

    folder: Path
    accept_place: bool
    trust: bool
    """what run.json has carried out needs no question"""
    json_file: Path | None = None


def resume_command(options: ResumeOptions) -> int:
    """Returns the run's exit code. Raises FileError for no run, RefusedError where nothing is left to do.

    RefusedError as well where a person does not undo an emergency stop, or does not trust a procedure's file.
    """
    folder = options.folder
    if (dry := read_dry_run(folder)) is not None:
        from fidim_lab.app.session.dry_run import resume_dry_run

        return resume_dry_run(folder, dry, options.json_file)
    spec = again(read_spec(folder), folder.absolute()).model_copy(update={"accept_place": options.accept_place})
    if not options.trust:
        spec = trusted(spec)
    place = place_of(read_rig(spec.rig), embedded=spec.embedded, run=spec.own_place)
    if (who := holder(place)) is not None and serves(who, folder):
        asyncio.run(end_service(place))  # it stays after its run, or refuses, which the next line says
    code = start_and_watch(spec, place, confirmed(spec))
    advise(spec, code, power_hint(str(read_summary(folder).get("reason", "")), spec.rig, folder))
    write_summary(options.json_file, folder.absolute(), code)
    return code


def trusted(spec: RunSpec) -> RunSpec:
    """The same without what a person does not let run.json have carried out.

    A folder may be somebody else's. Raises RefusedError for a procedure's file that is not trusted.
    """
    for name, what in (("on_finish", "after a successful run"), ("on_fault", "after any other run")):
        command = str(getattr(spec, name))
        if command and not says_yes(f"run.json asks to execute this command {what}: {printable(command)}\nAllow it?"):
            console.warn([f"{name} of run.json is ignored; --trust accepts it without asking"])
            spec = spec.model_copy(update={name: ""})
    if spec.procedure.endswith(".py") and not says_yes(
        f"run.json asks to execute this Python file as the procedure: {printable(spec.procedure)}\nAllow it?"
    ):
        raise RefusedError("Its procedure is a Python file that was not allowed, so the run is not continued.")
    return spec


def power_hint(reason: str, rig: Path, folder: Path) -> tuple[str, ...]:
    """What to type where drives could not be taken over; a person decides to let go of the load."""
    from drivers.cia402.bring_up import NOT_TAKEN_OVER

    if NOT_TAKEN_OVER in reason:
        says, more = "A drive holds the load, but must be configured again.", ""
    elif f"the drive is in {DriveState.FAULT}" in reason:
        says, more = "A drive is in fault; its cause must be found.", ' --acknowledge "YOUR NAME"'
    else:
        return ()
    return (
        f"{says} Secure the load, then:",
        f"    fidim power-off {shlex.quote(str(rig))}{more}",
        f"    fidim resume {shlex.quote(str(folder.absolute()))}",
    )
