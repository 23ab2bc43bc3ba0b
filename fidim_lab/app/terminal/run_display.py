"""Progress of a run: a live table on a terminal, plain lines elsewhere. Listeners, which cannot disturb a run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from procedures.events import (
    Event,
    Prompted,
    RunFinished,
    RunStarted,
    StepFinished,
    StepProgress,
    StepStarted,
    Tripped,
    WindowFinished,
)
from procedures.outcomes import Outcome
from procedures.protocols.listing import clock, duration
from procedures.steps import (
    Ask,
    AwaitHandsOff,
    CheckTension,
    CheckWindow,
    Enable,
    Hold,
    MoveTo,
    ReadEncoders,
    Record,
    Settle,
    Step,
)

NAMES: dict[type[Step], str] = {
    Enable: "preparing",
    MoveTo: "moving",
    Settle: "settling",
    Hold: "holding",
    ReadEncoders: "encoders",
    CheckTension: "tensions",
    Ask: "prompt",
    AwaitHandsOff: "hands off",
    Record: "recording",
    CheckWindow: "checking",
}
BAR = 10
VERDICTS = {
    Outcome.PASS: "✓ pass",
    Outcome.MARGINAL: "~ marginal",
    Outcome.FAIL: "✗ fail",
    Outcome.SKIPPED: "- skipped",
}


@dataclass(frozen=True)
class _Line:
    """What is known of one window."""

    doing: str = ""
    fraction: float = 0.0
    tension: str = ""
    recordings: int = 0
    verdict: str = ""


class LiveDisplay:
    """One row a window, redrawn ten times a second; use as a context around the run."""

    def __init__(self, console: Console, title: str) -> None:
        self._title = title
        self._lines: dict[str, _Line] = {}
        self._left = 0.0
        self._says = ""
        self._live = Live(console=console, get_renderable=self._render, refresh_per_second=10, transient=False)

    def __enter__(self) -> "LiveDisplay":
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def __call__(self, event: Event) -> None:
        """Take one event; quick, draws nothing."""
        match event:
            case RunStarted():
                self._lines = {window: _Line() for window in event.windows}
                self._left = event.seconds
            case StepStarted() | StepProgress():
                self._left = event.left
                self._step(event)
            case Prompted():
                self._says = event.prompt.text
            case StepFinished(step=CheckTension(), result=result):
                self._change(event.step.window, tension=_range(result.values))
            case WindowFinished():
                verdict = VERDICTS.get(event.outcome, str(event.outcome))
                self._change(event.window, doing="", verdict=f"{verdict}  {event.reason}".rstrip())
            case Tripped():
                self._says = f"STOPPED: {event.trip.says}"
            case RunFinished():
                self._left = 0.0
                self._says = ""
            case _:
                pass

    def _step(self, event: StepStarted | StepProgress) -> None:
        name = NAMES.get(type(event.step))
        if name is None:
            return
        if not isinstance(event.step, Ask):
            self._says = ""  # answered
        line = self._lines.get(event.step.window, _Line())
        starting = isinstance(event, StepStarted)
        recordings = line.recordings + (starting and isinstance(event.step, Record))
        fraction = 0.0 if starting else event.fraction
        self._change(event.step.window, doing=name, fraction=fraction, recordings=recordings)

    def _change(self, window: str, **what: object) -> None:
        if window in self._lines:
            self._lines[window] = replace(self._lines[window], **what)  # type: ignore[arg-type]

    def _render(self) -> Group:
        title = f"{self._title}   {clock(self._left)} left"
        table = Table(title=title, title_justify="left", box=None, pad_edge=False)
        for column in ("window", "now", "", "tensions, N", "recordings", "verdict"):
            table.add_column(column)
        for window, line in tuple(self._lines.items()):
            filled = round(line.fraction * BAR) if line.doing else 0
            bar = "█" * filled + "·" * (BAR - filled) if line.doing else ""
            table.add_row(window, line.doing, bar, line.tension, str(line.recordings or ""), line.verdict)
        return Group(table, Text(self._says, style="bold"))


class PlainDisplay:
    """A line for each thing that happens, for logs and pipes."""

    def __init__(self, console: Console, title: str) -> None:
        self._console = console
        self._title = title
        self._last = ("", "")

    def __enter__(self) -> "PlainDisplay":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def __call__(self, event: Event) -> None:
        """Print what a reader of a log wants to know."""
        match event:
            case RunStarted():
                self._say(event.t, "", f"{self._title}: {len(event.windows)} windows; {duration(*event.between)}")
            case StepStarted() if type(event.step) in NAMES:
                name = NAMES[type(event.step)]
                self._say(event.t, event.step.window, f"{name:10} {clock(event.left)} left")
            case Prompted():
                self._say(event.t, event.window, f"? {event.prompt.text}")
            case StepFinished(step=CheckTension()):
                self._say(event.t, event.step.window, f"tensions {_range(event.result.values)} N")
            case StepFinished() if event.result.reason:
                self._say(event.t, event.step.window, f"{event.result.outcome}: {event.result.reason}")
            case WindowFinished():
                verdict = VERDICTS.get(event.outcome, str(event.outcome))
                self._say(event.t, event.window, f"{verdict} ({event.done} of {event.of}) {event.reason}".rstrip())
            case Tripped():
                self._say(event.t, "", f"STOPPED: {event.trip.says}")
            case _:
                pass

    def _say(self, t: float, window: str, text: str) -> None:
        if (window, text) != self._last:  # a check and the rejection that follows have the same reason
            self._console.print(f"{clock(t):>8}  {window:4} {text}", markup=False)
        self._last = (window, text)


def display(console: Console, title: str) -> LiveDisplay | PlainDisplay:
    """The display that suits where the output goes."""
    return (LiveDisplay if console.is_terminal else PlainDisplay)(console, title)


def _range(tensions: Sequence[float]) -> str:
    return f"{min(tensions):.0f}–{max(tensions):.0f}" if tensions else ""
