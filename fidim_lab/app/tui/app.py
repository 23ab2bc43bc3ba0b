"""The Textual application: orders from any screen, the emergency stop over everything, ten drawings a second."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar

from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.worker import Worker

from drivers.ports import Clock
from fidim_lab.app.tui.dialogs import Confirm, Reason
from fidim_lab.app.tui.link import Link
from fidim_lab.app.tui.main_screen import MainScreen
from fidim_lab.app.tui.orders import Orders, Person, Verb
from fidim_lab.app.tui.reopen import reopen
from fidim_lab.app.tui.stage import Stage
from fidim_lab.app.tui.themes import DARK, LIGHT
from fidim_lab.app.tui.view import View
from fidim_lab.app.tui.widgets.board import Board
from fidim_lab.errors import SetupError

PERIOD = 0.1
"""s between two drawings"""


class FidimUi(App[None]):
    """A screen for one service. It may be closed at any time: the experiment does not care."""

    TITLE = "fidim"
    CSS_PATH = "styles.tcss"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("f12,ctrl+e", "emergency_stop", "E-STOP", key_display="F12", priority=True),
        Binding("r", "order('reset')", "reset"),
        Binding("g", "order('start')", "go"),
        Binding("p", "order('pause')", "pause"),
        Binding("k", "order('skip')", "skip"),
        Binding("o", "order('retry')", "once more"),
        Binding("x", "order('abort')", "abort"),
        Binding("t", "order('lease')", "take command", show=False),
        Binding("q", "quit", "leave"),
    ]

    def __init__(self, link: Link, clock: Clock, folder: Path | None = None, *, light: bool = False) -> None:
        """folder: of a run whose papers are shown where no service says its own."""
        super().__init__()
        self.stage = Stage(folder)
        self.link = link
        self._clock = clock
        self._orders = Orders(link, Person(self._tell, self._confirm, self._reason), self._reopen)
        self._ordering: Worker[None] | None = None
        self._rung = 0
        self.register_theme(DARK)
        self.register_theme(LIGHT)
        self.theme = LIGHT.name if light else DARK.name

    def get_default_screen(self) -> Screen[Any]:
        """The screen under all dialogs."""
        return MainScreen(self.stage, self.link, self._orders)

    def on_mount(self) -> None:
        """Begin to listen and to draw."""
        self.run_worker(self.link.run())
        self.set_interval(PERIOD, self._draw)

    async def on_unmount(self) -> None:
        """What was started beside the screen ends with it; the service does not."""
        self.stage.jobs.close()
        await self.stage.foresight.close()

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """The command palette: every order and screen by name, and the theme."""
        for bindings, space in ((FidimUi.BINDINGS, "app"), (MainScreen.BINDINGS, "screen")):
            for binding in bindings:
                if isinstance(binding, Binding) and binding.description:
                    yield self._command(binding, space)
        other = DARK.name if self.theme == LIGHT.name else LIGHT.name
        yield SystemCommand("light or dark", f"theme {other}", lambda: setattr(self, "theme", other))

    def action_emergency_stop(self) -> None:
        """Over everything, whatever is open."""
        self.run_worker(self._orders.emergency_stop())

    def action_order(self, verb: Verb) -> None:
        """One of the orders; the next only after its questions."""
        if self._ordering is None or self._ordering.is_finished:
            self._ordering = self.run_worker(self._orders.give(verb))

    def _command(self, binding: Binding, space: str) -> SystemCommand:
        action = f"{space}.{binding.action}"
        keys = binding.key_display or binding.key
        return SystemCommand(binding.description, f"key {keys}", lambda: self.call_later(self.run_action, action))

    def _draw(self) -> None:
        view = self.link.view()
        covering = self.screen.query("#alarms").results(Board) if len(self.screen_stack) > 1 else ()
        self.stage.draw(view, covering)
        if view.question is not None and view.question.number != self._rung:
            self._rung = view.question.number
            self.bell()

    def _tell(self, text: str) -> None:
        self.stage.tell(text, self._clock.now())
        self._draw()

    async def _reopen(self, view: View) -> str:
        """The service of the run that this screen shows."""
        folder = self.stage.folder(view)
        if folder is None:
            raise SetupError("This screen has seen no run.", hint="fidim run PLAN --rig RIG begins one.")
        return await reopen(folder)

    async def _confirm(self, title: str, says: tuple[str, ...], yes: str) -> bool:
        return bool(await self.push_screen_wait(Confirm(title, says, yes)))

    async def _reason(self, title: str, proposal: str) -> str:
        return await self.push_screen_wait(Reason(title, proposal)) or ""
