"""`fidim shutdown`: end a service that has nothing to do any more (`fidim run --stay`, a dry run that nobody began)."""

import asyncio
from pathlib import Path

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.service.lock import Holder, running
from fidim_lab.app.service.own_process import end_service, serves
from fidim_lab.app.service.place import ServicePlace, places_for
from fidim_lab.app.terminal import console
from fidim_lab.errors import SetupError
from fidim_lab.say import printable

FORMAT = "fidim-shutdown/1"


def shutdown_command(folder: Path | None, rig: Path | None, json_file: Path | None = None) -> int:
    """End it; returns the exit code: 0 ended, 1 nothing was running, or a run goes on.

    Raises SetupError where several services are running and none was named.
    """
    found = _found(folder, rig)
    if len(found) > 1:
        folders = ", ".join(printable(who.folder) for _, who in found)
        raise SetupError(f"Several services are running ({folders}).", hint="Give the run folder of one.")
    said = [(who.folder, asyncio.run(end_service(place))) for place, who in found]
    for ended, refusal in said:
        console.out.print(f"{printable(ended)}: {refusal or 'the service has ended.'}", markup=False)
    if not said:
        console.out.print("No service is running.", markup=False)
    code = 0 if said and not said[0][1] else 1
    services = [{"folder": ended, "ended": not refusal, "says": refusal} for ended, refusal in said]
    write_answer(json_file, FORMAT, {"exit_code": code, "services": services})
    return code


def _found(folder: Path | None, rig: Path | None) -> list[tuple[ServicePlace, Holder]]:
    if folder is not None and rig is not None:
        raise SetupError("Give a run folder or --rig, not both.")
    found = running(places_for(rig))
    return found if folder is None else [(place, who) for place, who in found if serves(who, folder)]
