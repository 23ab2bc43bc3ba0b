"""A run in a service of its own, watched from this terminal.

What the client needs is imported while the service starts: a robot waits.
"""

import asyncio
import subprocess
from contextlib import suppress

from fidim_lab.app.formats.run_spec import HOOK_TIMEOUT, RunSpec
from fidim_lab.app.service.latch import AT_START
from fidim_lab.app.service.lock import holder, in_use
from fidim_lab.app.service.own_process import service_process, until_it_listens
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.terminal import console
from fidim_lab.errors import SetupError
from fidim_lab.say import printable

LEAVES_WITHIN = 10.0
"""s for it to end after its run"""
SAYS = "fidim: "


def start_and_watch(spec: RunSpec, place: ServicePlace, confirmed: str = "") -> int:
    """Start the service's process, begin the run, show it until it ends; returns its exit code.

    confirmed: the emergency stop that a person has said is to be undone (`undo_stop`); another one stays.
    Raises SetupError where another service has the rig, and whatever ended the service before it began.
    """
    if (other := holder(place)) is not None:
        raise SetupError(in_use(other))
    with service_process(spec, place) as process:
        code = asyncio.run(_watch(spec, place, process, confirmed or AT_START))
        hook = bool(spec.on_finish or spec.on_fault)
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=LEAVES_WITHIN + (HOOK_TIMEOUT if hook and not spec.stay else 0.0))
            console.warn(said_at_end(place))
        return code


def said_at_end(place: ServicePlace) -> list[str]:
    """What the service has left to say when the run is over: a hook that failed."""
    with suppress(OSError):
        lines = place.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return [printable(line.removeprefix(SAYS)) for line in lines if line.startswith(SAYS)]
    return []


async def _watch(spec: RunSpec, place: ServicePlace, process: "subprocess.Popen[bytes]", known: str) -> int:
    from fidim_lab.app.service.client import connect
    from fidim_lab.app.service.commands import Start
    from fidim_lab.app.session.run_console import Console

    await until_it_listens(place, process)
    async with connect(place.socket, name="fidim run", samples=False) as service:
        await service.take_lease()
        await service.reset(known)
        await service.require(Start())
        return await Console(service, asks=not spec.alone, stays=spec.stay).watch(spec.out)
