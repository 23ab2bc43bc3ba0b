"""The CiA 301 side of a drive: NMT state, who handles which identifier, heartbeats both ways, SDO, PDO, EMCY."""

import math
from collections.abc import Callable

from drivers.canbus.transport import CanFrame
from sim_backends.can_node import Outgoing
from sim_backends.drive.axis.axis import Axis
from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.faults import DriveFaults
from sim_backends.drive.objects.dictionary import Dictionary
from sim_backends.drive.objects.emergency import HEARTBEAT_LOST, ErrorLog
from sim_backends.drive.objects.nmt import (
    HeartbeatProducer,
    HeartbeatWatch,
    LifeGuard,
    MasterCommand,
    NodeState,
    nmt_command,
)
from sim_backends.drive.objects.pdo_unit import PdoUnit
from sim_backends.drive.objects.sdo_server import SdoServer

SYNC_LOST = 0x8700
"""emergency code"""
SYNC_PERIODS = 5.0
"""of 1006 without SYNC after which it is missed"""
_NMT, _SYNC, _EMERGENCY, _SDO_ANSWER, _SDO_REQUEST, _HEARTBEAT = 0x000, 0x080, 0x080, 0x580, 0x600, 0x700
_OFF = 1 << 31
_ENTERED = {
    MasterCommand.START: NodeState.OPERATIONAL,
    MasterCommand.STOP: NodeState.STOPPED,
    MasterCommand.ENTER_PRE_OPERATIONAL: NodeState.PRE_OPERATIONAL,
}
_COMMUNICATION_ERROR = {0: NodeState.PRE_OPERATIONAL, 2: NodeState.STOPPED}
"""1029:1 – the state that an operational node falls back to when it misses a heartbeat"""


