"""What is on every screen: the state, alarms, the tabs, an open prompt, the keys. All can be clicked, too."""

import re
import string
from collections.abc import Sequence

from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, block, fitted, left, line, wrapped
from fidim_lab.app.tui.view import Connection, ScreenState
from fidim_lab.units import millimetres

RESERVED = "tgrpkoxqie"
"""letters that command, on every screen (see `app`)"""
SETTLE = 0.3
"""s for which a new prompt takes no key: one that was pressed for what was there before answers nothing"""

TABS = ("Session", "Rig", "Window", "Result", "Why", "Log", "Plot")
KEYS = (
    ("F12", "E-STOP", "app.emergency_stop"),
    ("r", "reset", "app.order('reset')"),
    ("g", "go", "app.order('start')"),
    ("p", "pause", "app.order('pause')"),
    ("k", "skip", "app.order('skip')"),
    ("o", "again", "app.order('retry')"),
    ("x", "abort", "app.order('abort')"),
    ("q", "leave", "app.quit"),
    ("?", "help", "screen.help"),
)
"""key, word, action"""
GAP = "   "
FIRST_LEFT_OUT = ("o", "k", "x", "p", "q", "g", "r")
"""keys that a narrow terminal does not show, in this order; the emergency stop and the help, which has all, stay"""
PHASES: dict[str, tuple[str, Style]] = {
    "idle": ("○ IDLE", "head"),
    "running": ("▶ RUNNING", "good"),
    "paused": ("‖ PAUSED", "warn"),
    "stopping": ("■ STOPPING", "bad"),
    "ended": ("□ ENDED", "head"),
}


def state_lines(view: ScreenState, width: int, notice: str = "") -> list[Line]:
    """Whose rig this is, the state, alarms that nobody can overlook, and what was last said to this person."""
    rows = [_rig(view, width), _state(view, width)]
    rows += _alarms(view, width)
    return [*rows, *block(notice, width, "key")[:2]]


def tab_lines(current: int, width: int) -> list[Line]:
    """The screens by number; the present one in brackets."""
    spans: list[Span] = []
    narrow = width < sum(len(name) + 4 for name in TABS)
    for index, name in enumerate(TABS):
        here = index == current
        text = f"[{index + 1} {name}]" if here else f" {index + 1} " if narrow else f" {index + 1} {name} "
        spans.append(Span(text, "head" if here else "dim", f"screen.turn({index})"))
    used = sum(len(span.text) for span in spans)
    return [(*spans, Span(left("─" * max(width - used, 0), max(width - used, 0)), "dim"))]


def prompt_lines(view: ScreenState, width: int, *, typing: bool = False) -> list[Line]:
    """The open prompt with its keys; nothing where there is none. typing: letters go into a line of text now."""
    question = view.question
    if question is None or view.contact is not Connection.LIVE:
        return []
    rows: list[Line] = [line(Span(left("━━ ANSWER THIS ".ljust(width, "━"), width), "key"))]
    about = f"{question.window}: " if question.window else ""
    rows += block(f"{about}{question.text}", width, "head")[:4]
    if question.displacement:
        wanted = Span(f"displace by  {_away(question.displacement)}")
        rows += _beside((wanted, Span(_displaced(view), "good")), width)
    keys = [Span("Esc, then", "key")] if typing else []
    for key, choice in choice_keys(question.choices).items():
        keys.append(Span(f"[{key}] {choice}", "key", f"app.choose('{key}')"))
    return [*rows, *_beside((*keys, Span(_default(view), "dim")), width)]


def _beside(parts: Sequence[Span], width: int) -> list[Line]:
    """Parts beside each other, three blanks apart; what has no room begins a line of its own, nothing is cut."""
    rows: list[list[Span]] = [[]]
    for part in (part for part in parts if part.text):
        used = sum(len(span.text) for span in rows[-1])
        if rows[-1] and used + len(GAP) + len(part.text) > width:
            rows.append([])
        rows[-1] += [*([Span(GAP)] if rows[-1] else []), part]
    return [tuple(row) for row in rows if row]


