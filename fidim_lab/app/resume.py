"""`fidim resume`: go on with a run, however it ended, from its folder alone.

The service does the work: it reads what is left, takes over the drives in whatever state they are, and compares where
the robot is with the journal before anything moves. Nothing heavy is imported here: a robot waits.
"""

import shlex
from pathlib import Path

from drivers.ports import DriveState
from fidim_lab.app import console
from fidim_lab.app.answer_file import write_summary
from fidim_lab.app.run_process import start_and_watch
from fidim_lab.app.service.place import place_of
from fidim_lab.app.service.spec import PLAN, RIG, RunSpec, read_spec, read_summary
from fidim_lab.data.rig_file import read_rig


def resume_command(folder: Path, *, accept_place: bool, json_file: Path | None = None) -> int:
    """Returns the run's exit code. Raises FileError for no run, RefusedError where nothing is left to do."""
    spec = _again(read_spec(folder), folder.absolute(), accept_place=accept_place)
    code = start_and_watch(spec, place_of(read_rig(spec.rig), embedded=spec.embedded))
    if code:
        for line in power_hint(str(read_summary(folder).get("reason", "")), spec.rig, folder):
            console.err.print(line, markup=False, soft_wrap=True)
    write_summary(json_file, folder.absolute(), code)
    return code


def _again(spec: RunSpec, folder: Path, *, accept_place: bool) -> RunSpec:
    """The same run, to go on. A rehearsal's papers were made for it and are gone: the folder has copies."""
    update: dict[str, object] = {"out": folder, "resume": True, "accept_place": accept_place}
    if spec.embedded and not spec.rig.exists():
        update |= {"rig": folder / RIG, "plan": folder / PLAN}
    return spec.model_copy(update=update)


def power_hint(reason: str, rig: Path, folder: Path) -> tuple[str, ...]:
    """What to type where drives could not be taken over; a person decides to let go of the load."""
    from drivers.cia402.takeover import NOT_TAKEN_OVER

    if NOT_TAKEN_OVER in reason:
        says, more = "A drive holds the load, but would have to be set anew.", ""
    elif f"the drive is in {DriveState.FAULT}" in reason:
        says, more = "A drive is in fault; somebody has to look at the cause.", ' --acknowledge "YOUR NAME"'
    else:
        return ()
    return (
        f"{says} Secure the load, then:",
        f"    fidim power-off {shlex.quote(str(rig))}{more}",
        f"    fidim resume {shlex.quote(str(folder.absolute()))}",
    )
