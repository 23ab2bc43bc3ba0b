"""Questions of the UI's own, over the screen: confirm, give a reason, read help, choose an order by name.

The emergency stop works over each, and each shows state, alarms and an open prompt: what it covers is not lost.
"""

from collections.abc import Sequence
from typing import ClassVar, TypeVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.command import CommandPalette
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input

from fidim_lab.app.tui.paint import Line, Span, block, fitted, line
from fidim_lab.app.tui.widgets.board import Board

WIDTH = 66
FRAME = 6
"""columns of a dialog's frame and margin"""
Result = TypeVar("Result")


class Dialog(ModalScreen[Result]):
    """Over the screen."""

    OWN_KEYS: ClassVar[frozenset[str]] = frozenset()
    """letters with a meaning here: they answer no prompt"""

    @property
    def room(self) -> int:
        """Columns for text."""
        return min(WIDTH, max(self.app.size.width - FRAME, 20))


class Palette(CommandPalette):
    """The command palette, with state, alarms and prompt in sight."""

    def compose(self) -> ComposeResult:
        """Them, then what a palette has."""
        yield Board(id="alarms", grow=True)
        yield from super().compose()


class Confirm(Dialog[bool]):
    """A question that y answers; anything else leaves things as they are."""

    OWN_KEYS: ClassVar[frozenset[str]] = frozenset("yn")
    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "dismiss(True)", "yes"),
        ("n", "dismiss(False)", "no"),
        ("escape", "dismiss(False)", "no"),
    ]

    def __init__(self, title: str, says: Sequence[str], yes: str) -> None:
        super().__init__()
        self._title, self._says, self._yes = title, says, yes

    def compose(self) -> ComposeResult:
        """A box with lines."""
        with Vertical(classes="dialog"):
            yield Board(id="alarms", grow=True)
            yield Board(id="question", grow=True)
            yield Board(id="answers", grow=True)

    def on_resize(self) -> None:
        """Show the lines; the answers stay in sight where the text must be scrolled."""
        width = self.room
        rows: list[Line] = [*block(self._title, width, "head"), ()]
        for text in self._says:
            rows += block(text, width)
        keys = fitted(f"[y] {self._yes}   [n] no   F12 stops", width)
        self.query_one("#question", Board).show([*rows, ()])
        self.query_one("#answers", Board).show([line(Span(row, "key")) for row in keys])


class Reason(Dialog[str]):
    """Why something is done, for the journal; empty when it is not to be done."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape", "dismiss('')", "no")]

    def __init__(self, title: str, default: str) -> None:
        super().__init__()
        self._title = title
        self._default = default

    def compose(self) -> ComposeResult:
        """A box with a line to type in."""
        with Vertical(classes="dialog"):
            yield Board(id="alarms", grow=True)
            yield Board(id="question", grow=True)
            yield Input(value=self._default, max_length=200)

    def on_mount(self) -> None:
        """Show the question; what is typed replaces the proposed reason."""
        keys = [line(Span(row, "key")) for row in fitted("[Enter] do it   Esc: no   F12: emergency stop", self.room)]
        self.query_one("#question", Board).show([*block(self._title, self.room, "head"), *keys])
        self.query_one(Input).focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Enter."""
        self.dismiss(event.value.strip() or self._default)


class Help(Dialog[None]):
    """What the keys do, and what this screen shows."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "dismiss", "close"),
        ("question_mark", "dismiss", "close"),
        ("f1", "dismiss", "close"),
        ("q", "dismiss", "close"),
    ]

    def __init__(self, lines: Sequence[Line]) -> None:
        super().__init__()
        self._lines = lines

    def compose(self) -> ComposeResult:
        """A box that scrolls."""
        with Vertical(classes="dialog help"):
            yield Board(id="alarms", grow=True)
            yield Board(id="help")

    def on_mount(self) -> None:
        """Show the text."""
        board = self.query_one("#help", Board)
        board.show(self._lines)
        board.focus()
