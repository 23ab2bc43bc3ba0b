"""The service: bus, guards, engine and recorder in one process, around one run; clients come and go.

`serve` is all of it. Nothing that a client does or leaves undone is waited for: commands are answered at once, states
are written to sockets that are never waited for, and a run needs no client but for prompts without a stated default.
"""

import asyncio
import secrets
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path

from drivers.ports import Clock, PromptKind
from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import Request
from fidim_lab.app.service.latch import Latch
from fidim_lab.app.service.messages import Answer, Bye, Welcome
from fidim_lab.app.service.process.board import DefaultAnswer, PromptBoard
from fidim_lab.app.service.process.broadcast import StateBroadcast, StateSources, wall_time
from fidim_lab.app.service.process.command_handler import CommandHandler, Levers
from fidim_lab.app.service.process.event_log import EventLog
from fidim_lab.app.service.process.hub import Hub
from fidim_lab.app.service.process.opening import Opened
from fidim_lab.app.service.process.session import ServerSession
from fidim_lab.app.service.process.status import Gauges, Watcher
from fidim_lab.app.service.process.stop_keeper import StopKeeper
from fidim_lab.data.rigs.stop_file import Stopped
from fidim_lab.errors import FidimError, HardwareError
from procedures.control import Control
from procedures.events import Event, Prompted, RunFinished
from procedures.guards.robot_guards import standard_guards
from procedures.held_watch import watch_held, write_lost, write_moved
from procedures.recording.journal import NAME as JOURNAL
from procedures.report import RunReport, WindowRow
from procedures.run import Experiment
from procedures.stopping import quick_stop
from procedures.teardown import Held

LONELY = 120.0
"""s after which a service that nobody has started, and at which nobody looks, ends"""
LOOK = 0.05
"""s"""
GRACE = 0.3
"""s at the end for what was said to reach those who read"""
EXIT_UNUSED = 1
"""exit code: no run was started"""

Carry = Callable[["Service"], Awaitable[RunReport]]
"""carries the run out with the service's rig, listeners and control"""


@dataclass(frozen=True)
class Identity:
    """What clients are told first."""

    folder: Path
    rig: str
    stay: bool = False
    stopped: Path | None = None
    """the file that keeps its emergency stop; None: none is kept"""


