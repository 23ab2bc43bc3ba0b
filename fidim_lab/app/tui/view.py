"""What is known of the service, and how old that is. Pure: messages and times in, a frozen `ScreenState` out.

`Tracker` takes what the link hears; screens draw `ScreenState`s and know nothing of sockets.
"""

from collections import deque
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

from fidim_lab.app.service.commands import Message
from fidim_lab.app.service.messages import (
    Bye,
    Happening,
    History,
    PromptClosed,
    Question,
    Samples,
    Status,
    Welcome,
)

STALE = 1.0
"""s without a state after which what is shown is called old; the service tells ten a second"""
EVENTS = 3000
SAMPLES = 30_000
REMEMBERED = 1200
"""states: two minutes of them, for curves of what has just been"""

Position = tuple[float, float, float]


class Connection(Enum):
    """The connection to the service."""

    SEEKING = "looking for a service"
    LIVE = "live"
    SILENT = "silent"
    """connected, but no state has come for a while"""
    LOST = "lost"
    ENDED = "ended"
    """it said goodbye"""


@dataclass(frozen=True, eq=False)
class Trace:
    """One recording as it grows: only appended to, so that a view may share it."""

    window: str = ""
    attempt: int = 0
    t: list[float] = field(default_factory=list[float])
    """s, the service's clock"""
    positions: list[Position | None] = field(default_factory=list[Position | None])
    lengths: list[tuple[float | None, ...]] = field(default_factory=list[tuple[float | None, ...]])


@dataclass(frozen=True, eq=False)
class ScreenState:
    """Everything that a screen may show."""

    now: float = 0.0
    """s, this process's monotonic clock"""
    contact: Connection = Connection.SEEKING
    why: str = ""
    """of a lost or ended service"""
    welcome: Welcome | None = None
    status: Status | None = None
    age: float | None = None
    """s since the newest state came; None: none ever did"""
    question: Question | None = None
    asked: float = 0.0
    """when it came, this process's clock"""
    rest: Position | None = None
    """main marker when the prompt came, m; None where nobody here saw it come"""
    events: tuple[Happening, ...] = ()
    forgotten: int = 0
    trace: Trace = Trace()
    recording: bool = False
    offer: Welcome | None = None
    """another rig's service, which a person may change to"""
    states: tuple[Status, ...] = ()
    """the newest ones, oldest first"""

    @property
    def fresh(self) -> bool:
        """Whether what is shown is what is."""
        return self.contact is Connection.LIVE and self.status is not None

    @property
    def displaced(self) -> Position | None:
        """By how much the main marker is off the place where it was when the prompt came, m."""
        if self.rest is None or self.status is None or self.status.mocap.position is None:
            return None
        (x, y, z), (x0, y0, z0) = self.status.mocap.position, self.rest
        return x - x0, y - y0, z - z0

    @property
    def commander(self) -> str:
        """Who has the lease, as people know it; empty where nobody has."""
        if self.status is None or self.status.commanding is None:
            return ""
        return self.status.commander or f"client #{self.status.commanding}"

    @property
    def commands(self) -> bool:
        """Whether this client has the lease."""
        return self.welcome is not None and self.status is not None and self.status.commanding == self.welcome.you


class Tracker:
    """Keeps what the link hears."""

    def __init__(self) -> None:
        self._known = ScreenState()
        """all but what `view` adds"""
        self._status_at: float | None = None
        self._greeted = 0.0
        self._states: deque[Status] = deque(maxlen=REMEMBERED)
        self._events: deque[Happening] = deque(maxlen=EVENTS)
        self._shown: tuple[Happening, ...] | None = ()

    def take(self, message: Message, now: float) -> None:
        """Take one message at this process's time."""
        question = self._known.question
        match message:
            case Welcome():
                self._begin(message, now)
            case Status():
                self._know(status=message, question=None if message.prompt is None else question)
                self._status_at = now
                self._states.append(message)
            case History():
                self._events.extend(message.events)  # one of several pieces; `_begin` has emptied it
                self._shown = None
                self._know(forgotten=message.forgotten)
            case Happening():
                self._events.append(message)
                self._shown = None
            case Question():
                if question is None or question.number != message.number:
                    seen = None if self._known.status is None else self._known.status.mocap.position
                    rest = seen if now - self._greeted > STALE else None
                    self._know(question=message, asked=now, rest=rest)
            case PromptClosed():
                if question is not None and question.number == message.number:
                    self._know(question=None)
            case Samples():
                self._sampled(message)
            case Bye():
                self._know(contact=Connection.ENDED, why=message.says)
            case _:
                pass

    def lose(self, why: str) -> None:
        """The connection is gone; a service that said goodbye has ended, not failed."""
        self._know(question=None, recording=False)
        if self._known.contact is not Connection.ENDED:
            self._know(contact=Connection.SEEKING if self._known.status is None else Connection.LOST, why=why)

    def offer(self, welcome: Welcome | None) -> None:
        """Another rig has a service while this one has none; or no longer."""
        self._know(offer=welcome)

    def view(self, now: float) -> ScreenState:
        """What is known now."""
        if self._shown is None:
            self._shown = tuple(self._events)
        age = None if self._status_at is None else max(now - self._status_at, 0.0)
        contact = self._known.contact
        if contact is Connection.LIVE and age is not None and age > STALE:
            contact = Connection.SILENT
        return replace(self._known, now=now, contact=contact, age=age, events=self._shown, states=tuple(self._states))

    def _know(self, **news: Any) -> None:
        self._known = replace(self._known, **news)

    def _begin(self, welcome: Welcome, now: float) -> None:
        """A connection: what an earlier service said of another run is not shown as this one's."""
        before = self._known.welcome
        if before is not None and before.folder != welcome.folder:
            self._know(trace=Trace())
        self._know(welcome=welcome, contact=Connection.LIVE, why="", status=None, question=None)
        self._greeted, self._status_at = now, None
        self._events.clear()
        self._states.clear()  # a new service's clock begins anew

    def _sampled(self, samples: Samples) -> None:
        self._know(recording=bool(samples.window))
        if not samples.window:
            return
        trace = self._known.trace
        clock_went_back = bool(trace.t) and samples.t and samples.t[0] < trace.t[-1]
        if (trace.window, trace.attempt) != (samples.window, samples.attempt) or clock_went_back:
            trace = Trace(samples.window, samples.attempt)
            self._know(trace=trace)
        if len(trace.t) < SAMPLES:
            trace.t.extend(samples.t)
            trace.positions.extend(samples.positions)
            trace.lengths.extend(samples.lengths)
