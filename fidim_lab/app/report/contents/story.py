"""The journal as the report tells it: attempts and verdict of each window, what was done when, what went amiss.

`read_story` reads a journal file; everything it returns is frozen and in the run's own time, from 0 at its begin.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from fidim_lab.app.report.drawings.figures import Bout
from fidim_lab.data.files.mistakes import first_mistake
from fidim_lab.errors import FileError
from procedures.outcomes import Outcome
from procedures.recording.journal import Entry, LineKind, read_journal

KINDS = {
    "MoveTo": "moving",
    "Settle": "settling",
    "Hold": "checks",
    "ReadEncoders": "checks",
    "CheckTension": "checks",
    "Ask": "hand",
    "AwaitHandsOff": "hand",
    "Record": "recording",
}
"""what a step is shown as, by its type; the steps that take no time are missing"""


@dataclass(frozen=True)
class ToldMeasurement:
    """One measurement with what was allowed."""

    __pydantic_config__ = ConfigDict(extra="forbid")  # pyright: ignore[reportUnannotatedClassAttribute]

    name: str
    outcome: Outcome
    value: float | None = None
    unit: str = ""
    low: float | None = None
    high: float | None = None


_SEEN: TypeAdapter[tuple[ToldMeasurement, ...]] = TypeAdapter(tuple[ToldMeasurement, ...])


@dataclass(frozen=True)
class Attempt:
    """One try at recording a window, from waiting for the hand to leave."""

    number: int
    begin: float
    """s"""
    recorded: bool = False
    outcome: Outcome = Outcome.UNSET
    """UNSET: broken off"""
    reason: str = ""
    measurements: tuple[ToldMeasurement, ...] = ()


@dataclass(frozen=True)
class WindowStory:
    """What happened to one planned window."""

    id: str
    outcome: Outcome = Outcome.UNSET
    """UNSET: never decided"""
    reason: str = ""
    attempts: tuple[Attempt, ...] = ()
    tensions: tuple[float, ...] = ()
    """N at rest, from motor currents"""


@dataclass(frozen=True)
class TriedStop:
    """One trial of one winch's stop."""

    window: str
    """the winch's name"""
    trial: str
    speed: float
    """m/s"""
    outcome: Outcome
    reason: str
    measurements: tuple[ToldMeasurement, ...]
    """time (s) and way (m) to standstill, and what it moved afterwards"""


@dataclass(frozen=True)
class Incident:
    """Something that a reader of the run should know."""

    t: float
    window: str
    what: str
    outcome: Outcome
    reason: str


@dataclass(frozen=True)
class Story:
    """One run."""

    began: str
    ended: str
    """wall time of the first and last line, ISO 8601"""
    seconds: float
    outcome: Outcome
    """UNSET: the journal ends without the run's end"""
    reason: str
    held: str
    """how the robot was left; empty where the journal does not say"""
    windows: tuple[WindowStory, ...]
    bouts: tuple[Bout, ...]
    incidents: tuple[Incident, ...]
    trials: tuple[TriedStop, ...] = ()
    """of stops, as they were made"""

    def of(self, window: str) -> WindowStory | None:
        """The story of one window; None where it was not planned."""
        return next((story for story in self.windows if story.id == window), None)

    @property
    def recordings(self) -> int:
        """How many recordings were made, rejected ones included."""
        return sum(attempt.recorded for window in self.windows for attempt in window.attempts)


def read_story(path: Path) -> Story | None:
    """The story of a journal; None where it has no line yet. Raises FileError naming the line that is wrong."""
    entries = read_journal(path)
    if not entries:
        return None
    reader = _Reader(path)
    for entry, t in zip(entries, _times(entries), strict=True):
        reader.take(entry, t)
    return reader.story(entries)


def _times(entries: Sequence[Entry]) -> list[float]:
    """Seconds from the first line; a journal that was resumed after a reboot counts on from its last line."""
    times: list[float] = []
    shift = -entries[0].t
    for entry in entries:
        if times and (entry.t + shift < times[-1] or entry.kind in (LineKind.RUN_STARTED, LineKind.CONTINUED)):
            shift = times[-1] - entry.t
        times.append(entry.t + shift)
    return times


