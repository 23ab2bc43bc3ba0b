"""The direction of a drum's last motion, which decides the sign of the friction of gear and pulleys. Pure."""

from drivers.cia402.profile.scale import wrap32


class LastMotion:
    """Fed with every position; turns back and noise shorter than a threshold change nothing."""

    def __init__(self, threshold: int) -> None:
        """threshold: counts that it must go one way to count as having gone it."""
        self.direction = 0
        """+1: last towards rising counts, −1: towards falling ones, 0: not known yet"""
        self._threshold = max(threshold, 1)
        self._last: int | None = None
        self._place = self._low = self._high = 0

    def feed(self, position: int) -> None:
        """The next position (counts, 32 bits that may wrap)."""
        self._place += 0 if self._last is None else wrap32(position - self._last)
        self._last = position
        self._low, self._high = min(self._low, self._place), max(self._high, self._place)
        if self._place - self._low > self._threshold:
            self.direction, self._low = 1, self._place - self._threshold
        if self._high - self._place > self._threshold:
            self.direction, self._high = -1, self._place + self._threshold
