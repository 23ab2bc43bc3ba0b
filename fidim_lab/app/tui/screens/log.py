"""Log: what has happened, newest last, with a filter."""

from fidim_lab.app.service.messages import Happening
from fidim_lab.app.tui.paint import Line, Span, Style, left, line, wrapped
from fidim_lab.app.tui.screens.why import KIND, check_mark, check_style
from fidim_lab.app.tui.view import ScreenState

STYLES: dict[str, Style] = {
    "e-stop": "alarm",
    "guard-tripped": "bad",
    "guard-warned": "warn",
    "prompt": "key",
    "run-started": "head",
    "run-finished": "head",
}
OUTCOMES: dict[str, Style] = {"pass": "good", "marginal": "warn", "fail": "bad", "error": "bad", "aborted": "bad"}
MARKS = {"pass": "✓", "marginal": "~", "skipped": "–"}
"""of an outcome; any other is ✗"""
WORDS = {
    "e-stop": "■ E-STOP:",
    "guard-tripped": "✗ guard:",
    "guard-warned": "! guard:",
    "prompt": "?",
    "reset": "○ reset",
}
NEWEST = 400
"""lines"""


def log_lines(view: ScreenState, width: int, wanted: str = "") -> list[Line]:
    """Events in which every word of the filter occurs; -WORD leaves out those with it."""
    found = [event for event in view.events if matches(event, wanted)]
    rows: list[Line] = []
    for event in found[-NEWEST:]:
        rows += _event(event, width)
    hidden = len(view.events) - len(found)
    told = [f"{view.forgotten} older events are only in the journal" if view.forgotten else ""]
    told += [f"{hidden} do not match the filter" if hidden else ""]
    says = "; ".join(text for text in told if text)
    return [line(Span(says, "dim")), *rows] if says else rows


def matches(event: Happening, wanted: str) -> bool:
    """Whether an event passes the filter; case does not matter."""
    text = " ".join((event.kind, event.window, event.step, event.text, event.outcome, event.reason)).lower()
    words = wanted.lower().split()
    return all((word[1:] not in text) if len(word) > 1 and word[0] == "-" else word in text for word in words)


def _event(event: Happening, width: int) -> list[Line]:
    style = STYLES.get(event.kind) or OUTCOMES.get(event.outcome, "")
    if event.kind == KIND:
        style = check_style(event)
    begin = f"{event.wall[11:19]}  {left(event.window, 5)}"
    rows = wrapped(_says(event), max(width - len(begin) - 2, 20)) or [""]
    first = line(Span(begin, "dim"), Span(rows[0], style))
    return [first, *(line(Span(" " * (len(begin) + 2) + text, style)) for text in rows[1:])]


def _says(event: Happening) -> str:
    """A mark instead of a word where one is enough: what comes most often is to be short."""
    outcome = f"{MARKS.get(event.outcome, '✗')} {event.outcome}" if event.outcome else ""
    match event.kind:
        case "step-started":
            parts = ["▸", event.text]
        case "step-finished":  # its beginning has said the text
            parts = [outcome or "done", event.reason]
        case "window-finished":
            parts = [MARKS.get(event.outcome, "✗"), "window", event.text, event.outcome, event.reason]
        case "model-checked":
            parts = [f"{check_mark(event)}model:", event.text]
        case kind:
            parts = [WORDS.get(kind, kind.replace("-", " ")), event.text, outcome, event.reason]
    return " ".join(part for part in parts if part)
