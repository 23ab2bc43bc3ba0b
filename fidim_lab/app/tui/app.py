"""The Textual application: orders from any screen, the emergency stop over everything, ten drawings a second.

After a run that has ended its service can be started again, latched, and the screen finds it. Nothing moves by that:
the emergency stop is reset (r) and the run begun (g) as in any other service.
"""

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar

from textual import events
from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.worker import Worker

from drivers.clock import LoopClock
from drivers.ports import Clock
from fidim_lab.app.formats.run_spec import RunSpec, again, read_spec
from fidim_lab.app.service.lock import holder
from fidim_lab.app.service.own_process import end_service, serves, service_process, until_it_listens
from fidim_lab.app.service.place import ServicePlace, place_of
from fidim_lab.app.tui.aside import Aside
from fidim_lab.app.tui.dialogs import Confirm, Dialog, Palette, Reason
from fidim_lab.app.tui.link import Link
from fidim_lab.app.tui.main_screen import MainScreen
from fidim_lab.app.tui.orders import Orders, Person, Verb
from fidim_lab.app.tui.screens.bars import KEYS, SETTLE, choice_keys
from fidim_lab.app.tui.stage import Stage
from fidim_lab.app.tui.themes import DARK, LIGHT
from fidim_lab.app.tui.view import Connection, ScreenState
from fidim_lab.app.tui.widgets.board import Board
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import RefusedError, SetupError

PERIOD = 0.1
"""s between two drawings"""
STDIN = 0
"""file descriptor; of a browser's UI it is a pipe"""


class FidimUi(App[None]):
    """A screen for one service. It may be closed at any time: the experiment does not care."""

    TITLE = "fidim"
    CSS_PATH = "styles.tcss"
    VERTICAL_BREAKPOINTS = [(0, "-low"), (20, "-high")]  # noqa: RUF012 - an instance variable of App
    """rows below which a dialog takes the whole terminal, without a frame"""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("f12,ctrl+e", "emergency_stop", "E-STOP", key_display="F12", priority=True),
        *(Binding(key, action[4:], word) for key, word, action in KEYS if action.startswith("app.") and len(key) == 1),
        Binding("t", "order('lease')", "take command", show=False),
    ]

    def __init__(
        self, link: Link, clock: Clock, folder: Path | None = None, *, light: bool = False, says: str = ""
    ) -> None:
        """folder: of a run whose result files are shown where no service says its own. says: the first notice."""
        super().__init__()
        self.fault: BaseException | None = None
        """what has ended the screen, where it was not a person"""
        self.stage = Stage(folder, clock)
        self.link = link
        self._clock = clock
        self._orders = Orders(link, Person(self._tell, self._confirm, self._reason), self._reopen)
        self._ordering: Worker[None] | None = None
        self._rung = 0
        self._says = says
        self.register_theme(DARK)
        self.register_theme(LIGHT)
        self.theme = LIGHT.name if light else DARK.name

    def get_default_screen(self) -> Screen[Any]:
        """The screen under all dialogs."""
        return MainScreen(self.stage, self.link)

    def on_mount(self) -> None:
        """Begin to listen and to draw."""
        if self._says:
            self._tell(self._says)
        self.run_worker(self.link.run())
        self.run_worker(self.stage.result_files.run(lambda: self.stage.folder(self.link.view())))
        self.set_interval(PERIOD, self._draw)
        if os.isatty(STDIN):
            self.set_interval(1.0, self._leave_if_the_terminal_is_gone)

    def _leave_if_the_terminal_is_gone(self) -> None:
        """Nobody sees it any more. Not every way to lose a terminal sends a hang-up, and textual would read on."""
        if not os.isatty(STDIN):
            self.exit()

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

    def on_key(self, event: events.Key) -> None:
        """A letter of the open prompt answers it, also from a dialog that shows it and has no use for the letter."""
        own = self.screen.OWN_KEYS if isinstance(self.screen, Dialog) else ()
        if event.key not in own and self._choose(event.key):
            event.prevent_default()

    def action_choose(self, key: str) -> None:
        """A click on a choice of the open prompt."""
        self._choose(key)

    def action_command_palette(self) -> None:
        """Every order by name, with the alarms above it."""
        if not isinstance(self.screen, Palette):
            self.push_screen(Palette(id="--command-palette"))

    def action_order(self, verb: Verb) -> None:
        """One of the orders; the next only after its questions."""
        if self._ordering is None or self._ordering.is_finished:
            self._ordering = self.run_worker(self._orders.give(verb))

    def _fatal_error(self) -> None:
        """Textual's own prints the whole stack on the terminal; `run_ui` begins anew instead, and says why."""
        self.fault = sys.exception()
        self._close_messages_no_wait()

    def _command(self, binding: Binding, space: str) -> SystemCommand:
        action = f"{space}.{binding.action}"
        keys = binding.key_display or binding.key
        return SystemCommand(binding.description, f"key {keys}", lambda: self.call_later(self.run_action, action))

    def _choose(self, key: str) -> bool:
        """Whether the key is one of the open prompt's. In its first moment a prompt takes none."""
        view = self.link.view()
        question = view.question
        if question is None or view.contact is not Connection.LIVE:
            return False
        choice = choice_keys(question.choices).get(key)
        if choice is not None and view.now - view.asked >= SETTLE:
            self.run_worker(self._orders.answer(question.number, choice))
        return choice is not None

    def _draw(self) -> None:
        view = self.link.view()
        covering = self.screen.query("#alarms").results(Board) if len(self.screen_stack) > 1 else ()
        self.stage.draw(view, covering)
        if view.question is not None and view.question.number != self._rung:
            self._rung = view.question.number
            self.bell()

    def _tell(self, text: str) -> None:
        self.stage.tell(text, self._clock.now())
        self.call_later(self._draw)  # never before the order itself is sent

    async def _reopen(self, view: ScreenState) -> str:
        """The service of the run that this screen shows."""
        folder = self.stage.folder(view)
        if folder is None:
            raise SetupError("This screen has no run yet.", hint="fidim run PLAN --rig RIG starts one.")
        return await reopen(folder)

    async def _confirm(self, title: str, says: tuple[str, ...], yes: str) -> bool:
        return bool(await self.push_screen_wait(Confirm(title, says, yes)))

    async def _reason(self, title: str, proposal: str) -> str:
        return await self.push_screen_wait(Reason(title, proposal)) or ""


async def reopen(folder: Path) -> str:
    """Start the service of the run in this folder; returns what was left out. Raises FidimError where it cannot be."""
    spec, place, says = await Aside(LoopClock()).run(lambda: _read(folder))
    if (who := holder(place)) is not None and serves(who, folder) and (refusal := await end_service(place)):
        raise RefusedError(f"The service of this run is still running, and {refusal}")
    with service_process(spec, place) as process:
        await until_it_listens(place, process)
    return says


def _read(folder: Path) -> tuple[RunSpec, ServicePlace, str]:
    spec = again(read_spec(folder), folder.absolute())
    if spec.procedure.endswith(".py"):
        raise RefusedError(
            f"The procedure is a Python file ({spec.procedure}).",
            hint=f"To be asked whether to execute it: fidim resume {folder}",
        )
    says = "Its commands on-finish and on-fault will not be executed. " if spec.on_finish or spec.on_fault else ""
    spec = spec.model_copy(update={"on_finish": "", "on_fault": ""})
    file = read_rig(spec.rig)
    return spec, place_of(file, embedded=spec.embedded, run=spec.own_place), says
