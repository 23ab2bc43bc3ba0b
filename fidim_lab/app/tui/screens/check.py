"""What the service's look at the model after each window has said (`model-checked`), for Session and Why."""

from collections.abc import Sequence

from fidim_lab.app.service.messages import Happening
from fidim_lab.app.tui.paint import Line, Span, Style, line, wrapped

KIND = "model-checked"
HOLDS = "holds"
NEWEST = 3
"""looks that Why shows"""


def checks(events: Sequence[Happening]) -> tuple[Happening, ...]:
    """All looks, oldest first."""
    return tuple(event for event in events if event.kind == KIND)


def newest_check(events: Sequence[Happening], width: int) -> list[Line]:
    """Two lines at most: what is suspected, or that the model holds; nothing before the first look."""
    found = checks(events)
    return _said(found[-1], width)[:2] if found else []


def check_lines(events: Sequence[Happening], width: int) -> list[Line]:
    """The newest looks in full, with a heading."""
    found = checks(events)[-NEWEST:]
    if not found:
        return []
    return [line(Span("After each window", "head")), *(row for one in reversed(found) for row in _said(one, width))]


def _said(event: Happening, width: int) -> list[Line]:
    holds = event.outcome == HOLDS
    style: Style = "" if holds else "warn"
    begin = f"{event.window}: " if event.window else ""
    mark = "model " if holds else "! model "
    return [line(Span(text, style)) for text in wrapped(f"{mark}{begin}{event.text}", width)]
