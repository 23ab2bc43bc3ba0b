"""The service as a process of its own: start it, wait until it listens, end it.

It reads and checks everything itself and says what is wrong, so that whoever starts it needs neither model nor drivers.
What its client needs is imported while it starts: a robot waits.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from drivers.clock import LoopClock, within
from fidim_lab.app.formats.run_spec import RunSpec
from fidim_lab.app.service.lock import Holder, holder
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.errors import HardwareError, RefusedError, SetupError
from fidim_lab.say import printable

READY_WITHIN = 60.0
"""s for the service to open its rig"""
ANSWER_WITHIN = 2.0
"""s for it to answer that it is to end"""
ENDS_WITHIN = 10.0
"""s from the command to the end of the process"""
POLL = 0.05
"""s"""


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
            raise HardwareError(f"The service did not open its rig within {READY_WITHIN:g} s; see {place.log}.")
        await clock.sleep(POLL)


def _did_not_begin(place: ServicePlace, code: int) -> SetupError | HardwareError | RefusedError:
    """What the service said, as the error that has its exit code."""
    said = place.log.read_text(encoding="utf-8", errors="replace").strip().removeprefix("fidim: ")
    kinds = {kind.exit_code: kind for kind in (SetupError, RefusedError)}
    silent = f"The service ended with exit code {code} before it began."
    return kinds.get(code, HardwareError)(printable(said) or silent)


def serves(who: Holder, folder: Path) -> bool:
    """Whether the service is that of the run in this folder."""
    return Path(who.folder).resolve() == folder.resolve()


async def end_service(place: ServicePlace) -> str:
    """End a service and wait until its process has let the rig go; returns why not, empty where it has."""
    from fidim_lab.app.service.client import ServiceGoneError

    clock = LoopClock()
    with suppress(SetupError, ServiceGoneError, TimeoutError):  # its socket is closed: it is ending already
        if says := await within(clock, ANSWER_WITHIN, _refusal(place)):
            return f"it continues to run: {says}."
    end = clock.now() + ENDS_WITHIN
    while holder(place) is not None:
        if clock.now() > end:
            return f"it did not end within {ENDS_WITHIN:g} s; see {place.log}."
        await clock.sleep(POLL)
    return ""


async def _refusal(place: ServicePlace) -> str:
    from fidim_lab.app.service.client import connect
    from fidim_lab.app.service.commands import Shutdown

    async with connect(place.socket, name="fidim shutdown", samples=False) as service:
        await service.take_lease(force=True)
        answer = await service.command(Shutdown())
    return "" if answer.ok else answer.says
