"""What has happened, as numbered messages: for clients that listen and for those that come late.

A listener of the run: quick, and it never raises for what it is told.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from fidim_lab.app.service.messages import Happening
from procedures.events import (
    Event,
    Paused,
    Prompted,
    Resumed,
    RunFinished,
    RunStarted,
    StepFinished,
    StepStarted,
    Tripped,
    Warned,
    WindowFinished,
)
from procedures.protocols.listing import duration
from procedures.recording.journal import WallTime

CAPACITY = 2000
"""events kept for late clients; older ones are in the journal"""
ROOM = 600_000
"""bytes of them as they are kept"""
PIECE = 32_000
"""bytes of a piece of history: written in well under a millisecond"""


class EventLog:
    """Keeps the newest events and tells each to a listener as it comes.

    They are kept as the bytes of their JSON, a quarter of what they are as objects: a service lives for days. As such
    they are sent, too: nothing is encoded for a client that comes.
    """

    def __init__(self, now: Callable[[], float], wall_time: WallTime, tell: Callable[[Happening], None]) -> None:
        self._now = now
        self._wall_time = wall_time
        self._tell = tell
        self._events: deque[bytes] = deque()
        self._size = 0
        self._number = 0

    def __call__(self, event: Event) -> None:
        """Take one event of the run; progress is the state stream's matter."""
        fields = _fields(event)
        if fields is not None:
            self.note(**fields)

    def note(self, **fields: Any) -> None:
        """Take something that happened beside the run (fields as in `Happening`)."""
        self._number += 1
        happening = Happening(number=self._number, t=round(self._now(), 4), wall=self._wall_time(), **fields)
        self._keep(happening.model_dump_json(exclude_defaults=True).encode())
        self._tell(happening)

    def warn(self, says: str) -> None:
        """Take a warning that no guard gives."""
        self.note(kind="guard-warned", reason=says)

    def _keep(self, event: bytes) -> None:
        self._events.append(event)
        self._size += len(event)
        while len(self._events) > CAPACITY or self._size > ROOM:
            self._size -= len(self._events.popleft())

    def history(self) -> Iterator[bytes]:
        """Lines of `History` for a client that comes late: what there is now, in pieces, each joined when it is due."""
        return _pieces(tuple(self._events), self._number - len(self._events))


def _pieces(events: Sequence[bytes], forgotten: int) -> Iterator[bytes]:
    begin = 0
    while True:
        end, size = begin, 0
        while end < len(events) and size < PIECE:
            size += len(events[end])
            end += 1
        more = b"true" if end < len(events) else b"false"
        told = b",".join(events[begin:end])
        yield b'{"type":"history","events":[%s],"forgotten":%d,"more":%s}\n' % (told, forgotten, more)
        if end == len(events):
            return
        begin = end


def _fields(event: Event) -> dict[str, Any] | None:
    match event:
        case RunStarted():
            return {"kind": "run-started", "text": f"{event.name}: {duration(*event.between)}"}
        case StepStarted(step=step):
            return {"kind": "step-started", "window": step.window, "step": type(step).__name__, "text": step.text}
        case StepFinished(step=step, result=result):
            return {
                "kind": "step-finished",
                "window": step.window,
                "step": type(step).__name__,
                "text": step.text,
                "outcome": result.outcome.value,
                "reason": result.reason,
                "values": result.values,
            }
        case WindowFinished():
            return {
                "kind": "window-finished",
                "window": event.window,
                "outcome": event.outcome.value,
                "reason": event.reason,
            }
        case Prompted():
            return {"kind": "prompt", "window": event.window, "text": event.prompt.text}
        case Tripped(trip=trip):
            return {"kind": "guard-tripped", "text": trip.guard, "reason": trip.says}
        case Warned(trip=trip):
            return {"kind": "guard-warned", "text": trip.guard, "reason": trip.says}
        case Paused() | Resumed():
            kind = "paused" if isinstance(event, Paused) else "resumed"
            return {"kind": kind, "window": event.window, "reason": event.says}
        case RunFinished(report=report):
            reason = f"{report.reason} {report.held_says}".strip()
            return {"kind": "run-finished", "outcome": report.outcome.value, "reason": reason}
        case _:
            return None
