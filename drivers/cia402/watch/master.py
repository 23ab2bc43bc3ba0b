"""The CANopen master: SYNC, the host's heartbeat and monitoring of every node, all from one control loop.

Make one for a bus, `add_node` for each drive, then run `run()` as a task for as long as drives are in use. The
heartbeat comes from the same loop: where that hangs or ends, the drives miss it and stop by themselves (1016, 6007).
Drives that watch no heartbeat are asked for their state by remote frames in its rhythm, and miss those (100C, 100D).
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import cast

import can
import canopen

from drivers.canbus.load import MAX_LOAD, bus_load
from drivers.canbus.transport import CanFrame, CanTransport
from drivers.cia402.dictionary.abilities import Abilities, abilities, dictionary_of
from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import controlword
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.wire.nmt import heartbeat_frame
from drivers.cia402.wire.sdo import SdoChannel
from drivers.cia402.wire.strangers import SDO_REQUEST, Strangers
from drivers.cia402.wire.sync import SyncTimes
from drivers.ports import Clock
from fidim_lab.errors import BusError, SetupError

_SYNC = 0x080
_HOST_PERIODS = 3.0
"""a drive must allow at least so many periods of the host's heartbeat"""
_SHORTEST = 0.9
"""of a period, between two SYNCs: what a late one has lost is made up for little by little. A drive in cyclic position
mode that meets the next SYNC too soon is still on its way, and is asked for the rest and the next step in one"""


class _TransportBus:
    """What `canopen.Network` sends on: just enough of a python-can bus."""

    def __init__(self, transport: CanTransport, links: Mapping[int, NodeLink]) -> None:
        self._transport = transport
        self._links = links

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        """Pass a frame on; the transport has its own time-outs."""
        link = self._links.get(message.arbitration_id - SDO_REQUEST)
        if link is not None:
            link.twins.asked()
        self._transport.send(message.arbitration_id, bytes(message.data))