def key_lines(width: int) -> list[Line]:
    """The keys that work on every screen, the emergency stop first."""
    shown = [*KEYS]
    for left_out in FIRST_LEFT_OUT:
        if sum(len(f"{key} {name} ") for key, name, _ in shown) - 1 <= width:
            break
        shown = [one for one in shown if one[0] != left_out]
    gap = " " * min(max((width - sum(len(f"{key} {name}") for key, name, _ in shown)) // len(shown), 1), 3)
    spans: list[Span] = []
    for key, name, action in shown:
        stop: Style = "alarm" if key == "F12" else "key"
        spans += [Span(key, stop, action), Span(f" {name}", "alarm" if stop == "alarm" else "", action), Span(gap)]
    return [tuple(spans[:-1])]


def _away(metres: Sequence[float]) -> str:
    return "  ".join(f"{name} {round(millimetres(v)):+d} mm" for name, v in zip("xyz", metres, strict=False))


def _displaced(view: ScreenState) -> str:
    """Where the marker is now, from where it was when the prompt came: what the hand at the platform wants to know."""
    if view.rest is None:
        return ""
    return "NOW  marker not seen" if view.displaced is None else f"NOW  {_away(view.displaced)}"


def _default(view: ScreenState) -> str:
    question = view.question
    if question is None or question.default_after is None or not question.default:
        return ""
    left_over = max(question.default_after - (view.now - view.asked), 0.0)
    return f"“{question.default}” automatically in {left_over:.0f} s"


def _rig(view: ScreenState, width: int) -> Line:
    """A band of its own: a key pressed for the wrong robot is the worst mistake of all."""
    if view.welcome is None:
        return line(Span(left(" no rig yet", width), "rig"))
    run = f"  {view.welcome.run} "
    run = left(run, min(len(run), width // 3))
    return line(Span(left(f" RIG  {view.welcome.rig}", width - len(run)) + run, "rig"))


def _state(view: ScreenState, width: int) -> Line:
    status = view.status
    if status is None:
        return line(Span("fidim  ", "dim"), Span(view.contact.value, "warn"))
    phase, style = PHASES[status.phase]
    role = "you command" if view.commands else _commander(view)
    end = f"{status.wall[11:19]}  {_age(view)}"
    middle = max(width - len(phase) - len(end) - 4, 0)
    if not view.fresh:
        return line(Span(f"{phase}?  {left(role, max(middle - 1, 0))}  {end}", "old"))
    return line(
        Span(phase, style), Span(f"  {left(role, middle)}  ", "head" if view.commands else ""), Span(end, "dim")
    )


def _commander(view: ScreenState) -> str:
    return f"{view.commander} commands, t takes over" if view.commander else "no one commands, t takes command"


def _age(view: ScreenState) -> str:
    """Only what is fresh is called live; the age of what is not counts up."""
    if view.fresh:
        return "● live"
    return "○ no state" if view.age is None else f"✗ OLD {view.age:.1f} s"


def _alarms(view: ScreenState, width: int) -> list[Line]:
    rows = _latched(view, width)
    old = "" if view.age is None else f" – ALL VALUES ARE {view.age:.0f} s OLD"
    match view.contact:
        case Connection.LOST:
            rows += _alarm(f"✗ SERVICE LOST{old}", width, view.why, LOST_ADVICE)
        case Connection.SILENT:
            rows += _alarm(f"✗ THE SERVICE DOES NOT ANSWER{old}", width, SILENT_ADVICE)
        case Connection.ENDED:
            heard = "" if view.age is None else f" – values of {view.age:.0f} s ago"
            rows += _alarm(f"□ THE SERVICE HAS ENDED{heard}", width, *_last_words(view.why, width), alarm="warn")
        case _:
            pass
    if view.offer is not None:
        there = f"“{view.offer.rig}” has a service (run “{view.offer.run}”). Press t, then y, to change to that rig."
        rows += _alarm("ANOTHER RIG HAS A SERVICE; THIS SCREEN DOES NOT CONTROL IT", width, there, alarm="warn")
    return rows


def _last_words(says: str, width: int) -> tuple[str, ...]:
    """What was measured at the end is the last sentence: where there is no room for all, it comes first."""
    if len(wrapped(says, width)) <= MOST_ROWS:
        return (says,)
    return re.split(r"(?<=\.) ", says)[-1], left(says, width)


def _latched(view: ScreenState, width: int) -> list[Line]:
    """Before all else: where there is no room for everything, this is seen."""
    status = view.status
    if status is None or not status.latched:
        return []
    was = "" if view.fresh else "at the last contact: "
    ended = view.contact in (Connection.ENDED, Connection.LOST) or status.phase == "ended"
    reset = " r starts the service again." if ended else " r resets it, after a question."
    why = f"{was}{status.latched_why or 'latched since the start'}.{reset}"
    title = next((one for one in LATCHED if len(one) <= width), LATCHED[-1])
    return _alarm(title, width, why)


LATCHED = ("■ ■ ■  E M E R G E N C Y   S T O P   L A T C H E D  ■ ■ ■", "■ EMERGENCY STOP LATCHED ■")
"""the widest that a terminal has room for"""
MOST_ROWS = 2
"""of a sentence beside an alarm"""
LOST_ADVICE = (
    "The drives stop by themselves without its heartbeat. NO KEY OF THIS SCREEN STOPS THE ROBOT: use the hardware stop."
)
SILENT_ADVICE = "Connected, but no state arrives. Do not rely on this screen; use the hardware stop."


def _alarm(title: str, width: int, *says: str, alarm: Style = "alarm") -> list[Line]:
    rows: list[Line] = [line(Span(row.center(width), alarm)) for row in fitted(title, width)]
    for text in says:
        first, *more = wrapped(text, width) or [""]
        shown = [first, *more] if len(more) < MOST_ROWS else [first, left(f"{more[0]} {more[1]}", width)]
        rows += [line(Span(row, "bad" if alarm == "alarm" else "warn")) for row in shown if row]
    return [row for row in rows if row is not EMPTY]


def choice_keys(choices: Sequence[str]) -> dict[str, str]:
    """Key → choice: the choice's first free letter, or else any free letter."""
    taken: dict[str, str] = {}
    for choice in choices:
        letters = [*choice.lower(), *string.ascii_lowercase]
        free = (c for c in letters if c in string.ascii_lowercase and c not in RESERVED and c not in taken)
        key = next(free, None)
        if key is not None:
            taken[key] = choice
    return taken
