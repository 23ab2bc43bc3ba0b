"""Process data of one drive: what a SYNC, an event or a received PDO does."""

import math

from sim_backends.can_node import Outgoing
from sim_backends.drive.objects.dictionary import Dictionary
from sim_backends.drive.objects.emergency import PDO_TOO_LONG, PDO_TOO_SHORT, ErrorLog
from sim_backends.drive.objects.pdo_mapping import ReceivePdo, TransmitPdo, guard_pdos, receive_pdos, transmit_pdos

_LAST_CYCLIC = 240


class PdoUnit:
    """Sends TPDOs at SYNCs and events, and puts RPDOs into the dictionary, by the present mapping.

    At a SYNC the TPDOs are sampled first, then the synchronous RPDOs take effect. Type 254/255: on a change of the
    statusword, by the event timer, and when the node becomes operational.
    Not simulated: inhibit time, RTR, SYNC start value and counter, mapping finer than a byte.
    """

    def __init__(self, dictionary: Dictionary, errors: ErrorLog) -> None:
        self._dictionary = dictionary
        self._errors = errors
        self._synchronous: list[TransmitPdo] = []
        self._eventful: list[TransmitPdo] = []
        self._counts: dict[int, int] = {}
        self._sent: dict[int, bytes] = {}
        self._timers: dict[int, float] = {}
        self._pending: list[tuple[ReceivePdo, bytes]] = []
        self._statusword = -1
        self._controllable = False
        """whether some RPDO takes effect at a SYNC"""
        self.receivers: dict[int, ReceivePdo] = {}
        """RPDOs by COB-ID"""
        self.stale = True
        """the dictionary has changed, `rebuild` is due"""
        guard_pdos(dictionary, self._changed)

    def rebuild(self, t: float) -> None:
        """Read the PDO entries of the dictionary anew; event-driven PDOs will be sent at the next occasion."""
        self.stale = False
        pdos = transmit_pdos(self._dictionary)
        self._synchronous = [pdo for pdo in pdos if pdo.kind <= _LAST_CYCLIC]
        self._eventful = [pdo for pdo in pdos if pdo.kind > _LAST_CYCLIC]
        self._counts = {pdo.number: 0 for pdo in self._synchronous}
        self._timers = {pdo.number: t + pdo.period for pdo in self._eventful if pdo.period}
        self._sent = {}
        self._pending = []
        self._statusword = -1
        self.receivers = {pdo.cob_id: pdo for pdo in receive_pdos(self._dictionary)}
        self._controllable = any(pdo.kind <= _LAST_CYCLIC for pdo in self.receivers.values())

    @property
    def due(self) -> float:
        """When the next event timer runs out, s."""
        return min(self._timers.values(), default=math.inf)

    @property
    def lively(self) -> bool:
        """Whether a SYNC may lead to more than the PDOs it asks for."""
        return bool(self._eventful) or self._controllable

    def sync(self) -> list[Outgoing]:
        """What a SYNC makes the drive send; then synchronous RPDOs take effect."""
        frames: list[Outgoing] = []
        for pdo in self._synchronous:
            if pdo.kind == 1:
                frames.append((pdo.cob_id, pdo.pack()))
            elif pdo.kind == 0:
                frames += self._if_changed(pdo)
            else:
                self._counts[pdo.number] += 1
                if self._counts[pdo.number] >= pdo.kind:
                    self._counts[pdo.number] = 0
                    frames.append((pdo.cob_id, pdo.pack()))
        if self._pending:
            pending, self._pending = self._pending, []
            for pdo, data in pending:
                self._apply(pdo, data)
        return frames

    def events(self, t: float) -> list[Outgoing]:
        """Event-driven PDOs whose event has come."""
        if not self._eventful:
            return []
        word = self._dictionary.reader(0x6041 << 8)()
        changed = word != self._statusword
        self._statusword = int(word)
        frames: list[Outgoing] = []
        for pdo in self._eventful:
            elapsed = t >= self._timers.get(pdo.number, math.inf)
            if elapsed:
                self._timers[pdo.number] = t + pdo.period
            if elapsed or (changed and pdo.statusword):
                frames.append((pdo.cob_id, pdo.pack()))
        return frames

    def receive(self, cob_id: int, data: bytes) -> None:
        """An RPDO has come: now, or at the next SYNC if it is synchronous. Too short, it is not used (EMCY 8210)."""
        pdo = self.receivers[cob_id]
        if len(data) < pdo.size:
            self._errors.report(PDO_TOO_SHORT)
            return
        if len(data) > pdo.size:
            self._errors.report(PDO_TOO_LONG)
        else:
            self._errors.withdraw(PDO_TOO_SHORT)
            self._errors.withdraw(PDO_TOO_LONG)
        if pdo.kind <= _LAST_CYCLIC:
            self._pending.append((pdo, data))
        else:
            self._apply(pdo, data)

    def _apply(self, pdo: ReceivePdo, data: bytes) -> None:
        stored = [spec for spec, part in pdo.parts if self._dictionary.store(spec, data[part]) is None]
        for spec in sorted(stored, key=lambda spec: -spec.index):  # target and mode before the controlword
            self._dictionary.announce(spec)

    def _if_changed(self, pdo: TransmitPdo) -> list[Outgoing]:
        data = pdo.pack()
        if self._sent.get(pdo.number) == data:
            return []
        self._sent[pdo.number] = data
        return [(pdo.cob_id, data)]

    def _changed(self, _subindex: int, _value: int) -> None:
        self.stale = True
