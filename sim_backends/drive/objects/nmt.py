"""Network management of a node: NMT states, its heartbeat, its watch over others' heartbeats, node guarding."""

import math
from enum import IntEnum

from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.dictionary import Dictionary


class NodeState(IntEnum):
    """States; the value is what a heartbeat says."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class MasterCommand(IntEnum):
    """Commands of the NMT master."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


def nmt_command(data: bytes, node_id: int) -> MasterCommand | None:
    """The command in an NMT frame, if it is one and for this node (or for all, node 0)."""
    if len(data) != 2 or data[1] not in (0, node_id):
        return None
    return next((command for command in MasterCommand if command == data[0]), None)


class HeartbeatProducer:
    """Says every 1017 ms that this node lives."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self.due = math.inf
        """when the next one is to be sent, s"""

    def restart(self, t: float) -> None:
        """1017 was written, or the node has started: the first one comes at once."""
        self.due = t if self._dictionary.number(0x1017) else math.inf

    def sent(self, t: float) -> None:
        """One was sent at t; the next keeps the rhythm where it can."""
        period = 1e-3 * self._dictionary.number(0x1017)
        self.due = self.due + period if self.due + period > t else t + period


class LifeGuard:
    """Node guarding: answers the master's remote frames with its state, and misses them (life guarding, 100C · 100D).

    It begins with the first of them after 100C and 100D were set. A node that sends heartbeats (1017) is not guarded.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._toggle = False
        self.due = math.inf
        """when the next one is missed, s"""
        self.first = False
        """whether the one that was answered last began the watch"""
        for index in (0x100C, 0x100D):
            dictionary.attach(index, watcher=lambda _subindex, _value: self._forget())

    def reset(self) -> None:
        """The node has started."""
        self._toggle = False
        self._forget()

    def answer(self, state: NodeState, t: float) -> bytes | None:
        """To a remote frame at t: the state below a bit that changes each time; None where there is no such service."""
        if isinstance(self._dictionary.find(0x100C), AbortCode) or self._dictionary.number(0x1017):
            return None
        life = 1e-3 * self._dictionary.number(0x100C) * self._dictionary.number(0x100D)
        self.first = bool(life) and self.due == math.inf
        self.due = t + life if life else math.inf
        data = bytes([self._toggle << 7 | state])
        self._toggle = not self._toggle
        return data

    def missed(self, t: float) -> bool:
        """Whether the master has been silent for too long at t; told once."""
        late = t >= self.due
        if late:
            self._forget()
        return late

    def _forget(self) -> None:
        self.due = math.inf


class HeartbeatWatch:
    """Watches the nodes in 1016, each from the first heartbeat heard after it was configured.

    A boot-up message is no heartbeat. A loss is told once; the watch begins again with the next heartbeat.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._periods: dict[int, float] = {}
        self._deadlines: dict[int, float] = {}
        self.stale = True
        """the set of watched nodes may have changed"""
        dictionary.attach(0x1016, guard=self._check, watcher=self._reconfigure)

    @property
    def due(self) -> float:
        """When the next watched node will be missed, s."""
        return min(self._deadlines.values(), default=math.inf)

    @property
    def watched(self) -> list[int]:
        """Node ids in 1016."""
        return list(self._periods)

    def reset(self) -> None:
        """Read 1016 anew."""
        self._periods = {}
        self._deadlines = {}
        self._reconfigure(0, 0)

    def hear(self, node: int, data: bytes, t: float) -> bool:
        """A heartbeat of a watched node; True where it is the first one."""
        period = self._periods.get(node)
        if period is None or len(data) != 1 or data[0] & 0x7F == NodeState.INITIALISING:
            return False
        first = node not in self._deadlines
        self._deadlines[node] = t + period
        return first

    def missed(self, t: float) -> bool:
        """Whether some node has been silent for too long at t; told once."""
        late = [node for node, deadline in self._deadlines.items() if t >= deadline]
        for node in late:
            del self._deadlines[node]
        return bool(late)

    def _reconfigure(self, _subindex: int, _value: int) -> None:
        wanted: dict[int, float] = {}
        for subindex in range(1, self._dictionary.number(0x1016, 0) + 1):
            value = self._dictionary.number(0x1016, subindex)
            node, milliseconds = value >> 16 & 0x7F, value & 0xFFFF
            if node and milliseconds:
                wanted[node] = 1e-3 * milliseconds
        self._deadlines = {n: t for n, t in self._deadlines.items() if wanted.get(n) == self._periods.get(n)}
        self._periods = wanted
        self.stale = True

    def _check(self, subindex: int, value: int) -> AbortCode | None:
        node = value >> 16 & 0xFF
        if node > 127:
            return AbortCode.VALUE
        others = [s for s in range(1, self._dictionary.number(0x1016, 0) + 1) if s != subindex]
        doubled = (
            node
            and value & 0xFFFF
            and any(
                self._dictionary.number(0x1016, s) >> 16 & 0x7F == node and self._dictionary.number(0x1016, s) & 0xFFFF
                for s in others
            )
        )
        return AbortCode.INCOMPATIBLE if doubled else None
