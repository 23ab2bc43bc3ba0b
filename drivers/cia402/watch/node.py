"""One node as seen on the bus: its last frames with their times, and the single frames sent to it.

The receiving thread feeds `on_…`; they never raise and never block, they replace immutable values and count.
"""

import struct
from collections import deque
from dataclasses import dataclass

from drivers.canbus.transport import CanFrame, CanTransport
from drivers.cia402.dictionary.abilities import Abilities
from drivers.cia402.profile.last_motion import LastMotion
from drivers.cia402.profile.words import Mode
from drivers.cia402.wire.aborts import abort_words
from drivers.cia402.wire.emcy import Emergency, decode_emergency
from drivers.cia402.wire.nmt import Heartbeat, NmtCommand, NmtState, decode_heartbeat, nmt_frame
from drivers.cia402.wire.pdo import DriveValues, Mappable, PdoMap, SampleDecoder
from drivers.cia402.wire.sdo import SdoChannel
from drivers.cia402.wire.strangers import TwinWatch
from drivers.cia402.wire.sync import SyncAnswers, SyncTimes
from drivers.ports import Clock

_CONTROLWORD_MULTIPLEXER = bytes((0x40, 0x60, 0x00))
_WRITE_TWO_BYTES, _ABORT = 0x2B, 0x80
_EXPEDITED, _MOST_BYTES = 0x23, 4
"""of an SDO download in one frame: the command for so many bytes"""
_KEPT_EMERGENCIES = 64
_MISSED_HEARTBEATS = 3.0
_SAMPLED_LATELY = 0.1
"""s"""


@dataclass
class NodeCounters:
    """Faults so far, for the report."""

    lost: int = 0
    """cycles in which no whole sample came"""
    malformed: int = 0
    """heartbeats and emergencies that were none"""
    emergencies: int = 0


