"""What the hand at the platform wants to know, in figures that are read from two metres: wanted and present place."""

from collections.abc import Sequence

from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, line
from fidim_lab.app.tui.view import Connection, ScreenState
from fidim_lab.units import millimetres

SHAPES = {
    "0": ("████", "█  █", "█  █", "█  █", "████"),
    "1": ("  █ ", " ██ ", "  █ ", "  █ ", " ███"),
    "2": ("████", "   █", "████", "█   ", "████"),
    "3": ("████", "   █", " ███", "   █", "████"),
    "4": ("█  █", "█  █", "████", "   █", "   █"),
    "5": ("████", "█   ", "████", "   █", "████"),
    "6": ("████", "█   ", "████", "█  █", "████"),
    "7": ("████", "   █", "  █ ", " █  ", " █  "),
    "8": ("████", "█  █", "████", "█  █", "████"),
    "9": ("████", "█  █", "████", "   █", "████"),
    "+": ("    ", " █  ", "███ ", " █  ", "    "),
    "-": ("    ", "    ", "███ ", "    ", "    "),
    "?": ("████", "   █", " ██ ", "    ", " █  "),
    "x": ("    ", "█  █", " ██ ", " ██ ", "█  █"),
    "y": ("    ", "█  █", " ███", "   █", " ██ "),
    "z": ("    ", "████", "  █ ", " █  ", "████"),
    " ": ("    ",) * 5,
}
ROWS = 5
"""of a figure"""
PLACES = 4
"""sign and digits of a number"""
GAP = 3
"""blanks between two numbers"""


def big(text: str, style: Style = "") -> list[Line]:
    """Figures, signs and x, y, z as five lines of blocks."""
    return [line(Span(" ".join(SHAPES.get(sign, SHAPES["?"])[row] for sign in text), style)) for row in range(ROWS)]


def hand_lines(view: ScreenState, height: int) -> list[Line]:
    """Wanted and present displacement of an open prompt in at most this many lines; nothing where too few."""
    question = view.question
    if question is None or not question.displacement or view.contact is not Connection.LIVE:
        return []
    axes = min(height // (ROWS + 1), 3)
    if axes < len(question.displacement):
        return []
    wanted = [*(f"{round(millimetres(v)):+d}" for v in question.displacement), "", ""]
    now = _now(view)
    column = PLACES * 5 + GAP
    rows: list[Line] = [line(Span(f"{'':10}{'WANTED, mm':{column}}{'NOW, mm' if now else ''}", "head"))]
    for axis, goal, here in zip("xyz"[:axes], wanted, now or ("",) * 3, strict=False):
        rows += [*_beside(axis, goal, here), EMPTY]
    return rows[:-1]


def _beside(axis: str, wanted: str, now: str) -> list[Line]:
    parts = zip(big(axis), big(f"{wanted:>{PLACES}}", "key"), big(f"{now:>{PLACES}}", "good"), strict=True)
    return [(Span(" "), *a, Span(" " * 5), *w, Span(" " * GAP), *n) for a, w, n in parts]


def _now(view: ScreenState) -> Sequence[str]:
    """Of the marker, from where it was when the prompt came; empty where nobody saw that."""
    if view.rest is None or view.status is None:
        return ()
    return ("?",) * 3 if view.displaced is None else [f"{round(millimetres(v)):+d}" for v in view.displaced]
