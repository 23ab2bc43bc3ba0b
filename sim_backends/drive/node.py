"""A CANopen servo drive in software: frames and time in, frames out, a shaft to move. Start reading here."""

import math
from collections.abc import KeysView

from drivers.canbus.transport import CanFrame
from fidim_lab.errors import OurBugError
from sim_backends.can_node import Outgoing
from sim_backends.drive.axis.axis import Axis
from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.machine import State
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.shaft import Shaft
from sim_backends.drive.communication import Communication
from sim_backends.drive.configuration import connect
from sim_backends.drive.faults import DriveFaults
from sim_backends.drive.objects.dictionary import Dictionary
from sim_backends.drive.objects.emergency import ErrorLog
from sim_backends.drive.objects.nmt import NodeState

CYCLE = 0.005
"""s of the drive's own cycle; it runs only while something moves"""
MAINS_LOST = 0x3120
"""emergency code of a supply that fails"""
_SYNC = 0x080


class SimulatedDrive:
    """One drive node: CiA 301 communication round a CiA 402 axis.

    Written from the standards, independently of the drivers that talk to it. Deterministic: what it does depends on
    the frames, their times and the load alone. Never raises on a frame, whatever is in it.

    Not simulated: everything electrical; bus errors and error frames; LSS, node guarding, TIME, block SDO, storing
    parameters (1010, 1011); transmission times on the bus; and what the parts say in their own docstrings (`Axis`,
    `Positioner`, `Feedback`, `PdoUnit`, `SdoServer`).
    """

    def __init__(
        self,
        node_id: int,
        od: Dictionary,
        shaft: Shaft,
        *,
        position: float = 0.0,
        make: Make = PROFILE,
        lag: float = 0.0,
    ) -> None:
        """`od` as `read_eds(path, node_id)` gives it; `position`: where the shaft is at power-on, counts.

        lag: s by which the shaft is behind the demand in motion, as a position loop's is (1/Kv); it shows in 60F4 and
        6062 alone. Raises OurBugError for a node id outside 1…127.
        """
        if not 1 <= node_id <= 127:
            raise OurBugError(f"a CANopen node id is 1…127, not {node_id}")
        self.node_id = node_id
        self.od = od
        errors = ErrorLog(od)
        self.defects = Defects()
        self._axis = Axis(od, shaft, errors, position, make, self.defects)
        self._axis.feedback.servo_lag = lag
        self.faults = DriveFaults(od, errors, self._axis, self._disturbed)
        connect(od, self._axis, errors, make)
        self._communication = Communication(node_id, od, self._axis, errors, self.faults, self.defects)
        self._cycle = math.inf
        """when the next cycle is due, s; infinity while nothing moves"""
        self._due = math.inf

    @property
    def state(self) -> State:
        """Of the CiA 402 machine."""
        return self._axis.state

    @property
    def nmt_state(self) -> NodeState:
        """Of the node."""
        return self._communication.state

    @property
    def listens(self) -> KeysView[int]:
        """Identifiers that concern this node in its present state."""
        return self._communication.routes.keys()

    @property
    def due(self) -> float:
        """When the drive will next do something by itself, s; infinity: never."""
        return self._due

    def start(self, t: float) -> list[Outgoing]:
        """Power comes: boot up and become pre-operational."""
        self._axis.feedback.sample(t)
        self._communication.boot()
        self._settle()
        return self._take()

    def cut_power(self) -> None:
        """The mains are gone: the brake holds, nothing is heard or said until `restore_power`."""
        self.faults.raise_fault(MAINS_LOST)
        self.faults.silent = True

    def restore_power(self, t: float) -> None:
        """The mains are back at time t: it boots, knows no setting of its host any more, and has no power stage on.

        Not simulated: an encoder that begins to count anew.
        """
        self._axis.feedback.sample(t)
        self.faults.silent = False
        self._communication.outbox.clear()
        self._communication.restart()
        self._disturbed()

    def receive(self, frame: CanFrame) -> list[Outgoing]:
        """Live until `frame.t`, then obey the frame; the frames that all this makes the drive send."""
        if frame.t >= self._due:
            self._live(frame.t)
        self._axis.feedback.sample(frame.t)
        handler = self._communication.handler(frame)
        if handler is not None and not self.faults.silent:
            handler(frame)
            if frame.id != _SYNC or self._communication.lively:
                self._settle()
        return self._take()

    def advance(self, t: float) -> list[Outgoing]:
        """Live until t: cycles, heartbeats, watchdogs, late answers, each at its own time; the frames to send."""
        if t >= self._due:
            self._live(t)
        self._axis.feedback.sample(t)
        return self._take()

    def _live(self, t: float) -> None:
        while self._due <= t:
            now = self._due
            self._axis.feedback.sample(now)
            if now >= self._cycle:
                self._cycle += CYCLE
                self._axis.tick()
            self._communication.live(now)
            self._settle()

    def _settle(self) -> None:
        """After anything has happened: what follows from it, and when the next thing is due."""
        now = self._axis.feedback.now
        self._communication.settle(now)
        if not self._axis.busy:
            self._cycle = math.inf
        elif self._cycle == math.inf:
            self._cycle = CYCLE * (math.floor(now / CYCLE + 1e-6) + 1)
        self._due = min(self._cycle, self._communication.due)

    def _disturbed(self) -> None:
        """A fault was injected from outside: it shows at once, its frames leave when the node is next asked."""
        self._settle()
        self._due = min(self._due, self._axis.feedback.now)

    def _take(self) -> list[Outgoing]:
        frames = self._communication.outbox
        if not frames:
            return []
        self._communication.outbox = []
        return [] if self.faults.silent else frames