class NodeLink:
    """The bus side of one drive."""

    def __init__(
        self,
        node_id: int,
        transport: CanTransport,
        sdo: SdoChannel,
        sync: SyncTimes,
        heartbeat_period: float,
        able: Abilities,
    ) -> None:
        """`heartbeat_period` (s) is how often the drive says its state."""
        self.node_id = node_id
        self.sdo = sdo
        self.able = able
        """what this drive can do"""
        self.layout = able.layout
        """its PDOs"""
        self.values: DriveValues | None = None
        self.unchanged_since = float("-inf")
        """monotonic s of the SYNC since which all samples have told exactly the same"""
        self.unchanged = 0
        """and how many they are"""
        self.heartbeat: Heartbeat | None = None
        self.emergencies: deque[Emergency] = deque(maxlen=_KEPT_EMERGENCIES)
        self.latched: Emergency | None = None
        """the first emergency since somebody acknowledged"""
        self.withdrawn: Emergency | None = None
        """the newest that the drive itself has withdrawn (emergency 0000)"""
        self.counters = NodeCounters()
        self.twins = TwinWatch()
        """whether another node has the same id"""
        self.decoder = SampleDecoder(self.layout.tpdos, self.layout.velocity_digit)
        self.motion: LastMotion | None = None
        """which way the drum turned last, where somebody wants to know"""
        self.brought_up = False
        self._restarted = False
        self._transport = transport
        self.answers = SyncAnswers(sync, len(self.layout.tpdos))
        """which SYNC a TPDO belongs to"""
        self._sync = sync
        self._whole = 0
        self._mapped_otherwise = 0
        """TPDOs of a wrong length before the bring-up"""
        self._heartbeat_period = heartbeat_period
        self.mode = Mode.PROFILE_POSITION
        """that RPDOs ask for, and that commands expect to be displayed"""
        self.refusal = ""
        """why it has refused the last controlword that came by SDO, in words"""
        self.target = 0
        """counts, sent last: a controlword to a drive in a cyclic mode must not bring another"""

    # frames from the drive ------------------------------------------------------------------------------------------

    def on_tpdo(self, part: int, frame: CanFrame) -> None:
        """TPDO number `part`, from 0."""
        t = self.answers.date(part)
        if t == float("-inf"):  # before our first SYNC: somebody else's, or sent on its own
            return
        values = self.decoder.feed(part, frame.data, t)
        self.twins.sampled(t, self.decoder.contradicted)
        if values is not None:
            before, self.values = self.values, values
            if before is None or before.told != values.told:
                self.unchanged_since, self.unchanged = t, 0
            self.unchanged += 1
            if self.motion is not None:
                self.motion.feed(values.position)

    def on_heartbeat(self, frame: CanFrame) -> None:
        """A heartbeat, an answer to node guarding, or a boot-up message."""
        heartbeat = decode_heartbeat(frame.data, frame.t)
        if heartbeat is None:
            self.counters.malformed += 1
            return
        if heartbeat.state is NmtState.BOOT_UP and self.brought_up:
            self._restarted = True
        self.heartbeat = heartbeat

    def on_emergency(self, frame: CanFrame) -> None:
        """An EMCY frame; the first error is latched until somebody acknowledges, or the drive withdraws all of them."""
        emergency = decode_emergency(frame.data, frame.t)
        if emergency is None:
            self.counters.malformed += 1
            return
        self.emergencies.append(emergency)
        self.counters.emergencies += 1
        if not emergency.cleared:
            self.latched = self.latched or emergency
        elif self.latched is not None and not emergency.register:  # with a register, other errors are still there
            self.withdrawn, self.latched = self.latched, None

    def answers_controlword(self, frame: CanFrame) -> bool:
        """Whether an SDO answer belongs to a controlword that was sent without waiting, and not to the SDO queue."""
        if frame.data[1:4] != _CONTROLWORD_MULTIPLEXER:
            return False
        if frame.data[0] == _ABORT:
            self.refusal = abort_words(int.from_bytes(frame.data[4:8], "little"))
        return True

    # frames to the drive --------------------------------------------------------------------------------------------

    def send_nmt(self, command: NmtCommand) -> None:
        """One NMT frame."""
        self._transport.send(0x000, nmt_frame(command, self.node_id))

    def guard(self) -> None:
        """One remote frame that asks for the node's state; a drive that gets none stops by itself (100C, 100D)."""
        self._transport.ask(0x700 + self.node_id)

    def send_controlword(self, word: int, target: int, *, both_ways: bool = False) -> None:
        """One frame with a controlword, never waiting for an answer.

        By RPDO while the node is operational with our mapping; otherwise RPDOs are ignored, and it goes as a single
        expedited SDO download, whose answer is not waited for. both_ways: it does so in any case.
        """
        if self.takes_pdos:
            rpdo = self.layout.rpdo
            if not rpdo.carries("TARGET_POSITION"):
                self.send_target(target)  # first: the drive acts on the controlword at once
            self._command(rpdo, word, target)
        if both_ways or not self.takes_pdos:
            data = bytes((_WRITE_TWO_BYTES,)) + _CONTROLWORD_MULTIPLEXER + struct.pack("<Hxx", word)
            self.twins.asked()
            self.refusal = ""
            self._transport.send(0x600 + self.node_id, data)

    def post(self, index: int, sub: int, value: int) -> None:
        """Write an object of at most four bytes by one frame, without waiting; none that it cannot write."""
        data = self.sdo.encoded(index, sub, value) if self.able.can_write(index, sub) else b""
        if not 0 < len(data) <= _MOST_BYTES:
            return
        self.twins.asked()
        head = struct.pack("<BHB", _EXPEDITED | (_MOST_BYTES - len(data)) << 2, index, sub)
        self._transport.send(0x600 + self.node_id, head + data.ljust(_MOST_BYTES, b"\0"))

    def send_target(self, target: int) -> None:
        """One frame with the position (counts, 32 bits) that is taken at the next SYNC."""
        if (pdo := self.layout.target) is not None:
            self._command(pdo, 0, target)

    def _command(self, rpdo: PdoMap, word: int, target: int) -> None:
        self.target = target
        values = {"CONTROLWORD": word, "MODE": self.mode, "TARGET_POSITION": target}
        self._transport.send(rpdo.cob_id(self.node_id), rpdo.pack(values))

    # what is known --------------------------------------------------------------------------------------------------

    async def ask_mode(self, clock: Clock, wanted: Mode, period: float, timeout: float) -> int:
        """The displayed mode (6061), asked by SDO every `period` (s) until it is `wanted` or `timeout` (s) is over.

        Raises DeviceError.
        """
        deadline = clock.now() + timeout
        while (found := await self.sdo.read(Mappable.MODE_DISPLAY.index)) != wanted and clock.now() < deadline:
            await clock.sleep(period)
        self.decoder.displayed = found
        return found

    @property
    def eds_identity(self) -> tuple[int, int]:
        """Vendor and product by the EDS file; 0 for one that it leaves open."""
        return self.sdo.default(0x1018, 1), self.sdo.default(0x1018, 2)

    @property
    def nmt_state(self) -> NmtState | None:
        """As it said last, whose age is not looked at; of a drive that says nothing, as its samples show."""
        if self.able.tells_its_state:
            return None if self.heartbeat is None else self.heartbeat.state
        sampled = self.values is not None and self._sync.current - self.values.t <= _SAMPLED_LATELY
        return NmtState.OPERATIONAL if sampled else None

    @property
    def takes_pdos(self) -> bool:
        """Whether it is operational, with our mapping."""
        return self.brought_up and self.nmt_state is NmtState.OPERATIONAL

    def forget(self) -> None:
        """Before a bring-up: what was latched belongs to the past; the history stays."""
        self.brought_up = False
        self._restarted = False
        self.latched = self.withdrawn = None
        self.twins.forget()
        self.values = None
        self._mapped_otherwise = self.decoder.malformed
        self.answers.restart()

    def count_missing(self) -> None:
        """At the end of a cycle: whether a whole sample has come since the last time."""
        whole = self.decoder.received
        if self.brought_up and whole == self._whole:
            self.counters.lost += 1
        self._whole = whole

    def fault(self, now: float) -> str:
        """The fault of this node in words; empty without one."""
        found: list[str] = []
        if self.latched is not None:
            found.append(str(self.latched))
        if self.twins.says:
            found.append(f"two nodes answer with id {self.node_id}: {self.twins.says}")
        if self.brought_up:
            found.extend(self._network_faults(now))
        if self._transport.fault is not None:
            found.append(self._transport.fault)
        return "; ".join(found)

    def _network_faults(self, now: float) -> list[str]:
        if self._restarted:
            return ["the drive restarted by itself (power cut?) and must be configured again"]
        if wrong := self.decoder.malformed - self._mapped_otherwise:
            return [f"{wrong} TPDOs had a wrong length: its mapping has changed (restarted?), configure it again"]
        if not self.able.tells_its_state:
            return []
        heartbeat = self.heartbeat
        age = float("inf") if heartbeat is None else now - heartbeat.t
        if heartbeat is None or age > _MISSED_HEARTBEATS * self._heartbeat_period:
            what = "answer to node guarding" if self.able.guarded else "heartbeat"
            return [f"no {what} for {age:.2g} s, one every {self._heartbeat_period:g} s expected"]
        if heartbeat.state is not NmtState.OPERATIONAL:
            return [f"the node is {heartbeat.state.words}, not OPERATIONAL"]
        return []
