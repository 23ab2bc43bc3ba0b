"""The service: bus, guards, engine and recorder in one process, around one run; clients come and go.

`serve` is all of it. Nothing that a client does or leaves undone is waited for: commands are answered at once, states
are written to sockets that are never waited for, and a run needs no client but for prompts without a stated default.
"""

import asyncio
import secrets
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from drivers.canbus.load import frame_bits
from drivers.canbus.transport import CanFrame
from drivers.ports import Clock, PromptKind
from fidim_lab.app.service.board import DefaultAnswer, PromptBoard
from fidim_lab.app.service.chronicle import Chronicle
from fidim_lab.app.service.commands import Message, Request
from fidim_lab.app.service.desk import Desk, Levers
from fidim_lab.app.service.hub import Hub
from fidim_lab.app.service.latch import Latch
from fidim_lab.app.service.messages import Answer, Bye, Status, Welcome
from fidim_lab.app.service.opening import Opened
from fidim_lab.app.service.session import ServerSession
from fidim_lab.app.service.status import Gauges, Watcher
from fidim_lab.errors import FidimError
from procedures.control import Control
from procedures.events import Event, Prompted
from procedures.guards import Guard
from procedures.report import RunReport, WindowRow
from procedures.robot_guards import standard_guards
from procedures.run import Experiment
from procedures.teardown import quick_stop

TELL_PERIOD = 0.1
"""s between two states"""
GRACE = 0.3
"""s at the end for what was said to reach those who read"""
LONELY = 120.0
"""s after which a service that nobody has started, and at which nobody looks, ends"""
EXIT_UNUSED = 1

Carry = Callable[["Service"], Awaitable[RunReport]]
"""carries the run out with the service's rig, listeners and control"""


def wall_time() -> str:
    """The time of day, UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True)
class Identity:
    """What clients are told first."""

    folder: Path
    rig: str
    stay: bool = False


class BusCounter:
    """Frames and bits that passed; told by the bus's thread."""

    def __init__(self) -> None:
        self.frames = 0
        self.bits = 0.0

    def __call__(self, frame: CanFrame) -> None:
        """One frame."""
        self.frames += 1
        self.bits += frame_bits(len(frame.data))

    def counts(self) -> tuple[int, float]:
        """Both."""
        return self.frames, self.bits


