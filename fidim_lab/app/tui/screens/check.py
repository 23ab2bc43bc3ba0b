"""What the service's look at the model after each window has said (`model-checked`), for Session and Why."""

from collections.abc import Sequence

from fidim_lab.app.service.messages import Happening
from fidim_lab.app.tui.paint import Line, Span, Style, left, line, wrapped

KIND = "model-checked"
HOLDS = "holds"
NEWEST = 3
"""looks that Why shows"""
SHORT = 2
"""lines of the newest on Session"""


def checks(events: Sequence[Happening]) -> tuple[Happening, ...]:
    """All looks, oldest first."""
    return tuple(event for event in events if event.kind == KIND)


def newest_check(events: Sequence[Happening], width: int) -> list[Line]:
    """Two lines at most: what is suspected, or that the model holds; nothing before the first look."""
    found = checks(events)
    if not found:
        return []
    rows = _said(found[-1], width)
    if len(rows) <= SHORT:
        return rows
    *shown, (last,) = rows[:SHORT]
    return [*shown, line(Span(left(f"{last.text} …", width).rstrip(), last.style))]


def check_lines(events: Sequence[Happening], width: int) -> list[Line]:
    """The newest looks in full, with a heading."""
    found = checks(events)[-NEWEST:]
    if not found:
        return []
    return [line(Span("After each window", "head")), *(row for one in reversed(found) for row in _said(one, width))]


def check_style(event: Happening) -> Style:
    """A doubt is orange; what only tells that there is no answer yet is faint."""
    if event.outcome == HOLDS:
        return ""
    return "warn" if event.outcome else "dim"


def check_mark(event: Happening) -> str:
    """Before a doubt."""
    return "! " if check_style(event) == "warn" else ""


def _said(event: Happening, width: int) -> list[Line]:
    style = check_style(event)
    begin = f"{event.window}: " if event.window else ""
    mark = f"{check_mark(event)}model "
    return [line(Span(text, style)) for text in wrapped(f"{mark}{begin}{event.text}", width)]