class CanopenMaster:
    """One CANopen bus. The only producer of SYNC on it."""

    def __init__(
        self,
        transport: CanTransport,
        clock: Clock,
        *,
        sync_rate: float = 250.0,
        heartbeat_period: float = 0.05,
        host_id: int = 127,
        bitrate: float = 1e6,
    ) -> None:
        """`sync_rate` in Hz, `heartbeat_period` of the host in s, `bitrate` in bit/s (only for the load).

        Raises SetupError for numbers that cannot be.
        """
        if not 1.0 <= sync_rate <= 1000.0:
            raise SetupError(f"sync_rate: {sync_rate} Hz found, allowed is 1 to 1000 Hz.")
        if not 1.0 / sync_rate <= heartbeat_period <= 10.0:
            raise SetupError(
                f"heartbeat_period: {heartbeat_period} s found, allowed is {1 / sync_rate:g} s (one SYNC) to 10 s."
            )
        self.transport = transport
        self.clock = clock
        self.period = 1.0 / sync_rate
        """s between SYNCs"""
        self.host_id = host_id
        self.sync = SyncTimes()
        self.silent = False
        """neither SYNC, heartbeat nor guarding any more: a drive did not obey, its own watchdog shall stop it"""
        self.without_sync = self.without_heartbeat = False
        """withheld for a trial, for a while: does each drive stop by itself?"""
        self.skipped = 0
        """SYNCs that were not sent because the loop came too late"""
        self._rate = sync_rate
        self._bitrate = bitrate
        self._heartbeat_period = heartbeat_period
        self._heartbeat_due = float("-inf")
        self._links: dict[int, NodeLink] = {}
        self._strangers = Strangers(host_id, ())
        self._talk: list[tuple[float, Abilities]] = []
        """how often it says its state (s), and what it can do, for each drive"""
        self._before_sync: list[Callable[[], None]] = []
        self._receivers: dict[int, Callable[[CanFrame], None]] = {}
        self._network = canopen.Network(cast(can.BusABC, _TransportBus(transport, self._links)))
        transport.subscribe(self._on_frame)

    def add_node(self, config: WinchConfig) -> NodeLink:
        """Take a drive under watch. Raises SetupError: node id twice, unreadable EDS file, bus too full, time-outs."""
        if config.node_id in self._links:
            raise SetupError(f"winch {config.name!r}: node_id {config.node_id} is taken by another winch.")
        if config.host_timeout < _HOST_PERIODS * self._heartbeat_period:
            raise SetupError(
                f"winch {config.name!r}: host_timeout: {config.host_timeout:g} s found, must be at least "
                f"{_HOST_PERIODS * self._heartbeat_period:g} s, three periods of the host's heartbeat."
            )
        node = _remote_node(config)
        able = abilities(node.object_dictionary, config)
        heard_every = max(config.heartbeat, self._heartbeat_period) if able.guarded else config.heartbeat
        self._refuse_overload(heard_every, able)
        self._network.add_node(node)
        sdo = SdoChannel(node, self.transport, self.clock, device=config.device, timeout=config.sdo_timeout)
        link = NodeLink(config.node_id, self.transport, sdo, self.sync, heard_every, able)
        self._links[config.node_id] = link
        self._strangers.add(config.node_id)
        self._talk.append((heard_every, able))
        for part, pdo in enumerate(able.layout.tpdos):
            self._receivers[pdo.cob_id(config.node_id)] = partial(link.on_tpdo, part)
        self._receivers[0x080 + config.node_id] = link.on_emergency
        self._receivers[0x580 + config.node_id] = partial(self._on_sdo, link)
        self._receivers[0x700 + config.node_id] = link.on_heartbeat
        return link

    @property
    def load(self) -> float:
        """Worst-case share of the bus that SYNC, PDOs (one RPDO a cycle) and heartbeats take."""
        return self._load_with(self._talk)

    @property
    def strangers(self) -> str:
        """Another master, or another node of a drive's id, in words; latched, empty without one."""
        found = [f"another master is on this bus: {self._strangers.says}"] if self._strangers.says else []
        twins = ((node_id, link.twins.says) for node_id, link in self._links.items())
        found += [f"two nodes answer with id {node_id}: {says}" for node_id, says in twins if says]
        return "; ".join(found)

    @property
    def remark(self) -> str:
        """Faults on the bus that did not stop the run, in words; empty without any."""
        withdrawn = ((node_id, link.withdrawn) for node_id, link in self._links.items())
        found = [f"node {node_id} has withdrawn its {emergency}" for node_id, emergency in withdrawn if emergency]
        return "; ".join(filter(None, (self.transport.remark, *found)))

    async def run(self, on_cycle: Callable[[float], None] | None = None) -> None:
        """The control loop; never returns. `on_cycle` (guards) is called with each SYNC's time.

        Raises BusError where the bus cannot be trusted any more, and whatever `on_cycle` raises: then the heartbeat
        stops with the loop, and the drives stop by themselves.
        """
        start, cycle = self.clock.now(), 0
        while True:
            self.cycle()
            if on_cycle is not None:
                on_cycle(self.sync.current)
            cycle += 1
            late = self.clock.now() - (start + cycle * self.period)
            if late > self.period:
                missed = math.floor(late / self.period)
                self.skipped += missed
                cycle += missed
            due = max(start + cycle * self.period, self.sync.current + _SHORTEST * self.period)
            await self.clock.sleep(max(0.0, due - self.clock.now()))

    def cycle(self) -> None:
        """One turn of the control loop: look at the bus, count what is missing, SYNC, heartbeat."""
        fault = self.transport.fault
        if fault is not None:
            self.quick_stop_all()
            raise BusError(f"The CAN bus cannot be trusted any more: {fault}.", hint="The drives were told to stop.")
        if self.silent:
            return
        now = self.clock.now()
        if not self.without_sync:
            for link in self._links.values():
                link.count_missing()
            for stream in self._before_sync:
                stream()
            now = self.clock.now()
            self.sync.advance(now)
            self.transport.send(_SYNC, b"")
        if now >= self._heartbeat_due and not self.without_heartbeat:
            self.transport.send(0x700 + self.host_id, heartbeat_frame())
            for link in self._links.values():
                if link.able.guarded:
                    link.guard()
            self._heartbeat_due = now + self._heartbeat_period - self.period / 2.0

    def before_sync(self, stream: Callable[[], None]) -> None:
        """Call `stream` in the control loop just before each SYNC: targets of cyclic modes. It must not wait."""
        self._before_sync.append(stream)

    def quick_stop_all(self) -> None:
        """One quick stop to every drive, whether or not the others can be reached."""
        for link in self._links.values():
            try:
                link.send_controlword(controlword(Command.QUICK_STOP), link.target)
            except BusError:
                continue  # the heartbeat stops as well, and that stops the drive

    def _on_frame(self, frame: CanFrame) -> None:
        receiver = self._receivers.get(frame.id)
        if receiver is not None and not frame.remote:
            receiver(frame)
            return
        self._strangers.hear(frame)
        if frame.remote:
            return
        if frame.id == _SYNC:
            for link in self._links.values():
                link.twins.foreign_sync()
        link = self._links.get(frame.id - SDO_REQUEST)
        if link is not None:
            link.twins.asked()  # by somebody else: that answer, too, will come here

    def _on_sdo(self, link: NodeLink, frame: CanFrame) -> None:
        link.twins.answered(frame.data)
        if len(frame.data) != 8:
            link.counters.malformed += 1
        elif not link.answers_controlword(frame):
            self._network.notify(frame.id, bytearray(frame.data), frame.t)

    def _load_with(self, talk: list[tuple[float, Abilities]]) -> float:
        asked = sum(able.guarded for _, able in talk) / self._heartbeat_period
        frames = {0: self._rate + asked, 1: 1.0 / self._heartbeat_period + sum(1.0 / period for period, _ in talk)}
        for _, able in talk:
            for pdo in (*able.layout.tpdos, able.layout.rpdo):
                size = pdo.format.size
                frames[size] = frames.get(size, 0.0) + self._rate
        return bus_load(frames, self._bitrate)

    def _refuse_overload(self, heard_every: float, able: Abilities) -> None:
        talk = [*self._talk, (heard_every, able)]
        load = self._load_with(talk)
        if load > MAX_LOAD:
            raise SetupError(
                f"The CAN bus would be {load:.0%} full with {len(talk)} of the winches at {self._rate:g} Hz; "
                f"allowed is {MAX_LOAD:.0%}.",
                hint="Lower the SYNC rate or raise the bit rate.",
            )


def _remote_node(config: WinchConfig) -> canopen.RemoteNode:
    """A drive with the object dictionary of its EDS file. Raises SetupError naming the EDS file."""
    known = dictionary_of(config)
    node = canopen.RemoteNode(config.node_id, canopen.ObjectDictionary())  # its own PDOs, unused here, stay empty
    node.object_dictionary = node.sdo.od = known
    return node
