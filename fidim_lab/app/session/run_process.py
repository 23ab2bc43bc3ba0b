"""The service as a process of its own: start it, wait until it listens, watch its run from this terminal.

It reads and checks everything itself and says what is wrong, so that whoever starts it needs neither model nor drivers.
What its client needs is imported while it starts: a robot waits.
"""

import asyncio
import os
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress

from drivers.clock import LoopClock
from fidim_lab.app.service.latch import AT_START
from fidim_lab.app.service.lock import holder, in_use
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.service.spec import HOOK_TIMEOUT, RunSpec
from fidim_lab.app.terminal import console
from fidim_lab.errors import HardwareError, RefusedError, SetupError
from fidim_lab.say import printable

READY_WITHIN = 60.0
"""s for the service to open its rig"""
LEAVES_WITHIN = 10.0
"""s for it to end after its run"""
POLL = 0.05
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


@contextmanager
def service_process(spec: RunSpec, place: ServicePlace) -> Generator["subprocess.Popen[bytes]"]:
    """The service's process, in a session of its own: signals of this terminal do not reach it."""
    with tempfile.NamedTemporaryFile("w", suffix=".json", dir=place.folder, encoding="utf-8") as file:
        file.write(spec.model_dump_json())
        file.flush()
        with place.log.open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "fidim_lab.app.service.main", file.name],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
        yield process


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


async def until_it_listens(place: ServicePlace, process: "subprocess.Popen[bytes]") -> None:
    """Wait for the service. Raises what it said where it has ended, HardwareError where it takes too long."""
    from fidim_lab.app.service.client import connect

    clock = LoopClock()
    begin = clock.now()
    while True:
        if process.poll() is not None:
            raise _did_not_begin(place, process.returncode)
        known = holder(place)
        if known is not None and known.pid == process.pid and place.socket.exists():
            with suppress(SetupError):
                async with connect(place.socket, name="fidim run looks", samples=False):
                    return
        if clock.now() - begin > READY_WITHIN:
            process.terminate()
            raise HardwareError(f"The service has not opened its rig within {READY_WITHIN:g} s; see {place.log}.")
        await clock.sleep(POLL)


def _did_not_begin(place: ServicePlace, code: int) -> SetupError | HardwareError | RefusedError:
    """What the service said, as the error that has its exit code."""
    said = place.log.read_text(encoding="utf-8", errors="replace").strip().removeprefix("fidim: ")
    kinds = {kind.exit_code: kind for kind in (SetupError, RefusedError)}
    silent = f"The service ended with exit code {code} before it began."
    return kinds.get(code, HardwareError)(printable(said) or silent)
