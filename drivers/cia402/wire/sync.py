"""Which SYNC sampled a TPDO: not the newest one before its arrival, but the next one not yet answered.

On a busy computer a frame may be taken from the bus after one or more further SYNCs have gone out. A bus keeps the
order of one node's frames, so the n-th sample belongs to the n-th SYNC, however late it is. Only a lost frame breaks
that; it shows as an answer that stays behind, while one that is merely late catches up at once.
"""

_KEPT = 1024
"""SYNCs whose instants are remembered: a second, at the highest rate"""
_CATCHES_UP = 0.5
"""s within which a late stream catches up; one that stays behind for longer has lost something. A busy computer can be
behind by a cycle or two for tenths of a second; after a loss, dates are a cycle too old meanwhile: on the safe side"""
_FEW = 2
"""cycles. What is behind by more comes in bursts until it has caught up; a sample for each SYNC, and still as far
behind, is a loss the sooner the farther it is behind: a cut of 0.12 s (30 cycles of 250 Hz) after 33 ms"""

_SURE = 25
"""cycles in a row that show another order of sending; fewer may be late frames of the cycle before"""


class SyncTimes:
    """The instants of the last SYNCs, monotonic s, numbered from 1; written by the control loop alone."""

    def __init__(self) -> None:
        self.count = 0
        self._times = [float("-inf")] * _KEPT

    @property
    def current(self) -> float:
        """Of the newest; −inf before the first."""
        return self._times[self.count % _KEPT]

    def advance(self, t: float) -> None:
        """A SYNC goes out at `t`."""
        self._times[(self.count + 1) % _KEPT] = t
        self.count += 1

    def time(self, number: int) -> float:
        """Of a SYNC by its number; of the oldest that is remembered where it is older."""
        return self._times[max(number, self.count - _KEPT + 1) % _KEPT]


class SyncAnswers:
    """Dates the TPDOs of one node. One thread (the receiving one) uses it.

    What begins a sample is the part that comes first: the lowest identifier, unless the drive is seen to send in
    another order again and again.
    """

    def __init__(self, sync: SyncTimes, parts: int) -> None:
        """parts: how many TPDOs make one sample."""
        self._sync = sync
        self._number: int | None = None
        """the SYNC that the newest sample answers"""
        self._parts: set[int] = set()
        self._behind_since: float | None = None
        self._least = 0
        self._order = _SendingOrder(parts)
        self.late = 0
        """samples that came after a further SYNC"""

    def restart(self) -> None:
        """The node begins anew: what comes next answers the newest SYNC."""
        self._number = None

    def date(self, part: int) -> float:
        """The instant of the SYNC (monotonic s) that a frame of TPDO `part` (from 0) answers; −inf before the first."""
        first = self._order.first(part, self._sync.count)
        number = self._number
        if part == first or part in self._parts or number is None:
            number = self._number = self._next()
            self._parts.clear()
        self._parts.add(part)
        return self._sync.time(number)

    def _next(self) -> int:
        newest = self._sync.count
        number = newest if self._number is None else min(self._number + 1, newest)
        behind = newest - number
        if not behind:
            self._behind_since = None
            return number
        self.late += 1
        now = self._sync.current
        if self._behind_since is None:
            self._behind_since, self._least = now, behind
        self._least = min(self._least, behind)
        if now - self._sync.time(number) > _CATCHES_UP:  # it has been silent, and begins anew
            self._least = behind
        elif now - self._behind_since < _CATCHES_UP * min(1.0, _FEW / max(self._least, 1)):
            return number
        self._behind_since = None
        return number + self._least


class _SendingOrder:
    """Which part a drive sends first, from cycles in which each part came just once."""

    def __init__(self, parts: int) -> None:
        self._all = list(range(parts))
        self._first = 0
        self._cycle = 0
        self._came: list[int] = []
        self._otherwise = 0

    def first(self, part: int, cycle: int) -> int:
        """As far as known when a part comes after SYNC number `cycle`."""
        if cycle != self._cycle:
            if cycle == self._cycle + 1 and sorted(self._came) == self._all:
                self._otherwise = 0 if self._came[0] == self._first else self._otherwise + 1
                if self._otherwise >= _SURE:
                    self._first, self._otherwise = self._came[0], 0
            self._cycle, self._came = cycle, []
        self._came.append(part)
        return self._first
