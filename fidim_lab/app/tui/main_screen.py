"""The one screen that everything is drawn on: the part in sight, and the keys that command nothing but it."""

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen

from fidim_lab.app.tui.dialogs import Help
from fidim_lab.app.tui.help import help_lines
from fidim_lab.app.tui.jobs import Work
from fidim_lab.app.tui.link import Link
from fidim_lab.app.tui.screens.bars import TABS
from fidim_lab.app.tui.stage import Stage

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
