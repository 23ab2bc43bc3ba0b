"""Session: the step at hand and the table of equilibria."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from fidim_lab.app.service.messages import EquilibriumState, Status
from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, bar, block, left, line, milli, number, right, time_span
from fidim_lab.app.tui.screens.hand import hand_lines
from fidim_lab.app.tui.screens.why import newest_check
from fidim_lab.app.tui.view import ScreenState

MARKS: dict[str, tuple[str, Style]] = {
    "pass": ("✓ pass", "good"),
    "marginal": ("~ marginal", "warn"),
    "skipped": ("– skipped", "dim"),
    "fail": ("✗ fail", "bad"),
    "aborted": ("✗ aborted", "bad"),
    "error": ("✗ error", "bad"),
}


@dataclass(frozen=True)
class Column:
    """Of the table of equilibria."""

    name: str
    width: int
    number: bool = False


COLUMNS = (
    Column("window", 8),
    Column("role", 10),
    Column("state", 9),
    Column("margin", 8, number=True),
    Column("amplitude", 10, number=True),
    Column("tries", 6, number=True),
)
FIRST_LEFT_OUT = ("role", "tries", "amplitude", "margin")
"""columns that a narrow terminal does not show, in this order"""
VERDICT = 12
"""columns of the longest verdict, with the gap before it"""
LEAST_BAR = 5
HELP = "Prompts appear below; answer with the letter shown. F12 stops everything at any time. ? explains each screen."
CURRENT = "▶"
"""begins the row of the present window"""


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
            *_why_it_ended(view, width),
            *_what_is_left(view, status, width),
            line("i: identify; e: explain what the model leaves out; q: leave."),
        ]
    if step is None:
        return block(_how_to_begin(status), width, "head")
    text = step.text or step.step
    begin = f"step {step.number}, {step.phase}  "
    end = f" {100 * step.fraction:3.0f} %  {_done(status)}  left {time_span(step.left)}"
    rows = block(f"{step.window}  {text}", width, "head") or [EMPTY]
    if len(begin) + LEAST_BAR + len(end) > width:
        drawn = bar(step.fraction, max(width - len(begin), LEAST_BAR))
        return [*rows, line(begin, Span(drawn, "good")), line(end.strip())]
    drawn = bar(step.fraction, width - len(begin) - len(end))
    return [*rows, line(begin, Span(drawn, "good"), end)]


def _why_it_ended(view: ScreenState, width: int) -> list[Line]:
    """All that the run's last sentence says: the alarms above have room for its beginning only."""
    last = next((event for event in reversed(view.events) if event.kind == "run-finished"), None)
    if last is None:
        return []
    style: Style = "" if last.outcome == "pass" else "bad"
    said = f"{MARKS.get(last.outcome, (last.outcome, style))[0]}: {last.reason or last.text}"
    return block(said, width, style)


def _what_is_left(view: ScreenState, status: Status, width: int) -> list[Line]:
    """How to go on with a run that was cut off."""
    if view.welcome is None or all(row.state == "done" for row in status.equilibria):
        return []
    says = f"Continue with r, or: fidim resume {shlex.quote(view.welcome.folder)}"
    return block(says, width, "key")


def _how_to_begin(status: Status) -> str:
    recorded = any(row.state == "done" for row in status.equilibria)
    said = f"{_done(status)} so far." if recorded else "The run has not started."
    if status.phase != "idle":
        return said
    first = "Press r to reset the emergency stop (it is latched at the start), then " if status.latched else ""
    return f"{said} {first or 'Press '}g to {'continue' if recorded else 'start the run'}. {HELP}"


def _done(status: Status) -> str:
    """Skipped windows and those that were given up are not done."""
    states = [_state(row) for row in status.equilibria]
    said = f"{states.count('done')}/{len(states)} windows"
    return said + "".join(f", {count} {state}" for state in ("skipped", "given up") if (count := states.count(state)))


def _state(row: EquilibriumState) -> str:
    if row.state != "done":
        return row.state
    return {"pass": "done", "marginal": "done", "skipped": "skipped"}.get(row.verdict, "given up")


def _table(status: Status, width: int) -> list[Line]:
    shown = [*COLUMNS]
    for name in FIRST_LEFT_OUT:
        if 2 + sum(column.width for column in shown) + VERDICT <= width:
            break
        shown = [column for column in shown if column.name != name]
    head = "  " + "".join((right if column.number else left)(column.name, column.width) for column in shown)
    rows: list[Line] = [line(Span(f"{head}  verdict", "dim"))]
    for row in status.equilibria:
        rows += _row(row, shown, width)
    return rows


def _row(row: EquilibriumState, shown: Sequence[Column], width: int) -> list[Line]:
    current = row.state == "current"
    verdict, style = MARKS.get(row.verdict, (row.verdict, ""))
    texts = {
        "window": row.window,
        "role": row.role,
        "state": _state(row),
        "margin": number(row.margin, 1, "N"),
        "amplitude": milli(row.amplitude, 0, "mm"),
        "tries": str(row.attempts or "–"),
    }
    words: Style = "head" if current else "dim" if row.state == "waiting" else ""
    styles: dict[str, Style] = {"margin": "bad" if row.margin is not None and row.margin <= 0 else ""}
    cells = [
        Span(
            (right if column.number else left)(texts[column.name], column.width),
            styles.get(column.name, "" if column.number else words),
        )
        for column in shown
    ]
    begin = line(Span(f"{CURRENT} " if current else "  ", "head"), *cells, "  ", Span(verdict, style))
    used = sum(len(span.text) for span in begin)
    if not row.reason:
        return [begin]
    if used + 2 + len(row.reason) <= width:
        return [(*begin, Span(f"  {row.reason}", "dim"))]
    return [begin, *block(row.reason, width, "dim", "      ")]