class Service:
    """One rig, one run at a time. `serve` on the loop that the rig's drivers run on."""

    def __init__(
        self,
        experiment: Experiment,
        opened: Opened,
        identity: Identity,
        rows: Sequence[WindowRow],
        answers: Mapping[PromptKind, DefaultAnswer],
    ) -> None:
        robot, settings = experiment.robot, experiment.settings
        factors = [winch.newton_per_ampere for winch in robot.winches or ()]
        names = [winch.name for winch in opened.rig.winches]
        self.clock: Clock = opened.rig.clock
        self.control = Control(lambda: self._command_handler.latch.why)
        self.experiment = experiment
        self.identity = identity
        self.hub = Hub(self._answer, self._greet, self._left)
        self.board = PromptBoard(self.clock, self.hub.tell, answers, opened.hand)
        self.rig = replace(opened.rig, operator=self.board)
        self.event_log = EventLog(self.clock.now, wall_time, self.hub.tell)
        self.watcher = Watcher(rows, robot.limits.tension)
        gauges = Gauges(self.rig, robot, factors, settings.motion.length_limits, opened.bitrate)
        opened.tap(gauges.bus_frame)
        self._turn = Turn(self.clock)
        self._helpers: list[asyncio.Future[None]] = []
        self._after = ""
        """what moved after the run, in words"""
        self._lost: list[str] = []
        """what of the run's last sentence does not hold any more, in words"""
        levers = Levers(self._turn.start, self._turn.shutdown, self._quick_stop, self.event_log.note, wall_time)
        self._command_handler = CommandHandler(self.control, self.board, Latch(self.clock.now, self._keeper()), levers)
        guards = standard_guards(names, factors, robot.limits.tension, settings.guard)
        sources = StateSources(
            self.clock, self.rig.markers, gauges, self.watcher, self._command_handler, self.board, self.hub
        )
        self.broadcast = StateBroadcast(sources, guards)

    def listeners(self) -> tuple[Callable[[Event], None], ...]:
        """Whom a run has to tell."""
        return (self._hear, self.watcher, self.event_log)

    async def serve(self, carry: Carry) -> int:
        """Until the run has ended (or, if it is to stay, until it is shut down); returns the exit code."""
        helpers = self._helpers
        helpers += [asyncio.ensure_future(work) for work in (self.broadcast.tell(), self.broadcast.follow_markers())]
        code = EXIT_UNUSED
        try:
            while await self._turn.comes(lambda: self.hub.clients):
                report = await self._turn.take(carry(self))
                code = report.exit_code
                if not self.identity.stay:
                    break
        except BaseException:
            code = HardwareError.exit_code if self.watcher.report is None else self.watcher.report.exit_code
            raise
        finally:
            self.hub.tell(self.broadcast.status())
            code = HardwareError.exit_code if self._after else code  # a winch has moved after the run
            self.hub.tell(Bye(says=self._last_words(), exit_code=code))
            for helper in helpers:
                helper.cancel()
            await asyncio.gather(*helpers, return_exceptions=True)
            self.hub.close()
            with suppress(asyncio.CancelledError):
                await self.clock.sleep(GRACE)
        return code

    def _last_words(self) -> str:
        report = self.watcher.report
        if report is None:
            return "nothing was run"
        said = (f"run {report.outcome}: {report.reason}", report.held_says, *self._lost, self._after)
        return " ".join(filter(None, said))

    # what the command handler can reach

    def _quick_stop(self) -> None:
        for winch in self.rig.winches:
            quick_stop(winch)

    def _keeper(self) -> StopKeeper | None:
        path = self.identity.stopped
        if path is None:
            return None
        return StopKeeper(path, partial(asyncio.get_running_loop().call_soon_threadsafe, self.event_log.warn))

    # what the hub asks

    def _answer(self, client: ServerSession, request: Request) -> Answer:
        return self._command_handler.answer(client, request)

    def _left(self, client: ServerSession) -> None:
        self._command_handler.left(client)

    def _greet(self, client: ServerSession) -> Iterator[bytes]:
        """What a new client is told, as of now, line by line."""
        welcome = Welcome(
            you=client.number,
            run=self.experiment.name,
            folder=str(self.identity.folder),
            rig=self.identity.rig,
            windows=tuple(self.experiment.roles),
            winches=tuple(winch.name for winch in self.rig.winches),
        )
        question = self.board.question
        now = [self.broadcast.status(), *([] if question is None else [question])]
        return chain((encode(welcome),), self.event_log.history(), map(encode, now))

    # what is told

    def _hear(self, event: Event) -> None:
        if isinstance(event, Prompted):
            self.board.window = event.window
        if isinstance(event, RunFinished):
            stopped, settings = event.report.stopped, self.experiment.settings
            watching = watch_held(self.clock, self.rig.winches, stopped, settings, self._moved, self._loses)
            self._helpers.append(asyncio.ensure_future(watching))

    def _loses(self, says: str) -> None:
        """A winch has lost its power, or is not seen, after the run: no fault of it, but it is not held as was said."""
        self._lost.append(says)
        self.event_log.warn(says)
        with suppress(FidimError):  # a full disk: everybody has been told
            write_lost(self.identity.folder / JOURNAL, self.clock, wall_time, says)

    def _moved(self, says: str, held: Held) -> None:
        """A winch has moved after the run; it was stopped once more."""
        self._after = f"{says} {held.says}"
        self._command_handler.latch.latch(Stopped("the motion guard", self._after, wall_time()))
        self.event_log.note(kind="guard-tripped", text="motion", reason=self._after)
        with suppress(FidimError):  # a full disk: everybody has been told
            write_moved(self.identity.folder / JOURNAL, self.clock, wall_time, says, held)


def new_token(path: Path) -> str:
    """A token for clients on TCP, in a file that only the user can read."""
    token = secrets.token_urlsafe(24)
    path.unlink(missing_ok=True)
    path.touch(mode=0o600)
    path.write_text(token, encoding="ascii")
    return token


class Turn:
    """Whether the run is to begin, goes on, or has ended."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._started = asyncio.Event()
        self._ending = asyncio.Event()
        self._running = False
        self._ended = False

    def start(self) -> str:
        """Begin; returns why not, empty where it does."""
        if self._running or self._started.is_set():
            return "the run has begun already"
        if self._ended:
            return "the run has ended; fidim resume continues it"
        self._started.set()
        return ""

    def shutdown(self) -> str:
        """End the service; returns why not."""
        if self._running:
            return "a run is in progress; abort it first"
        self._ending.set()
        return ""

    async def comes(self, clients: Callable[[], int]) -> bool:
        """Wait; True when a run is to begin, False when the service is to end. clients: how many are connected."""
        since = self._clock.now()
        while not self._started.is_set():
            if clients():
                since = self._clock.now()
            if self._ending.is_set() or self._clock.now() - since > LONELY:
                return False
            await self._clock.sleep(LOOK)
        return True

    async def take(self, run: Awaitable[RunReport]) -> RunReport:
        """Carry it out."""
        self._running = True
        try:
            return await run
        finally:
            self._running, self._ended = False, True
            self._started.clear()
