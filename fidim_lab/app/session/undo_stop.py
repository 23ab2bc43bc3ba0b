"""Undoing an emergency stop from a terminal: two questions, each answered by a whole word; and `fidim reset`.

`fidim run` and `fidim resume` ask the same before a rig that was stopped moves again. Nothing else undoes a stop.
"""

import asyncio
import os
import shlex
import termios
from contextlib import suppress
from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.run_spec import RunSpec, again, read_spec
from fidim_lab.app.service.client import connect
from fidim_lab.app.service.kept_stop import forget, kept
from fidim_lab.app.service.lock import holder
from fidim_lab.app.service.place import ServicePlace, place_of
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.rigs.stop_file import stop_path
from fidim_lab.errors import RefusedError, SetupError

QUESTIONS = (
    "1 of 2: has the cause been removed?",
    "2 of 2: is nobody near the platform and the cables?",
)
FORMAT = "fidim-reset/1"
YES = "yes"
ENDING, AGAIN = 5.0, 0.1
"""s, within which a service that answers no more has ended (it gives its drives two), and between looks at it"""


def confirmed(spec: RunSpec, *, asks: bool = True) -> str:
    """Ask a person whether the stop of a rig is to be undone; returns its sentence, empty where nothing is stopped.

    asks: False where nobody is there. Raises RefusedError where the answer is not twice yes; nothing is undone yet.
    """
    found = kept(spec.stopped)
    if found is None:
        return ""
    if not asks:
        raise RefusedError(
            f"The emergency stop is latched: {found.sentence}. An unattended run cannot reset it.",
            hint=f"Look at the robot, then: fidim reset --rig {shlex.quote(str(spec.rig))}",
        )
    ask(found.sentence)
    return found.sentence


def ask(sentence: str) -> None:
    """Both questions. Raises RefusedError unless both are answered by yes."""
    console.err.print(f"EMERGENCY STOP LATCHED: {sentence}.", markup=False)
    if not all(map(says_yes, QUESTIONS)):
        raise RefusedError("The emergency stop stays latched; nothing moves.")


def says_yes(question: str) -> bool:
    """Whether a person types the whole word; the end of the input is no."""
    console.err.print(f'{question} (type "{YES}") ', end="", markup=False, soft_wrap=True)
    return _typed().strip().lower() == YES


def stop_hint(spec: RunSpec) -> tuple[str, ...]:
    """What to type after a run that an emergency stop has ended; nothing after another."""
    found = kept(spec.stopped)
    if found is None:
        return ()
    return (
        f"The emergency stop is latched: {found.sentence}.",
        "When its cause has been removed and nobody is near the cables (it asks for both):",
        f"    fidim resume {shlex.quote(str(spec.out))}",
    )


def _typed(descriptor: int = 0) -> str:
    """A line typed after the question, byte by byte, so that what follows is left for whoever asks next."""
    if os.isatty(descriptor):
        with suppress(termios.error):
            termios.tcflush(descriptor, termios.TCIFLUSH)
    said = b""
    with suppress(OSError):
        while (byte := os.read(descriptor, 1)) not in (b"", b"\n"):
            said += byte
    if not os.isatty(descriptor):
        console.err.print()  # as a terminal shows what is typed
    return said.decode(errors="replace")


def reset_command(folder: Path | None, rig: Path | None, json_file: Path | None = None) -> int:
    """Undo the stop of a rig, or of a run's rig, in the service where one runs; returns 0.

    Raises RefusedError where a person does not say yes twice, SetupError for neither or both given.
    """
    undone = ""
    for place, stopped in _rigs(folder, rig):
        undone = asyncio.run(_reset(place, stopped))
        if undone:
            break
    console.out.print("The emergency stop is reset." if undone else "No emergency stop is latched.", markup=False)
    write_answer(json_file, FORMAT, {"exit_code": 0, "undone": undone})
    return 0


async def _reset(place: ServicePlace, stopped: Path) -> str:
    """In the service, or in its file where none runs. One that is just ending is waited for."""
    clock = LoopClock()
    until = clock.now() + ENDING
    while holder(place) is not None:
        try:
            return await _reset_service(place)
        except SetupError:
            if clock.now() > until:
                raise
        await clock.sleep(AGAIN)
    return _reset_file(stopped)


def _rigs(folder: Path | None, rig: Path | None) -> list[tuple[ServicePlace, Path]]:
    """Where a service would be, and where its stop is kept."""
    if (folder is None) == (rig is None):
        raise SetupError("Give either a run folder or --rig.")
    if folder is not None:
        spec = again(read_spec(folder), folder.absolute())
        file = read_rig(spec.rig, opened=False)
        return [(place_of(file, embedded=spec.embedded, run=spec.own_place), spec.stopped)]
    file = read_rig(rig or Path(), opened=False)
    both = (False, True)
    return [(place_of(file, embedded=e), stop_path(file.path, embedded=e)) for e in both]


async def _reset_service(place: ServicePlace) -> str:
    async with connect(place.socket, name="fidim reset", samples=False) as service:
        status = await service.state()
        if not status.latched:
            return ""
        ask(status.latched_why)
        await service.take_lease(force=True)
        await service.reset(status.latched_why)
        return status.latched_why


def _reset_file(stopped: Path) -> str:
    found = kept(stopped)
    if found is None:
        return ""
    ask(found.sentence)
    forget(stopped)
    return found.sentence
