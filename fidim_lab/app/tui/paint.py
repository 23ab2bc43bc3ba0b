"""Lines of text with a meaning for each piece; a theme decides on its colour, and a symbol says the same without.

Screens are made of these, so that a test reads what a person reads.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from fidim_lab.say import printable
from fidim_lab.units import millimetres

Style = Literal["", "dim", "head", "good", "warn", "bad", "old", "key", "alarm", "rig", "measured", "model"]

LONGEST = 20_000
"""characters of one text on a screen"""
PARTS = " ▏▎▍▌▋▊▉█"


@dataclass(frozen=True)
class Span:
    """A piece of a line."""

    text: str
    style: Style = ""
    click: str = ""
    """Textual's name of the action that a click on it does, as the key beside it does"""


Line = tuple[Span, ...]

EMPTY: Line = ()


def line(*pieces: str | Span) -> Line:
    """A line of plain text and spans."""
    return tuple(Span(piece) if isinstance(piece, str) else piece for piece in pieces if piece)


def text_of(lines: Iterable[Line]) -> str:
    """The lines as plain text, without blanks at their ends."""
    return "\n".join("".join(span.text for span in row).rstrip() for row in lines)


def left(text: str, width: int) -> str:
    """Cut or filled to the width; what is cut ends in an ellipsis."""
    return text.ljust(width) if len(text) <= width else text[: max(width - 1, 0)] + "…"


def right(text: str, width: int) -> str:
    """As `left`, pushed to the right."""
    return left(text, width) if len(text) > width else text.rjust(width)


def number(value: float | None, decimals: int, unit: str = "") -> str:
    """A number with its unit, a dash where it is not known."""
    if value is None:
        return "–"
    return f"{value:.{decimals}f}{f' {unit}' if unit else ''}"


def milli(value: float | None, decimals: int, unit: str = "") -> str:
    """As `number`, of a thousand times the value: metres as mm, seconds as ms."""
    return number(None if value is None else millimetres(value), decimals, unit)


def bar(fraction: float, width: int) -> str:
    """A bar of this many cells, filled to eighths of a cell; an empty cell is a dot, to be seen without colour."""
    eighths = round(min(max(fraction, 0.0), 1.0) * width * 8)
    full, rest = divmod(eighths, 8)
    drawn = "█" * full + (PARTS[rest] if rest else "")
    return drawn.ljust(width, "·")


def time_span(seconds: float | None) -> str:
    """As 45 s, 12:30 or 1:02:05."""
    if seconds is None:
        return "–"
    whole = round(max(seconds, 0.0))
    if whole < 60:
        return f"{whole} s"
    hours, rest = divmod(whole, 3600)
    minutes, left_over = divmod(rest, 60)
    return f"{hours}:{minutes:02}:{left_over:02}" if hours else f"{minutes}:{left_over:02}"


def greyed(lines: Iterable[Line]) -> list[Line]:
    """All in the style of what is old: never to be taken for fresh."""
    return [tuple(Span(span.text, "old", span.click) for span in row) for row in lines]


def folded(row: Line, width: int) -> list[Line]:
    """A line on as many as it needs, each piece on the next one where it does not fit."""
    rows: list[list[Span]] = [[]]
    for span in row:
        if rows[-1] and sum(len(one.text) for one in rows[-1]) + len(span.text) > width:
            rows.append([Span("  ")])
            span = replace(span, text=span.text.lstrip())
        rows[-1].append(span)
    return [tuple(one) for one in rows]


def fitted(text: str, width: int) -> list[str]:
    """A text as it is where it fits, its blanks too; else wrapped."""
    return [text] if len(text) <= width else wrapped(text, width)


def block(text: str, width: int, style: Style = "", indent: str = "") -> list[Line]:
    """A text in one style, on as many lines as it needs."""
    return [line(Span(row, style)) for row in wrapped(text, width, indent)]


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Words on as many lines as they need; a text without end has an end here."""
    rows, row = [], indent
    for word in printable(text, LONGEST).split():
        if len(row) + len(word) + 1 > width and row.strip():
            rows.append(row)
            row = indent
        row += word if row == indent else f" {word}"
    return [*rows, row] if row.strip() else rows
