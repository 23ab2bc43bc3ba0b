"""What commands do: who may give them, and what the answer is. Nothing here waits, nothing does I/O."""

from collections.abc import Callable
from dataclasses import dataclass

from fidim_lab.app.service.commands import (
    Abort,
    AnswerPrompt,
    EmergencyStop,
    Pause,
    ReleaseLease,
    Request,
    Reset,
    Resume,
    Retry,
    Shutdown,
    Skip,
    Start,
    TakeLease,
)
from fidim_lab.app.service.latch import AT_START, Latch, first_words
from fidim_lab.app.service.messages import Answer
from fidim_lab.app.service.process.board import PromptBoard
from fidim_lab.app.service.process.session import Lease, ServerSession
from fidim_lab.data.rigs.stop_file import Stopped
from procedures.control import Control, Verb, Word

FREE = (TakeLease, ReleaseLease, EmergencyStop, AnswerPrompt)
"""commands that need no lease"""


@dataclass(frozen=True)
class Levers:
    """What the command handler can reach of the service."""

    start: Callable[[], str]
    """begin the run; returns why not"""
    shutdown: Callable[[], str]
    """end the service; returns why not"""
    quick_stop: Callable[[], None]
    """of all winches, where no run goes on"""
    note: Callable[..., None]
    """for the event_log"""
    wall_time: Callable[[], str]
    """the time of day, ISO 8601"""


class CommandHandler:
    """Carries out requests. One for each service."""

    def __init__(self, control: Control, board: PromptBoard, latch: Latch, levers: Levers) -> None:
        self.lease = Lease()
        self.latch = latch
        self._control = control
        self._board = board
        self._levers = levers

    def answer(self, client: ServerSession, request: Request) -> Answer:
        """Do it, or say why not."""
        command = request.command
        if not isinstance(command, FREE) and self.lease.holder != client.number:
            who = "nobody" if self.lease.holder is None else self.lease.name
            return Answer(id=request.id, ok=False, says=f"Refused: {who} has the lease. Take the lease to command.")
        match command:
            case TakeLease():
                return self._take_lease(client, request.id, force=command.force)
            case ReleaseLease():
                self.lease.release(client.number)
                return Answer(id=request.id, ok=True)
            case EmergencyStop():
                return self._emergency_stop(client, request.id, command.reason)
            case Reset():
                return self._reset(client, request.id, command.code)
            case AnswerPrompt():
                return _said(request.id, self._board.give(command.prompt, command.choice, client.name))
            case Start() if self.latch.latched:
                return Answer(id=request.id, ok=False, says=f"The emergency stop is latched: {self.latch.why}.")
            case Start():
                return _said(request.id, self._levers.start())
            case Shutdown():
                return _said(request.id, self._levers.shutdown())
            case Pause() | Retry() | Skip() | Abort():
                return _said(request.id, self._control.say(Word(Verb(command.name), command.reason, client.name)))
            case Resume():
                return _said(request.id, self._control.say(Word(Verb.RESUME, by=client.name)))

    def left(self, client: ServerSession) -> None:
        """A client has gone: its lease is free, the run goes on."""
        if self.lease.holder == client.number:
            self.lease.release(client.number)
            self._levers.note(kind="lease", text=f"{client.name} has disconnected; no client has the lease")

    def _take_lease(self, client: ServerSession, number: int, *, force: bool) -> Answer:
        before = self.lease.holder
        if not self.lease.take(client.number, client.name, force=force):
            return Answer(id=number, ok=False, says=f"{self.lease.name} has the lease")
        if before != client.number:
            self._levers.note(kind="lease", text=f"{client.name} has the lease now")
        return Answer(id=number, ok=True)

    def _emergency_stop(self, client: ServerSession, number: int, reason: str) -> Answer:
        stopped = Stopped(client.name, reason, self._levers.wall_time())
        if not self._control.emergency_stop(stopped.sentence):
            self._levers.quick_stop()
        self.latch.latch(stopped)
        self._levers.note(kind="e-stop", text=stopped.sentence)
        return Answer(id=number, ok=True, says="All winches were quick-stopped. The stop is latched.")

    def _reset(self, client: ServerSession, number: int, code: str) -> Answer:
        if not self.latch.latched:
            return Answer(id=number, ok=True, says="Nothing is latched.")
        if not code:
            why = self.latch.why
            return Answer(id=number, ok=True, says=first_words(why), code=self.latch.first_step())
        what = "stop in which a service starts" if self.latch.why == AT_START else "emergency stop"
        if wrong := self.latch.second_step(code):
            return Answer(id=number, ok=False, says=wrong)
        self._levers.note(kind="reset", text=f"the {what} was reset by {client.name}")
        return Answer(id=number, ok=True, says="Reset.")


def _said(number: int, refusal: str) -> Answer:
    return Answer(id=number, ok=not refusal, says=refusal)
