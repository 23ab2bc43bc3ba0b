"""A widget that shows lines and redraws only those that have changed: ten times a second without flicker."""

from collections.abc import Sequence
from typing import ClassVar, get_args

from rich.segment import Segment
from rich.style import Style as RichStyle
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

from fidim_lab.app.tui.paint import EMPTY, Line, Span, Style, text_of
from fidim_lab.say import printable


class Board(ScrollView, can_focus=True):
    """Lines, scrolled where they are more than fit. `show` new ones at any rate; what is equal costs nothing."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {f"board--{name}" for name in get_args(Style) if name}

    def __init__(self, *, id: str, follow: bool = False, grow: bool = False) -> None:
        """follow: keep the last line in sight, unless scrolled away. grow: as high as its lines."""
        super().__init__(id=id)
        self._lines: tuple[Line, ...] = ()
        self._follow = follow
        self._grow = grow
        self._at_end = True
        if grow:
            self.can_focus = False

    @property
    def text(self) -> str:
        """What is shown, as plain text."""
        return text_of(self._lines)

    def show(self, lines: Sequence[Line]) -> int:
        """Show these; returns how many lines were drawn anew."""
        before, self._lines = self._lines, tuple(lines)
        if len(before) != len(self._lines):
            self._resized()
            return len(self._lines)
        top = self.scroll_offset.y
        changed = [y for y, (old, new) in enumerate(zip(before, self._lines, strict=True)) if old != new]
        for y in changed:
            self.refresh(Region(0, y - top, self.size.width, 1))
        return len(changed)

    def reveal(self, y: int) -> None:
        """Bring this line into sight, if it is not."""
        if not 0 <= y - self.scroll_offset.y < self.size.height:
            self.scroll_to(y=max(y - self.size.height // 2, 0), animate=False)

    def render_line(self, y: int) -> Strip:
        """One line of the terminal."""
        index = y + self.scroll_offset.y
        row = self._lines[index] if index < len(self._lines) else EMPTY
        width, ground = self.size.width, self.rich_style
        segments = [Segment(printable(span.text), self._style(span, ground)) for span in row]
        return Strip(segments).adjust_cell_length(width, ground)

    def on_resize(self) -> None:
        """A board that follows keeps its last line in sight."""
        if self._follow and self._at_end:
            self.scroll_end(animate=False)

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        """Whoever scrolls up stays there; whoever comes back to the end follows again."""
        super().watch_scroll_y(old_value, new_value)
        if new_value < old_value:
            self._at_end = False
        if new_value >= self.max_scroll_y:
            self._at_end = True

    def _style(self, span: Span, ground: RichStyle) -> RichStyle:
        style = self.get_component_rich_style(f"board--{span.style}") if span.style else ground
        return style + RichStyle(meta={"@click": span.click}) if span.click else style

    def _resized(self) -> None:
        self.virtual_size = Size(self.size.width, len(self._lines))
        if self._grow:
            self.styles.height = len(self._lines)
            self.display = bool(self._lines)
        if self._follow and self._at_end:
            self.scroll_end(animate=False)
        self.refresh()
