"""Draws the present view on whatever is in sight: bars, one screen's board, the alarms of a dialog."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import ContentSwitcher, Input

from drivers.ports import Clock
from fidim_lab.app.tui.foresight import Foresight
from fidim_lab.app.tui.jobs import Jobs
from fidim_lab.app.tui.paint import Line, block, greyed
from fidim_lab.app.tui.result_files import ResultFilesWatch
from fidim_lab.app.tui.screens.bars import TABS, key_lines, prompt_lines, state_lines, tab_lines
from fidim_lab.app.tui.screens.log import log_lines
from fidim_lab.app.tui.screens.plot import plot_lines
from fidim_lab.app.tui.screens.result import result_lines
from fidim_lab.app.tui.screens.rig import rig_lines
from fidim_lab.app.tui.screens.session import CURRENT, session_lines
from fidim_lab.app.tui.screens.why import check_lines, why_lines
from fidim_lab.app.tui.screens.window import window_lines
from fidim_lab.app.tui.view import ScreenState, Trace
from fidim_lab.app.tui.widgets.board import Board

NOTICE_FOR = 8.0
"""s that a notice stays"""
CURVES_EVERY = 0.3
"""s between two drawings of the curves: they are long, and nobody reads them faster"""
WINDOW, LOG, PLOT = TABS.index("Window"), TABS.index("Log"), TABS.index("Plot")


class Stage:
    """The widgets of the main screen, and what is drawn on them."""

    def __init__(self, folder: Path | None, clock: Clock) -> None:
        """folder: of the run, where no service says it."""
        self.current = 0
        self.foresight = Foresight()
        self.jobs = Jobs(clock)
        self.result_files = ResultFilesWatch(clock)
        self.state = Board(id="state", grow=True)
        self.tabs = Board(id="tabs", grow=True)
        self.prompt = Board(id="prompt", grow=True)
        self.keys = Board(id="keys", grow=True)
        self.filter = Input(id="filter", placeholder="words, -without these; Enter or Esc: back")
        self.boards = [Board(id=f"board-{name.lower()}", follow=name == "Log") for name in TABS]
        self._room = ContentSwitcher(initial=self.boards[0].id)
        self._given = folder
        self._notice = ("", 0.0)
        self._drawn = -1.0
        self._quantity = 0
        self._revealed: tuple[int | None, int] = (None, 0)

    def compose(self) -> ComposeResult:
        """State above, one of the screens, the prompt and the keys below."""
        yield self.state
        yield self.tabs
        with self._room:
            yield from (board for board in self.boards if board is not self.boards[LOG])
            with Vertical(id="log-pane"):
                yield self.filter
                yield self.boards[LOG]
        yield self.prompt
        yield self.keys

    def turn(self, index: int) -> None:
        """Show another part, and give it the keys; the plot once more: its next quantity."""
        self._quantity += index == self.current == PLOT
        self.current = index
        self._drawn = -1.0
        self._room.current = "log-pane" if index == LOG else self.boards[index].id
        self.boards[index].focus()

    def tell(self, text: str, now: float) -> None:
        """What was last said to the person at this screen."""
        self._notice = text, now + NOTICE_FOR

    def folder(self, view: ScreenState) -> Path | None:
        """The run's folder."""
        return self._given if view.welcome is None else Path(view.welcome.folder)

    def draw(self, view: ScreenState, over: Iterable[Board] = ()) -> None:
        """Draw; over: boards for the alarms, of dialogs that cover the screen. Raises nothing.

        What cannot be drawn is no reason to lose the keys.
        """
        try:
            self._draw(view, over)
        except Exception as error:
            self._draw_fault(view, f"✗ This screen cannot be drawn: {type(error).__name__}: {error}.")

    def _draw(self, view: ScreenState, over: Iterable[Board]) -> None:
        width = max(self.state.size.width, 40)
        self.foresight.look(view.trace if view.recording else Trace(), self.folder(view))
        notice = self._notice[0] if view.now < self._notice[1] else ""
        self.state.show(state_lines(view, width, notice))
        for covering in over:
            room = max(covering.size.width, 40)
            covering.show([*state_lines(view, room, notice), *prompt_lines(view, room, typing=self._typing)])
        self.tabs.show(tab_lines(self.current, width))
        self.prompt.show(prompt_lines(view, width, typing=self._typing))
        self.keys.show(key_lines(width))
        if self.current in (WINDOW, PLOT) and view.fresh and view.now - self._drawn < CURVES_EVERY:
            return
        self._drawn = view.now
        board = self.boards[self.current]
        room = self._room.size  # a board that was just turned to has no size of its own yet
        lines = self._lines(view, max(room.width - 1, 39), room.height)
        live = TABS[self.current] in ("Session", "Rig", "Window", "Plot")
        board.show(greyed(lines) if live and not view.fresh else lines)
        self._reveal(board, view)

    def _draw_fault(self, view: ScreenState, says: str) -> None:
        """As little as can be, where `draw` has failed: that it has, and the alarms if those can be drawn."""
        rows = block(says, 79, "bad")
        with suppress(Exception):
            rows += state_lines(view, max(self.state.size.width, 40))
        self.state.show(rows)

    @property
    def _typing(self) -> bool:
        """Whether letters go into a line of text now."""
        return isinstance(self.state.app.focused, Input)

    def _reveal(self, board: Board, view: ScreenState) -> None:
        """The row of the present window comes into sight when it becomes the present one, or a prompt takes room.

        When the run has ended, its last sentence does, which is above the table.
        """
        if TABS[self.current] != "Session":
            return
        rows = board.text.splitlines()
        ended = view.status is not None and view.status.phase == "ended"
        row = 0 if ended else next((k for k, text in enumerate(rows) if text.startswith(CURRENT)), None)
        now = row, board.size.height
        if row is not None and now != self._revealed:
            board.reveal(row)
        self._revealed = now

    def _lines(self, view: ScreenState, width: int, height: int) -> list[Line]:
        match TABS[self.current]:
            case "Session":
                return session_lines(view, width, height)
            case "Rig":
                return rig_lines(view, width)
            case "Plot":
                return plot_lines(view, width, height, self._quantity)
            case "Window":
                return window_lines(view, width, height, self.foresight.found, self.foresight.doubt)
            case "Result":
                return result_lines(self.result_files.found, width, self.jobs.says(view.now))
            case "Why":
                return why_lines(
                    self.result_files.found, width, self.jobs.says(view.now), check_lines(view.events, width)
                )
            case _:
                return log_lines(view, width, self.filter.value)