class Service:
    """One rig, one run at a time. `serve` on the loop that the rig's drivers run on."""

    def __init__(
        self,
        experiment: Experiment,
        opened: Opened,
        identity: Identity,
        rows: Sequence[WindowRow],
        answers: Mapping[PromptKind, DefaultAnswer] | None = None,
    ) -> None:
        robot, settings = experiment.robot, experiment.settings
        factors = [winch.newton_per_ampere for winch in robot.winches or ()]
        names = [winch.name for winch in opened.rig.winches]
        self.clock: Clock = opened.rig.clock
        self.control = Control()
        self.experiment = experiment
        self.identity = identity
        self.hub = Hub(self._answer, self._greet, self._left)
        self.board = PromptBoard(self.clock, self.hub.tell, answers, opened.hand)
        self.rig = replace(opened.rig, operator=self.board)
        self.chronicle = Chronicle(self.clock.now, wall_time, self.hub.tell)
        self.watcher = Watcher(rows, robot.limits.tension)
        self._guards: tuple[Guard, ...] = standard_guards(names, factors, robot.limits.tension, settings.guard)
        counter = BusCounter()
        opened.tap(counter)
        self._gauges = Gauges(self.rig, robot, factors, settings.motion.length_limits, counter.counts, opened.bitrate)
        self._latch = Latch(self.clock.now)
        levers = Levers(self._start, self._shutdown, self._quick_stop, self.chronicle.note)
        self._desk = Desk(self.control, self.board, self._latch, levers)
        self._started = asyncio.Event()
        self._ending = asyncio.Event()
        self._running = False
        self._late = 0.0

    def listeners(self) -> tuple[Callable[[Event], None], ...]:
        """Whom a run has to tell."""
        return (self._hear, self.watcher, self.chronicle)

    def more_guards(self, guards: Sequence[Guard]) -> None:
        """Show these among the guards, too."""
        self._guards = (*self._guards, *guards)

    async def serve(self, carry: Carry) -> int:
        """Until the run has ended (or, if it is to stay, until it is shut down); returns the exit code."""
        helpers = [asyncio.ensure_future(work) for work in (self._tell_states(), self._follow_markers())]
        code = EXIT_UNUSED
        try:
            while await self._wait_for_start():
                report = await self._carry_out(carry)
                code = report.exit_code
                if not self.identity.stay:
                    break
        except BaseException:
            code = 3 if self.watcher.report is None else self.watcher.report.exit_code
            raise
        finally:
            self.hub.tell(self._status())
            self.hub.tell(Bye(says=self._last_words(), exit_code=code))
            for helper in helpers:
                helper.cancel()
            await asyncio.gather(*helpers, return_exceptions=True)
            self.hub.close()
            with suppress(asyncio.CancelledError):
                await self.clock.sleep(GRACE)
        return code

    async def _carry_out(self, carry: Carry) -> RunReport:
        self._running = True
        try:
            return await carry(self)
        finally:
            self._running = False
            self._started.clear()

    async def _wait_for_start(self) -> bool:
        """Whether a run is to begin; False when the service is to end."""
        since = self.clock.now()
        while not self._started.is_set():
            if self.hub.clients:
                since = self.clock.now()
            if self._ending.is_set() or self.clock.now() - since > LONELY:
                return False
            await self.clock.sleep(TELL_PERIOD / 2)
        return True

    def _last_words(self) -> str:
        report = self.watcher.report
        return "nothing was run" if report is None else f"run {report.outcome}: {report.reason} {report.held_says}"

    # what the desk can reach

    def _start(self) -> str:
        if self._running or self._started.is_set():
            return "the run has begun already"
        if self.watcher.report is not None:
            return "the run has ended; fidim resume goes on with what is left"
        self._started.set()
        return ""

    def _shutdown(self) -> str:
        if self._running:
            return "a run goes on; abort it first"
        self._ending.set()
        return ""

    def _quick_stop(self) -> None:
        for winch in self.rig.winches:
            quick_stop(winch)

    # what the hub asks

    def _answer(self, client: ServerSession, request: Request) -> Answer:
        return self._desk.answer(client, request)

    def _left(self, client: ServerSession) -> None:
        self._desk.left(client)

    def _greet(self, client: ServerSession) -> Sequence[Message]:
        welcome = Welcome(
            you=client.number,
            run=self.experiment.name,
            folder=str(self.identity.folder),
            rig=self.identity.rig,
            windows=tuple(self.experiment.roles),
            winches=tuple(winch.name for winch in self.rig.winches),
        )
        said: list[Message] = [welcome, self.chronicle.history, self._status()]
        if self.board.question is not None:
            said.append(self.board.question)
        return said

    # what is told

    def _hear(self, event: Event) -> None:
        if isinstance(event, Prompted):
            self.board.window = event.window

    async def _tell_states(self) -> None:
        """States and live samples, ten times a second."""
        due = self.clock.now()
        while True:
            due += TELL_PERIOD
            await self.clock.sleep(due - self.clock.now())
            late = self.clock.now() - due
            self._late = max(late, 0.9 * self._late)
            if late > TELL_PERIOD:
                due = self.clock.now()
            self.hub.tell(self._status())
            samples = self._gauges.samples(self.watcher.recording)
            if samples is not None:
                self.hub.tell(samples)

    async def _follow_markers(self) -> None:
        """Take every marker frame, beside the recorder."""
        while True:
            with suppress(FidimError):  # a silent stream says so; it may come back
                async for frame in self.rig.markers.frames():
                    self._gauges.frame(frame)
            await self.clock.sleep(TELL_PERIOD)

    def _status(self) -> Status:
        return Status(
            t=round(self.clock.now(), 4),
            wall=wall_time(),
            phase=self.watcher.phase,
            latched=self._latch.latched,
            latched_why=self._latch.why,
            commanding=self._desk.lease.holder,
            watching=self.hub.clients,
            step=self.watcher.step,
            winches=self._gauges.winches(),
            mocap=self._gauges.mocap(),
            bus=self._gauges.bus(),
            guards=self.watcher.guards(self._guards),
            equilibria=self.watcher.equilibria(),
            loop_late=round(max(self._late, 0.0), 4),
            prompt=None if self.board.question is None else self.board.question.number,
        )


def new_token(path: Path) -> str:
    """A token for clients on TCP, in a file that only the user can read."""
    token = secrets.token_urlsafe(24)
    path.unlink(missing_ok=True)
    path.touch(mode=0o600)
    path.write_text(token, encoding="ascii")
    return token
