"""Log: what has happened, newest last, with a filter."""

from fidim_lab.app.service.messages import Happening
from fidim_lab.app.tui.paint import Line, Span, Style, left, line, wrapped
from fidim_lab.app.tui.view import View

STYLES: dict[str, Style] = {"e-stop": "alarm", "guard-tripped": "bad", "guard-warned": "warn", "prompt": "key"}
OUTCOMES: dict[str, Style] = {"pass": "good", "marginal": "warn", "fail": "bad", "error": "bad", "aborted": "bad"}
NEWEST = 400
"""lines"""


def log_lines(view: View, width: int, wanted: str = "") -> list[Line]:
    """Events in which every word of the filter occurs; -WORD leaves out those with it."""
    found = [event for event in view.events if matches(event, wanted)]
    rows: list[Line] = []
    for event in found[-NEWEST:]:
        rows += _event(event, width)
    hidden = len(view.events) - len(found)
    told = [f"{view.forgotten} older ones are in the journal" if view.forgotten else ""]
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
    begin = f"{event.wall[11:19]}  {left(event.window, 6)} {left(event.kind, 15)} "
    text = "" if event.kind == "step-finished" else event.text  # its beginning has said it
    says = "  ".join(part for part in (text, event.outcome, event.reason) if part)
    rows = wrapped(says, max(width - len(begin), 20)) or [""]
    first = line(Span(begin, "dim"), Span(rows[0], style))
    return [first, *(line(Span(" " * len(begin) + text, style)) for text in rows[1:])]
