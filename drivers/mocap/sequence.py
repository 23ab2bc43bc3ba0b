"""Frame-number sequencing, shared by all sources: arrivals become frames in the device's order.

Nothing is ever invented: a frame that did not come is missing. The cases, with the window w (frames):

    next number                     passed on at once
    up to w missing before it       held until they come, or until w frames have passed: then they are lost
    more missing, or far back       a candidate: believed once a second frame bears it out (a gap, or the device's
                                    counter was reset), else left out: a damaged number must not cost a thousand frames
    a little back                   late (it had been given up, or is from before the first) or doubled; left out
    a long run a little back        the counter was reset shortly after it started

The first frame of all, and of each new connection, is such a candidate too. A wrapped counter (modulus) just goes on:
the numbers passed on are unwrapped. After a reset they start again where the device does.
"""

from dataclasses import dataclass, replace

from drivers.ports import MarkerFrame

HORIZON = 256
"""frames: further back than this is no late frame but another count"""
RUN = 16
"""consecutive frames a little back that make a reset"""


@dataclass
class SequenceCounts:
    """How many frames met which fate."""

    received: int = 0
    """well-formed frames that arrived"""
    lost: int = 0
    """numbers that did not arrive in time"""
    late: int = 0
    """arrived after they were given up as lost (and were counted so), or from before the first one"""
    doubled: int = 0
    """arrived a second time"""
    misnumbered: int = 0
    """a wild number that no second frame bore out"""
    resets: int = 0
    """the device started to count again"""


class Sequencer:
    """Puts frames in order of their number. `push` one after the other; it returns those whose turn has come."""

    def __init__(self, *, window: int = 4, modulus: int | None = None) -> None:
        self.counts = SequenceCounts()
        self._window = window
        self._modulus = modulus
        self._synchronised = False
        self._expected: int | None = None
        self._first = 0
        self._held: dict[int, MarkerFrame] = {}
        self._candidate: MarkerFrame | None = None
        self._given_up: set[int] = set()
        self._run = (0, 0)

    def push(self, frame: MarkerFrame) -> list[MarkerFrame]:
        """The frames whose turn has come with this one, in order."""
        self.counts.received += 1
        if self._expected == frame.number and self._synchronised and not self._held and self._candidate is None:
            self._expected = frame.number + 1
            return [frame]
        if not self._synchronised or self._expected is None:
            return self._judge(frame)
        ahead = self._ahead(frame.number, self._expected)
        newest = max(self._held, default=self._expected - 1)
        if not -HORIZON <= ahead <= newest - self._expected + 1 + self._window:
            return self._judge(frame)
        if (candidate := self._candidate) is not None:
            if 0 < abs(self._ahead(frame.number, candidate.number)) <= self._window:
                return self._believe(candidate, frame)  # a short way back, seen from a candidate far back
            self._disbelieve()
        if ahead < 0:
            return self._behind(frame, self._expected + ahead)
        self._hold(frame, self._expected + ahead)
        return self._due(self._window)

    def flush(self) -> list[MarkerFrame]:
        """Give up what is missing and pass on all that is held: the stream pauses or ends."""
        return self._due(1)

    def restart(self) -> list[MarkerFrame]:
        """A new connection: pass on all that is held and take the count up again wherever it will be."""
        due = self.flush()
        self._disbelieve()
        self._synchronised = False
        return due

    def _ahead(self, number: int, reference: int) -> int:
        """How far a number is ahead of a reference, by the shorter way round where the counter wraps."""
        if self._modulus is None:
            return number - reference
        half = self._modulus // 2
        return (number - reference + half) % self._modulus - half

    def _judge(self, frame: MarkerFrame) -> list[MarkerFrame]:
        """A number from nowhere: wait for a second one that bears it out."""
        if (candidate := self._candidate) is not None:
            distance = abs(self._ahead(frame.number, candidate.number))
            if distance == 0:
                self.counts.doubled += 1
                return []
            if distance <= self._window:
                return self._believe(candidate, frame)
            self._disbelieve()
        self._candidate = frame
        return []

    def _believe(self, candidate: MarkerFrame, second: MarkerFrame) -> list[MarkerFrame]:
        """Two frames agree on where the count is: go on from the lower one."""
        due = self.flush()
        self._candidate = None
        lower = candidate if self._ahead(second.number, candidate.number) > 0 else second
        ahead = 0 if self._expected is None else self._ahead(lower.number, self._expected)
        if self._expected is None or ahead < 0:
            self.counts.resets += self._expected is not None
            self._given_up.clear()
            self._expected = self._first = lower.number
        else:
            self._give_up(self._expected, self._expected + ahead)
        self._synchronised = True
        for frame in (candidate, second):
            self._hold(frame, self._expected + self._ahead(frame.number, self._expected))
        return due + self._due(self._window)

    def _disbelieve(self) -> None:
        if self._candidate is not None:
            self._candidate = None
            self.counts.misnumbered += 1

    def _behind(self, frame: MarkerFrame, number: int) -> list[MarkerFrame]:
        """A little back: late, doubled, or, in a long run, a counter that was reset soon after it started."""
        last, length = self._run
        self._run = (number, length + 1 if number == last + 1 else 1)
        if self._run[1] >= RUN and number not in self._given_up:
            self._run = (0, 0)
            self._candidate, self._synchronised = frame, False
            return []
        if number in self._given_up or number < self._first:
            self._given_up.discard(number)
            self.counts.late += 1
        else:
            self.counts.doubled += 1
        return []

    def _hold(self, frame: MarkerFrame, number: int) -> None:
        if number in self._held:
            self.counts.doubled += 1
        else:
            self._held[number] = frame if frame.number == number else replace(frame, number=number)

    def _due(self, window: int) -> list[MarkerFrame]:
        """Held frames whose turn has come; a gap is given up once the newest held frame is `window` beyond it."""
        due: list[MarkerFrame] = []
        if self._expected is None:
            return due
        while self._held:
            if (frame := self._held.pop(self._expected, None)) is not None:
                due.append(frame)
                self._expected += 1
            elif max(self._held) - self._expected >= window:
                self._give_up(self._expected, min(self._held))
            else:
                break
        return due

    def _give_up(self, start: int, stop: int) -> None:
        self.counts.lost += stop - start
        self._expected = stop
        if stop > start:
            recent = range(max(start, stop - HORIZON), stop)
            self._given_up = {number for number in self._given_up if number >= stop - HORIZON}.union(recent)
