"""Session: the step at hand and the table of equilibria."""

import shlex

from fidim_lab.app.service.messages import EquilibriumState, Status
from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, bar, left, line, number, right, span_of_time, wrapped
from fidim_lab.app.tui.screens.check import newest_check
from fidim_lab.app.tui.screens.hand import hand_lines
from fidim_lab.app.tui.view import ScreenState
from fidim_lab.units import millimetres

MARKS: dict[str, tuple[str, Style]] = {
    "pass": ("✓ pass", "good"),
    "marginal": ("~ marginal", "warn"),
    "skipped": ("– skipped", "dim"),
    "fail": ("✗ fail", "bad"),
    "aborted": ("✗ aborted", "bad"),
    "error": ("✗ error", "bad"),
}
COLUMNS = (("window", 8), ("role", 10), ("state", 9), ("margin", 8), ("amplitude", 10), ("tries", 6))
CURRENT = "▶"
"""begins the row of the present window"""
NUMBERS = 3
"""the last columns are numbers"""


def session_lines(view: ScreenState, width: int, height: int = 0) -> list[Line]:
    """The whole screen; where the height leaves room, large figures for the hand at the platform below the table."""
    status = view.status
    if status is None:
        return _nothing(view)
    rows = [*_step(view, status, width), *newest_check(view.events, width), EMPTY, *_table(status, width)]
    figures = hand_lines(view, height - len(rows) - 1)
    return [*rows, EMPTY, *figures] if figures else rows


def _nothing(view: ScreenState) -> list[Line]:
    return [line(Span(f"No service yet: {view.why or 'connecting …'}", "dim"))]


def _step(view: ScreenState, status: Status, width: int) -> list[Line]:
    step = status.step
    if status.phase == "ended":
        return [
            line(Span(f"The run has ended: {_done(status)}.", "head")),
            *_what_is_left(view, status, width),
            line("i identifies, e asks what the model leaves out; q leaves."),
        ]
    if step is None:
        keys = ": r resets the emergency stop, then g starts the run" if status.phase == "idle" else ""
        return [line(Span(f"Nothing has begun{keys}.", "head"))]
    text = step.text or step.step
    begin = f"step {step.number}, {step.phase}  "
    end = f" {100 * step.fraction:3.0f} %  {_done(status)}  left {span_of_time(step.left)}"
    drawn = bar(step.fraction, max(width - len(begin) - len(end), 5))
    rows = [line(Span(row, "head")) for row in wrapped(f"{step.window}  {text}", width)] or [EMPTY]
    return [*rows, line(begin, Span(drawn, "good"), end)]


def _what_is_left(view: ScreenState, status: Status, width: int) -> list[Line]:
    """How to go on with a run that was cut off."""
    if view.welcome is None or all(row.state == "done" for row in status.equilibria):
        return []
    says = f"What is left goes on with r, or: fidim resume {shlex.quote(view.welcome.folder)}"
    return [line(Span(text, "key")) for text in wrapped(says, width)]


def _done(status: Status) -> str:
    done = sum(row.state == "done" for row in status.equilibria)
    return f"{done}/{len(status.equilibria)} windows"


def _table(status: Status, width: int) -> list[Line]:
    head = "  " + "".join(
        (right if index >= len(COLUMNS) - NUMBERS else left)(name, size) for index, (name, size) in enumerate(COLUMNS)
    )
    rows: list[Line] = [line(Span(f"{head}  verdict", "dim"))]
    for row in status.equilibria:
        rows += _row(row, width)
    return rows


def _row(row: EquilibriumState, width: int) -> list[Line]:
    current = row.state == "current"
    verdict, style = MARKS.get(row.verdict, (row.verdict, ""))
    margin: Style = "bad" if row.margin is not None and row.margin <= 0 else ""
    amplitude = None if row.amplitude is None else millimetres(row.amplitude)
    cells = [left(text, COLUMNS[k][1]) for k, text in enumerate((row.window, row.role, row.state))]
    begin = line(
        Span(f"{CURRENT} " if current else "  ", "head"),
        Span("".join(cells), "head" if current else "dim" if row.state == "waiting" else ""),
        Span(right(number(row.margin, 1, "N"), COLUMNS[3][1]), margin),
        right(number(amplitude, 0, "mm"), COLUMNS[4][1]),
        right(str(row.attempts or "–"), COLUMNS[5][1]),
        "  ",
        Span(verdict, style),
    )
    used = sum(len(span.text) for span in begin)
    if not row.reason:
        return [begin]
    if used + 2 + len(row.reason) <= width:
        return [(*begin, Span(f"  {row.reason}", "dim"))]
    return [begin, *(line(Span(text, "dim")) for text in wrapped(row.reason, width, "      "))]
