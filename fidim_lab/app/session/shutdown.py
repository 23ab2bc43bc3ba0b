"""`fidim shutdown`: end a service that has nothing to do any more (`fidim run --stay`, a dry run that nobody began)."""

import asyncio
from contextlib import suppress
from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.service.client import ServiceGoneError, connect
from fidim_lab.app.service.commands import Shutdown
from fidim_lab.app.service.lock import Holder, holder, running
from fidim_lab.app.service.place import ServicePlace, places_for
from fidim_lab.app.terminal import console
from fidim_lab.errors import SetupError
from fidim_lab.say import printable
from procedures.timing import within

FORMAT = "fidim-shutdown/1"
ANSWER_WITHIN = 2.0
"""s"""
ENDS_WITHIN = 10.0
"""s from the command to the end of the process"""
LOOK = 0.05
"""s"""


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


def serves(who: Holder, folder: Path) -> bool:
    """Whether the service is that of the run in this folder."""
    return Path(who.folder).resolve() == folder.resolve()


async def end_service(place: ServicePlace) -> str:
    """End a service and wait until its process has let the rig go; returns why not, empty where it has."""
    clock = LoopClock()
    with suppress(SetupError, ServiceGoneError, TimeoutError):  # its socket is closed: it is ending already
        if says := await within(clock, ANSWER_WITHIN, _refusal(place)):
            return f"it goes on: {says}."
    end = clock.now() + ENDS_WITHIN
    while holder(place) is not None:
        if clock.now() > end:
            return f"it has not ended within {ENDS_WITHIN:g} s; see {place.log}."
        await clock.sleep(LOOK)
    return ""


async def _refusal(place: ServicePlace) -> str:
    async with connect(place.socket, name="fidim shutdown", samples=False) as service:
        await service.take_lease(force=True)
        answer = await service.command(Shutdown())
    return "" if answer.ok else answer.says
