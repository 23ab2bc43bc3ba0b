"""The words of the help screens."""

from fidim_lab.app.tui.paint import EMPTY, Line, Span, line, wrapped
from fidim_lab.app.tui.screens.bars import TABS

KEYS = (
    ("F12 Ctrl+E", "EMERGENCY STOP: all winches at once, at any time, without asking. Anybody may."),
    ("r", "undo a stop, in every state: read why, then y to each question"),
    ("g", "go: start the run"),
    ("p", "pause: stop on the ramp, hold with power on; p again: verify the place, go on"),
    ("k", "skip the present window, with a reason"),
    ("o", "once more: record the present window again"),
    ("x", "abort the run; the robot is held"),
    ("t", "take command from another client (only one commands; all may watch)"),
    ("1 … 7", "the screens; 7 again: the next quantity to plot"),
    ("i  e", "identify, explain: in a process of their own, from the windows recorded so far"),
    ("/", "filter the log: words that must occur, -word that must not; Esc leaves it"),
    ("d", "… or whatever letter is shown: answers an open prompt"),
    ("Ctrl+P", "command palette; also light and dark"),
    ("q", "leave. The run goes on; fidim ui attaches again"),
)
ABOUT = {
    "Session": "The step at hand and every equilibrium: tension margin (N to the nearest limit at rest), amplitude "
    "(peak to peak of the last recording), tries, and the verdict with its reason. ✓ pass, ~ marginal, ✗ fail.",
    "Rig": "Each winch: the state of its drive, cable length, speed (positive pays out), tension between its limits, "
    "temperature and following error where the drive reports them. A value that is too old is greyed and says its age. "
    "Guards that have tripped or warn come first, with the reason.",
    "Window": "The main marker's x, y, z as it is recorded. After two seconds the model (CAD, or this run's result) is "
    "fitted to the initial state and runs ahead; Δ is the distance of what is recorded from what was predicted. It "
    "is fitted once more after four seconds, and not to more: Δ is to show what the body does not explain.",
    "Result": "The nine parameters with 95 % intervals, against CAD (in standard deviations; ! beyond 3) and the last "
    "session beside this run's folder; each window's σ⊥, rms and χ²/dof; what to measure next.",
    "Why": "What fidim explain found: verdict, named effects with their parameters, where they show, what else was "
    "tried, held-out windows before and after.",
    "Log": "Everything that has happened, newest last.",
    "Plot": "What the service has told during the last two minutes, a curve for each winch: tension; then, by 7 again, "
    "length, speed, following error, temperature, the main marker, and bus, control loop and cameras.",
}
COLUMN = 12


def help_lines(current: int, width: int) -> list[Line]:
    """About the present screen, then the keys."""
    name = TABS[current]
    rows: list[Line] = [line(Span(name, "head"))]
    rows += [line(text) for text in wrapped(ABOUT[name], width)]
    rows += [EMPTY, line(Span("Keys, on every screen", "head"))]
    for keys, says in KEYS:
        first, *more = wrapped(says, width - COLUMN)
        rows.append(line(Span(f"{keys:{COLUMN}}", "key"), first))
        rows += [line(" " * COLUMN + text) for text in more]
    last = wrapped("Esc closes this. F12 stops the robot from here, too.", width)
    return [*rows, EMPTY, *(line(Span(text, "dim")) for text in last)]
