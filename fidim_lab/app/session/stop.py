"""`fidim stop`: the emergency stop from any terminal, latched, for one rig or for all services of this user."""

import asyncio
import os
import pwd
import signal
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from drivers.clock import LoopClock, within
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.service.client import ServiceGoneError, connect
from fidim_lab.app.service.commands import EmergencyStop
from fidim_lab.app.service.kept_stop import keep, kept
from fidim_lab.app.service.lock import Holder, holder, left_behind, running
from fidim_lab.app.service.place import ServicePlace, all_places, places_for
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.stop_file import Stopped
from fidim_lab.errors import HardwareError, RefusedError, SetupError
from fidim_lab.say import printable

FORMAT = "fidim-stop/1"
ANSWER_WITHIN = 2.0
"""s; a service that does not answer is terminated"""
END_WITHIN = 1.0
"""s; one that does not end then, either, is killed"""
LOOK = 0.05
"""s"""
KILLED = (
    "The service of run {} was killed: its drives stop by themselves once they miss its heartbeat. "
    "PRESS THE HARDWARE EMERGENCY STOP if the robot moves."
)


def stop_command(rig: Path | None, reason: str, not_understood: str = "", json_file: Path | None = None) -> int:
    """Stop it; returns the exit code: 0 stopped, 1 nothing was running, 3 a service did not answer.

    not_understood: what was typed besides; with it, or with a rig file that cannot be read, all services are stopped.
    """
    doubt = f"“{printable(not_understood)}” is not understood" if not_understood else ""
    try:
        places = places_for(None if doubt else rig)
    except SetupError as error:
        places, doubt = all_places(), str(error).rstrip(".")
    if doubt:
        console.err.print(f"{doubt}: stopping all your services.", markup=False)
    found = running(places)
    if not found:
        others = ", ".join(printable(who.folder) for _, who in running(all_places()))
        of_rig = f"No service of {rig} is running; {others} is still running. To stop all: fidim stop."
        console.out.print(of_rig if others else "No service is running.", markup=False)
        for killed in filter(None, map(left_behind, places)):
            console.err.print(KILLED.format(printable(killed.folder)), markup=False)
        write_answer(json_file, FORMAT, {"exit_code": 1, "services": []})
        return 1
    codes = asyncio.run(_stop_all(found, reason))
    told = [
        {"folder": who.folder, "pid": who.pid, "stopped": not code} for code, (_, who) in zip(codes, found, strict=True)
    ]
    write_answer(json_file, FORMAT, {"exit_code": max(codes), "services": told})
    return max(codes)


async def _stop_all(found: list[tuple[ServicePlace, Holder]], reason: str) -> list[int]:
    """At the same time: a service that hangs keeps no other one running."""
    return await asyncio.gather(*(_stop(place, who, reason) for place, who in found))


async def _stop(place: ServicePlace, who: Holder, reason: str) -> int:
    folder = printable(who.folder)
    try:
        says = await within(LoopClock(), ANSWER_WITHIN, _press(place, reason))
    except (SetupError, ServiceGoneError, RefusedError, TimeoutError):
        # At once, so that the rig is latched though this command is killed, too; beside it, for a disk may hang.
        keeping = asyncio.get_running_loop().run_in_executor(None, _keep, place, who, reason)
        did = f"{await _end(place, who.pid)} {await keeping}".strip()
        console.err.print(
            f"The service of run {folder} does not answer. {did} PRESS THE HARDWARE EMERGENCY STOP if the robot moves.",
            markup=False,
        )
        return 3
    console.out.print(f"{folder}: {says}", markup=False)
    return 0


async def _press(place: ServicePlace, reason: str) -> str:
    async with connect(place.socket, name=f"fidim stop ({user()})", samples=False) as service:
        return (await service.command(EmergencyStop(reason=reason))).says


async def _end(place: ServicePlace, pid: int) -> str:
    """End a process that holds the rig and does not answer: its drives miss its heartbeat then, and stop."""
    if not pid:
        return "Its process is not known, so none was ended."
    clock = LoopClock()
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.kill(pid, number)
        end = clock.now() + END_WITHIN
        while clock.now() < end:
            if (now := holder(place)) is None or now.pid != pid:
                return f"Its process {pid} was ended ({number.name})."
            await clock.sleep(LOOK)
    return f"Its process {pid} could not be ended."


def _keep(place: ServicePlace, who: Holder, reason: str) -> str:
    """Latch the rig for a service that could not; returns why not. A path told by another user is not written to."""
    path = Path(who.stopped)
    if not who.stopped or place.folder.stat().st_uid != os.getuid():
        return "Its rig is not latched."
    stopped = Stopped(
        f"fidim stop ({user()})",
        reason or "its service did not answer",
        datetime.now(UTC).isoformat(timespec="milliseconds"),
    )
    try:
        return "" if kept(path) else keep(path, stopped)
    except HardwareError as error:
        return f"Its rig is not latched: {error.message}"


def user() -> str:
    """Whoever types this, also behind sudo."""
    name = os.environ.get("SUDO_USER")
    if not name:
        with suppress(KeyError):
            name = pwd.getpwuid(os.getuid()).pw_name
    return name or str(os.getuid())
