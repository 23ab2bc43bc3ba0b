"""Other masters on this bus: frames that only a master sends, and that are not ours.

A bus delivers to a node only what others have sent, so every SYNC, NMT command, receive PDO, SDO request, guarding or
heartbeat of the host that arrives here is somebody else's: two masters undo each other's stops. Two drives with one
node id both take every command; they show by two answers to a question, and by two TPDOs in each cycle that differ.
"""

import re
from collections import Counter
from collections.abc import Iterable

from drivers.canbus.transport import CanFrame

SDO_REQUEST = 0x600
_RPDOS = (0x200, 0x300, 0x400, 0x500)
_LSS_REQUEST = 0x7E5
ALL_NODES = range(1, 128)
END_IT = "Stop the other program (fidim stop, on the computer where it runs), or unplug it."


class Strangers:
    """Counts the frames of other masters; fed by the receiving thread with what others have sent."""

    def __init__(self, host_id: int, nodes: Iterable[int] = ALL_NODES) -> None:
        """nodes: ids of the drives (any, where they are not known)."""
        self._names = {
            0x000: "NMT commands",
            0x080: "SYNC",
            _LSS_REQUEST: "LSS commands",
            0x700 + host_id: f"heartbeats of node {host_id}, the host's",
        }
        self.heard: Counter[str] = Counter()
        self._guarded: dict[int, str] = {}
        """remote frames that ask a drive for its state: they keep it from missing us"""
        for node in nodes:
            self.add(node)

    def add(self, node: int) -> None:
        """One more drive: who asks or commands it is a master."""
        self._names |= {function + node: f"commands (RPDO) to node {node}" for function in _RPDOS}
        self._names[SDO_REQUEST + node] = f"SDO requests to node {node}"
        self._guarded[0x700 + node] = f"remote frames (node guarding) to node {node}"

    def hear(self, frame: CanFrame) -> None:
        """One frame that somebody else has sent."""
        what = (self._guarded if frame.remote else self._names).get(frame.id)
        if what is not None:
            self.heard[what] += 1

    @property
    def says(self) -> str:
        """The frames heard, in words; empty without any."""
        return ", ".join(f"{count} {what if count > 1 else _one(what)}" for what, count in dict(self.heard).items())


def _one(what: str) -> str:
    """The noun of a single frame."""
    return re.sub(r"^(NMT command|LSS command|heartbeat|command|SDO request|remote frame)s", r"\1", what)


class TwinWatch:
    """Whether two nodes answer with one id, from what we asked and what came. Latched until `forget`.

    A frame that comes twice with the same contents is a gateway's or an adapter's doing; two drives differ in serial
    number, encoder or current.
    """

    EXTRA_ANSWERS = 3
    """questions with two answers that differ: after a time-out, the late answer is one"""
    CYCLES = 5
    """in a row with a TPDO twice, of different contents: a frame that is late by a cycle doubles one"""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._answer: bytes | None = None
        self._extra = self._cycles = self._contradicted = 0
        self._cycle: float | None = None
        self.says = ""
        """what shows it, in words; empty where nothing does"""

    def asked(self) -> None:
        """An SDO request to the node has passed, ours or another master's."""
        self._answer = None

    def answered(self, data: bytes) -> None:
        """An SDO answer of the node came."""
        first, self._answer = self._answer, data
        self._extra += first is not None and first != data
        if not self.says and self._extra >= self.EXTRA_ANSWERS:
            self.says = f"{self._extra} SDO questions had two answers that differ"

    def sampled(self, cycle: float, contradicted: int) -> None:
        """A TPDO came: the SYNC that it answers (s), and how many have contradicted another of their SYNC so far."""
        if cycle == self._cycle:
            return
        self._cycles = self._cycles + 1 if contradicted > self._contradicted else 0
        self._cycle, self._contradicted = cycle, contradicted
        if not self.says and self._cycles >= self.CYCLES:
            self.says = f"a TPDO comes twice in a cycle with different contents, {self._cycles} cycles in a row"

    def foreign_sync(self) -> None:
        """Somebody else's SYNC has passed: that a TPDO comes twice shows nothing now."""
        self._cycles = 0