@dataclass
class _Reader:
    """Goes through the lines once."""

    path: Path
    windows: dict[str, WindowStory] = field(default_factory=dict[str, WindowStory])
    bouts: list[Bout] = field(default_factory=list[Bout])
    incidents: list[Incident] = field(default_factory=list[Incident])
    trials: list[TriedStop] = field(default_factory=list[TriedStop])
    begun: tuple[Entry, float] | None = None
    """the step at hand and when it began"""
    held: str = ""
    end: Entry | None = None
    last: float = 0.0

    def take(self, entry: Entry, t: float) -> None:
        """One line."""
        self.last = t
        match entry.kind:
            case LineKind.RUN_STARTED | LineKind.CONTINUED:
                planned = entry.data.get("windows", ())
                self.windows |= {str(id_): WindowStory(str(id_)) for id_ in planned if str(id_) not in self.windows}
                self.end, self.begun = None, None
            case LineKind.STEP_STARTED:
                self.begun = (entry, t)
            case LineKind.STEP_FINISHED:
                if entry.step == "ProveStop" and self.begun is not None:
                    self.trials.append(self._tried_stop(self.begun[0], entry))
                self._close(t)
                self._finished(entry, t)
            case LineKind.TRIPPED | LineKind.HELD:
                self._close(t)
                if entry.kind is LineKind.HELD:
                    self.held = entry.reason
                if not entry.outcome.usable:
                    what = "guard" if entry.kind is LineKind.TRIPPED else "held"
                    self.incidents.append(Incident(t, entry.window, what, entry.outcome, entry.reason))
            case LineKind.WARNED:
                self.incidents.append(Incident(t, entry.window, "guard warned", Outcome.MARGINAL, entry.reason))
            case LineKind.PAUSED | LineKind.RESUMED:
                self.incidents.append(Incident(t, entry.window, entry.kind.value, Outcome.MARGINAL, entry.reason))
            case LineKind.RUN_FINISHED:
                self.end = entry

    def story(self, entries: Sequence[Entry]) -> Story:
        """What came of it."""
        self._close(self.last)
        end = self.end
        return Story(
            began=entries[0].wall,
            ended=entries[-1].wall,
            seconds=self.last,
            outcome=Outcome.UNSET if end is None else end.outcome,
            reason="The journal ends in the middle of the run." if end is None else end.reason,
            held=self.held,
            windows=tuple(self.windows.values()),
            bouts=tuple(self.bouts),
            incidents=tuple(self.incidents),
            trials=tuple(self.trials),
        )

    def _tried_stop(self, begun: Entry, entry: Entry) -> TriedStop:
        trial, speed = str(begun.data.get("trial", "")), float(begun.data.get("speed", 0.0))
        return TriedStop(entry.window, trial, speed, entry.outcome, entry.reason, self._seen(entry))

    def _close(self, t: float) -> None:
        """The step at hand ends here, however."""
        if self.begun is None:
            return
        entry, begin = self.begun
        kind = KINDS.get(entry.step)
        if kind is not None and entry.window and t > begin:
            self.bouts.append(Bout(entry.window, kind, begin, t))
        self.begun = None

    def _finished(self, entry: Entry, t: float) -> None:
        if not entry.outcome.usable and entry.step != "CheckWindow":  # its Reject says the same
            self.incidents.append(
                Incident(t, entry.window, KINDS.get(entry.step, entry.step), entry.outcome, entry.reason)
            )
        window = self.windows.get(entry.window)
        if window is not None:
            self.windows[window.id] = self._told(window, entry, t)

    def _told(self, window: WindowStory, entry: Entry, t: float) -> WindowStory:
        match entry.step:
            case "AwaitHandsOff":
                begun = Attempt(len(window.attempts) + 1, t, outcome=_failed(entry), reason=entry.reason)
                return replace(window, attempts=(*window.attempts, begun))
            case "Record" | "CheckWindow" | "Reject" | "Accept" if window.attempts:
                *before, attempt = window.attempts
                window = replace(window, attempts=(*before, self._tried(attempt, entry)))
                return replace(window, outcome=entry.outcome) if entry.step == "Accept" else window
            case "GiveUp":
                return replace(window, outcome=entry.outcome, reason=entry.reason)
            case "CheckTension":
                return replace(window, tensions=tuple(float(v) for v in entry.data.get("values", ())))
            case _:
                return window

    def _tried(self, attempt: Attempt, entry: Entry) -> Attempt:
        match entry.step:
            case "Record":
                return replace(attempt, recorded=True, reason=entry.reason)
            case "CheckWindow":
                return replace(attempt, measurements=self._seen(entry))
            case _:
                reasons = dict.fromkeys(reason for reason in (attempt.reason, entry.reason) if reason)
                return replace(attempt, outcome=entry.outcome, reason="; ".join(reasons))

    def _seen(self, entry: Entry) -> tuple[ToldMeasurement, ...]:
        found: Any = entry.data.get("measurements", ())
        try:
            return _SEEN.validate_python(found)
        except ValidationError as error:
            place, problem = first_mistake(error.errors(include_url=False), found)
            where = ", ".join(filter(None, (f"entry {entry.number}", "measurements", place)))
            raise FileError(self.path, where, problem) from None


def _failed(entry: Entry) -> Outcome:
    """Hands that never left end the attempt; hands that did leave it open."""
    return Outcome.UNSET if entry.outcome.usable else entry.outcome


def not_passed(measurements: Iterable[ToldMeasurement]) -> tuple[ToldMeasurement, ...]:
    """Those that a reader should look at."""
    return tuple(seen for seen in measurements if seen.outcome is not Outcome.PASS)
