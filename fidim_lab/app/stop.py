"""`fidim stop`: the emergency stop from any terminal, latched, for one rig or for all services of this user."""

import asyncio
import os
import signal
from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app import console
from fidim_lab.app.answer_file import write_answer
from fidim_lab.app.service.client import ServiceGoneError, connect
from fidim_lab.app.service.commands import EmergencyStop
from fidim_lab.app.service.place import Holder, Place, holder, place_of, runtime_folder
from fidim_lab.data.rig_file import read_rig
from fidim_lab.errors import SetupError
from procedures.timing import within

FORMAT = "fidim-stop/1"
ANSWER_WITHIN = 2.0
"""s; a service that does not answer is terminated"""


def stop_command(rig: Path | None, reason: str, json_file: Path | None = None) -> int:
    """Stop it; returns the exit code: 0 stopped, 1 nothing was running, 3 a service did not answer."""
    found = [(place, who) for place in _places(rig) if (who := holder(place)) is not None]
    if not found:
        console.out.print("No service is running.", markup=False)
        write_answer(json_file, FORMAT, {"exit_code": 1, "services": []})
        return 1
    codes = [asyncio.run(_stop(place, who, reason)) for place, who in found]
    told = [
        {"folder": who.folder, "pid": who.pid, "stopped": not code} for code, (_, who) in zip(codes, found, strict=True)
    ]
    write_answer(json_file, FORMAT, {"exit_code": max(codes), "services": told})
    return max(codes)


def _places(rig: Path | None) -> list[Place]:
    if rig is not None:
        file = read_rig(rig, opened=False)
        return [place_of(file, embedded=embedded) for embedded in (False, True)]
    folder = runtime_folder()
    return [Place(folder, path.stem) for path in sorted(folder.glob("*.lock"))]


async def _stop(place: Place, who: Holder, reason: str) -> int:
    try:
        says = await within(LoopClock(), ANSWER_WITHIN, _press(place, reason))
    except (SetupError, ServiceGoneError, TimeoutError):
        os.kill(who.pid, signal.SIGTERM)
        console.err.print(
            f"Process {who.pid} (run {who.folder}) does not answer; it was told to end. "
            "PRESS THE HARDWARE EMERGENCY STOP if the robot moves.",
            markup=False,
        )
        return 3
    console.out.print(f"{who.folder}: {says}", markup=False)
    return 0


async def _press(place: Place, reason: str) -> str:
    async with connect(place.socket, name="fidim stop", samples=False) as service:
        return (await service.command(EmergencyStop(reason=reason))).says
