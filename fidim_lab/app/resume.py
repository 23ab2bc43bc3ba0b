"""`fidim resume`: go on with a run, however it ended, from its folder alone."""

import json
import shlex
from pathlib import Path

from drivers.cia402.bringup import HAS_POWER
from fidim_lab.app import console
from fidim_lab.app.run import require_answers, start_and_watch
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.spec import read_spec
from fidim_lab.app.service.unattended import SUMMARY


def resume_command(folder: Path, *, accept_place: bool) -> int:
    """Returns the run's exit code. Raises FileError for no run, RefusedError where nothing is left to do."""
    spec = read_spec(folder).model_copy(update={"out": folder.absolute(), "resume": True, "accept_place": accept_place})
    work = prepare(spec)
    known = work.resumption.rows if work.resumption else {}
    left = len(work.experiment.roles) - len(known)
    console.err.print(f"{len(known)} windows have their verdict, {left} are left.", markup=False)
    require_answers(work)
    code = start_and_watch(work)
    if code and HAS_POWER in _reason(folder):
        for line in power_hint(spec.rig, folder):
            console.err.print(line, markup=False, soft_wrap=True)
    return code


def power_hint(rig: Path, folder: Path) -> tuple[str, ...]:
    """What to type where a killed service has left its drives holding; a person decides to let go of the load."""
    return (
        "The drives still hold the robot, as a service that was killed leaves them. Secure the load, then:",
        f"    fidim power-off {shlex.quote(str(rig))}",
        f"    fidim resume {shlex.quote(str(folder.absolute()))}",
    )


def _reason(folder: Path) -> str:
    """Why the run ended, from its summary; empty where there is none."""
    try:
        return str(json.loads((folder / SUMMARY).read_text(encoding="utf-8"))["reason"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
