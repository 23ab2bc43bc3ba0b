"""The terminal of `fidim run` as a client of the service: an example of one, in a hundred lines."""

import asyncio
import signal
from contextlib import suppress
from pathlib import Path

from drivers.ports import Prompt, PromptKind
from fidim_lab.app.service.client import ServiceClient, ServiceGoneError
from fidim_lab.app.service.commands import Abort, EmergencyStop, Message
from fidim_lab.app.service.messages import Happening, PromptClosed, Question
from fidim_lab.app.terminal import console
from fidim_lab.errors import HardwareError
from procedures.operators import ConsoleOperator

EXIT_INTERRUPTED = 130
STAYS = (
    "The service continues to run (--stay), and so does this terminal. In another terminal, fidim ui attaches to it "
    "and fidim shutdown ends it; then fidim power-off switches off the drives."
)


class Console:
    """The terminal as a client: says what happens, asks what is to be answered, aborts at Ctrl-C."""

    def __init__(self, service: ServiceClient, *, asks: bool, stays: bool = False) -> None:
        """asks: whether prompts are answered here; stays: the service goes on after its run."""
        self._service = service
        self._stays = stays
        self._operator = ConsoleOperator(self._show) if asks else None
        self._midline = False
        """the cursor stands behind an open question"""
        self._asking: dict[int, asyncio.Task[None]] = {}
        self._aborting: asyncio.Task[None] | None = None

    async def watch(self, folder: Path) -> int:
        """Until the service ends; returns the exit code, 130 after Ctrl-C. Raises HardwareError where it was killed."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._interrupt, signal.Signals(number).name)
        try:
            async for message in self._service:
                self._take(message)
        finally:
            for task in self._asking.values():
                task.cancel()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)
        bye = self._service.bye
        if bye is None:
            raise HardwareError(
                "The service has ended without a message: it was killed or has failed.",
                hint=f"Its drives stop by themselves when its heartbeat is missing. Then: fidim resume {folder}",
            )
        console.out.print(bye.says, markup=False)
        for line in whereabouts(folder):
            console.out.print(line, markup=False, soft_wrap=True)
        return EXIT_INTERRUPTED if self._aborting is not None else bye.exit_code

    def _take(self, message: Message) -> None:
        match message:
            case Happening(kind="prompt") if self._operator is not None:
                pass  # the question follows
            case Happening():
                if self._midline:
                    self._show("\n")
                _print(message)
                if message.kind == "run-finished" and self._stays:
                    console.err.print(STAYS, markup=False)
            case Question() if self._operator is not None:
                self._asking[message.number] = asyncio.ensure_future(self._ask(message, self._operator))
            case PromptClosed():
                if (task := self._asking.pop(message.number, None)) is not None:
                    task.cancel()
            case _:
                pass

    def _show(self, text: str) -> None:
        console.err.print(text, end="", markup=False)
        self._midline = not text.endswith("\n")

    async def _ask(self, question: Question, operator: ConsoleOperator) -> None:
        prompt = Prompt(PromptKind(question.kind), question.text, question.choices, question.displacement)
        choice = await operator.answer(prompt)
        self._midline = False
        self._asking.pop(question.number, None)  # its closing is our own doing
        with suppress(ServiceGoneError):
            await self._service.answer(question.number, choice)

    def _interrupt(self, name: str) -> None:
        if self._aborting is None:  # the order goes out first: Ctrl-C may have ended what this terminal writes to
            self._aborting = asyncio.ensure_future(self._abort(name))
            console.err.print("aborting: the robot is being held …", markup=False)

    async def _abort(self, name: str) -> None:
        with suppress(ServiceGoneError):
            answer = await self._service.command(Abort(reason=f"{name} at the console"))
            if not answer.ok:  # too early or too late for an abort: stop it all the same
                await self._service.command(EmergencyStop(reason=f"{name} at the console"))


def whereabouts(folder: Path) -> list[str]:
    """Where the run lies, and what reads its windows, where it has any."""
    recorded = any((folder / "windows").glob("*.csv"))
    return [f"run folder  {folder}", *([f"next        fidim identify {folder}"] if recorded else [])]


PLAIN = ("step-started", "step-finished", "window-finished")
"""happenings that their text alone tells"""


def _print(event: Happening) -> None:
    words = [event.text, event.outcome, "" if event.text.endswith(event.reason) else event.reason]
    if event.kind == "step-finished" and not event.reason:
        return
    if event.kind not in PLAIN and event.kind not in event.text:
        words = [event.kind.upper(), *words]
    says = "  ".join(word for word in words if word)
    console.err.print(f"{event.wall[11:19]}  {event.window:4} {says}", markup=False)
