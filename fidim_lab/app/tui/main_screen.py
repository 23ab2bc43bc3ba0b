"""The one screen that everything is drawn on: the part in sight, and the keys that command nothing but it."""

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen

from fidim_lab.app.tui.dialogs import Help
from fidim_lab.app.tui.jobs import Work
from fidim_lab.app.tui.link import Link
from fidim_lab.app.tui.paint import EMPTY, Line, Span, block, line, wrapped
from fidim_lab.app.tui.screens.bars import TABS
from fidim_lab.app.tui.stage import Stage

KEYS = (
    ("F12 Ctrl+E", "EMERGENCY STOP: all winches at once, at any time, without a question. Every client may."),
    ("r", "reset a stop, in every state: read its reason, then answer y to each question"),
    ("g", "go: start the run"),
    ("p", "pause: stop on the ramp and hold, with power on; p again: check the place, continue"),
    ("k", "skip the present window, with a reason"),
    ("o", "repeat: record the present window again"),
    ("x", "abort the run; the robot is held"),
    ("t", "take command from another client (one commands, all may watch)"),
    ("1 … 7", "show a screen; 7 again: plot the next quantity"),
    ("i  e", "identify, explain: from the windows recorded so far, in a separate process"),
    ("/", "filter the log: word must occur, -word must not; Esc ends the filter"),
    ("d", "or another letter that is shown: answer the open prompt"),
    ("Ctrl+P", "command palette, also for light and dark colours"),
    ("q", "leave the UI; the run continues, fidim ui attaches again"),
)
ABOUT = {
    "Session": "The present step and every equilibrium: tension margin (N to the nearest limit at rest), amplitude "
    "(peak to peak of the last recording), tries, and the verdict with its reason. ✓ pass, ~ marginal, ✗ fail.",
    "Rig": "Each winch: the state of its drive, cable length, speed (positive pays out), tension between its limits, "
    "temperature and following error where the drive reports them. A value that is too old is grey, with its age. "
    "Guards that have tripped or warn come first, with the reason.",
    "Window": "The main marker's x, y, z while it is recorded. After two seconds the initial state of the model (CAD, "
    "or this run's result) is fitted and its motion is predicted; Δ is the distance between recording and prediction. "
    "The state is fitted again after four seconds and not later, so that Δ shows what the body does not explain.",
    "Result": "The nine parameters with 95 % intervals, against CAD (in standard deviations; ! beyond 3) and the last "
    "session beside this run's folder; each window's σ⊥, rms and χ²/dof; what to measure next.",
    "Why": "What fidim explain found: verdict, named effects with their parameters, where they show, what else was "
    "tried, held-out windows before and after.",
    "Log": "All events, the newest last.",
    "Plot": "The last two minutes, one curve for each winch: tension; each further 7 shows the next quantity: "
    "length, speed, following error, temperature, the main marker, and bus, control loop and cameras.",
}
COLUMN = 12

HELP_WIDTH = 64
BESIDE_HELP = 8
"""columns of a dialog's frame, its margin and its scroll bar"""
LOG = TABS.index("Log")


class MainScreen(Screen[None]):
    """Seven screens by number, help, the log's filter."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark,f1", "help", "help", key_display="?"),
        Binding("i", "work('identify')", "identify", show=False),
        Binding("e", "work('explain')", "explain", show=False),
        Binding("slash", "filter", "filter the log", show=False),
        Binding("escape", "unfilter", show=False),
        *(Binding(str(k + 1), f"turn({k})", f"screen {name}", show=False) for k, name in enumerate(TABS)),
    ]

    def __init__(self, stage: Stage, link: Link) -> None:
        super().__init__()
        self._stage = stage
        self._link = link

    def compose(self) -> ComposeResult:
        """As the stage has it."""
        yield from self._stage.compose()

    def on_mount(self) -> None:
        """Begin with the session."""
        self._stage.turn(0)

    def on_input_submitted(self) -> None:
        """The filter stands; the keys go back to the log."""
        self._stage.turn(LOG)

    def action_turn(self, index: int) -> None:
        """Another screen."""
        self._stage.turn(index)
        self._stage.draw(self._link.view())

    def action_help(self) -> None:
        """Help on the present screen."""
        room = min(HELP_WIDTH, max(self.size.width - BESIDE_HELP, 20))
        self.app.push_screen(Help(help_lines(self._stage.current, room)))

    def action_filter(self) -> None:
        """Type a filter of the log."""
        self._stage.turn(LOG)
        self._stage.filter.display = True
        self._stage.filter.focus()

    def action_unfilter(self) -> None:
        """Leave the filter and forget it."""
        self._stage.filter.clear()
        self._stage.filter.display = False
        self._stage.turn(self._stage.current)

    def action_work(self, work: Work) -> None:
        """Compute beside the screen, and show where its answer will be."""
        view = self._link.view()
        folder = self._stage.folder(view)
        if folder is not None:
            self.action_turn(TABS.index("Result" if work == "identify" else "Why"))
            self.run_worker(self._stage.jobs.run(work, folder, view.now))


def help_lines(current: int, width: int) -> list[Line]:
    """About the present screen, then the keys."""
    name = TABS[current]
    rows: list[Line] = [line(Span(name, "head"))]
    rows += block(ABOUT[name], width)
    rows += [EMPTY, line(Span("Keys, on every screen", "head"))]
    for keys, says in KEYS:
        first, *more = wrapped(says, width - COLUMN)
        rows.append(line(Span(f"{keys:{COLUMN}}", "key"), first))
        rows += [line(" " * COLUMN + text) for text in more]
    return [*rows, EMPTY, *block("Esc closes this help. F12 stops the robot here, too.", width, "dim")]