class Communication:
    """What a node says and hears; frames to send gather in `outbox`."""

    def __init__(
        self, node_id: int, od: Dictionary, axis: Axis, errors: ErrorLog, faults: DriveFaults, defects: Defects
    ) -> None:
        self._defects = defects
        self._sync_due = math.inf
        """when the next SYNC is missed, s; infinity before the first, and where 1006 asks for none"""
        self._node_id = node_id
        self._od = od
        self._axis = axis
        self._errors = errors
        self._faults = faults
        self._sdo = SdoServer(od)
        self._pdos = PdoUnit(od, errors)
        self._producer = HeartbeatProducer(od)
        self._watch = HeartbeatWatch(od)
        self._guard = LifeGuard(od)
        od.attach(0x1017, watcher=lambda _subindex, _value: self._producer.restart(axis.feedback.now))
        self._late: list[tuple[float, Outgoing]] = []
        self.state = NodeState.INITIALISING
        self.routes: dict[int, Callable[[CanFrame], None]] = {}
        """what to do with which identifier in the present state"""
        self.outbox: list[Outgoing] = []

    @property
    def due(self) -> float:
        """When something is next to be sent or noticed, s."""
        late = self._late[0][0] if self._late else math.inf
        events = self._pdos.due if self.state is NodeState.OPERATIONAL else math.inf
        return min(late, events, self._producer.due, self._watch.due, self._guard.due, self._sync_due)

    @property
    def lively(self) -> bool:
        """Whether a SYNC may lead to more than the PDOs it asks for."""
        return self._pdos.lively or bool(self._od.number(0x1006))

    def handler(self, frame: CanFrame) -> Callable[[CanFrame], None] | None:
        """What to do with a frame in the present state; remote frames ask for the node's state and nothing else."""
        guarding = frame.id == _HEARTBEAT + self._node_id
        return self.routes.get(frame.id) if frame.remote is guarding else None

    def boot(self) -> None:
        """Announce the node, and be pre-operational with the dictionary as it is."""
        self._sdo.reset()
        self._watch.reset()
        self._guard.reset()
        self._sync_due = math.inf
        self._late.clear()
        self.outbox.append((_HEARTBEAT + self._node_id, b"\x00"))
        self._producer.restart(self._axis.feedback.now)
        self.state = NodeState.INITIALISING
        self._enter(NodeState.PRE_OPERATIONAL)

    def live(self, now: float) -> None:
        """Do what is due: heartbeat, watchdog, late answers."""
        if now >= self._sync_due:
            self._sync_due = math.inf
            if not self._defects.sync_ignored:
                self._errors.report(SYNC_LOST)
                self._axis.abort_connection()
        missed = [watch.missed(now) for watch in (self._watch, self._guard) if now >= watch.due]
        if any(missed) and not self._defects.heartbeat_ignored:
            self._errors.report(HEARTBEAT_LOST)
            self._axis.abort_connection()
            self.settle(now)
            fallback = _COMMUNICATION_ERROR.get(self._od.number(0x1029, 1))
            if self.state is NodeState.OPERATIONAL and fallback is not None:
                self._enter(fallback)
        if now >= self._producer.due:
            self.outbox.append((_HEARTBEAT + self._node_id, bytes([self.state])))
            self._producer.sent(now)
        while self._late and self._late[0][0] <= now:
            self.outbox.append(self._late.pop(0)[1])

    def settle(self, now: float) -> None:
        """After anything has happened: emergencies and event-driven PDOs."""
        if self._pdos.stale or self._watch.stale:
            self._route()
        emergency = self._od.number(0x1014, default=_EMERGENCY + self._node_id)
        for message in self._errors.take():
            if self.state in (NodeState.OPERATIONAL, NodeState.PRE_OPERATIONAL) and not emergency & _OFF:
                self.outbox.append((emergency & 0x7FF, message))
        if self.state is NodeState.OPERATIONAL:
            self.outbox += self._pdos.events(now)

    def _enter(self, state: NodeState) -> None:
        if state is NodeState.STOPPED and self.state is not NodeState.STOPPED and self._axis.feedback.powered:
            self._axis.abort_connection()
            self.settle(self._axis.feedback.now)
        entering, self.state = state is not self.state, state
        if state is NodeState.STOPPED:
            self._sync_due = math.inf  # it hears none
        if entering:
            self._pdos.stale = True
        self.settle(self._axis.feedback.now)

    def _route(self) -> None:
        self._watch.stale = False
        if self._pdos.stale:
            self._pdos.rebuild(self._axis.feedback.now)
        routes: dict[int, Callable[[CanFrame], None]] = {_NMT: self._command}
        routes[_HEARTBEAT + self._node_id] = self._answer_guarding
        if self.state is NodeState.OPERATIONAL:
            for cob_id in self._pdos.receivers:
                routes[cob_id] = self._process
        if self.state is not NodeState.STOPPED:
            routes[_SYNC] = self._sync
            routes[_SDO_REQUEST + self._node_id] = self._serve
        for node in self._watch.watched:
            routes[_HEARTBEAT + node] = self._hear
        self.routes = routes

    def _command(self, frame: CanFrame) -> None:
        command = nmt_command(frame.data, self._node_id)
        if command is None:
            return
        if command in _ENTERED:
            self._enter(_ENTERED[command])
            return
        if self._axis.feedback.powered:
            self._axis.abort_connection()
        if command is MasterCommand.RESET_NODE:
            self.restart()
            return
        self._od.restore(0x1000, 0x1FFF)
        self._errors.discard()
        self.boot()

    def restart(self) -> None:
        """Everything as at power-on, but where the shaft is."""
        self._od.restore(0x1000, 0x9FFF)
        self._axis.reset()
        self._errors.discard()
        self.boot()

    def _serve(self, frame: CanFrame) -> None:
        if self._faults.sdo_silent:
            return
        answer = self._sdo.answer(frame.data)
        if answer is None:
            return
        message = (_SDO_ANSWER + self._node_id, answer)
        if self._faults.sdo_delay > 0.0:
            self._late.append((frame.t + self._faults.sdo_delay, message))
        else:
            self.outbox.append(message)

    def _sync(self, frame: CanFrame) -> None:
        if len(frame.data) <= 1:
            if period := self._od.number(0x1006):
                self._sync_due = frame.t + SYNC_PERIODS * 1e-6 * period
                self._errors.withdraw(SYNC_LOST)
            if self.state is NodeState.OPERATIONAL:
                self.outbox += self._pdos.sync()

    def _process(self, frame: CanFrame) -> None:
        self._pdos.receive(frame.id, frame.data)

    def _answer_guarding(self, frame: CanFrame) -> None:
        if (answer := self._guard.answer(self.state, frame.t)) is not None:
            self.outbox.append((_HEARTBEAT + self._node_id, answer))
            if self._guard.first:
                self._errors.withdraw(HEARTBEAT_LOST)

    def _hear(self, frame: CanFrame) -> None:
        if self._watch.hear(frame.id - _HEARTBEAT, frame.data, frame.t):
            self._errors.withdraw(HEARTBEAT_LOST)
