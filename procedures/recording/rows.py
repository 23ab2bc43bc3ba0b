"""The rows of one window by frame number: t = (frame − first)/rate; a lost frame is a blank row, nothing is spliced."""

from collections.abc import Sequence

import numpy as np

from drivers.ports import MarkerFrame


class Rows:
    """Rows of one window: blank ones for lost frames, none for late or doubled ones."""

    def __init__(self, rate: float, count: int, columns: int) -> None:
        self._table = np.full((count, columns), np.nan)
        self._table[:, 0] = np.arange(count) / rate
        self._first: int | None = None
        self._next = 0

    @property
    def complete(self) -> bool:
        """Whether every row is there, blank or not."""
        return self._next >= len(self._table)

    def take(self, frame: MarkerFrame, values: Sequence[float]) -> range:
        """The new rows that this frame brings, itself the last; none when it is late, doubled, or past the end."""
        if self._first is None:
            self._first = frame.number
        index = frame.number - self._first
        begin = self._next
        if index < begin or self.complete:
            return range(0)
        if index < len(self._table):
            self._table[index, 1:] = values
        self._next = min(index + 1, len(self._table))
        return range(begin, self._next)

    def index(self, frame: MarkerFrame) -> int:
        """Which row is the frame's; it may be past the end."""
        return frame.number - (frame.number if self._first is None else self._first)

    def rest(self) -> range:
        """Blank rows up to the window's end."""
        begin, self._next = self._next, len(self._table)
        return range(begin, self._next)

    def row(self, index: int) -> np.ndarray:
        """(columns,) of one row, t first."""
        return self._table[index]

    def array(self) -> np.ndarray:
        """All rows, (N, columns)."""
        return self._table
