"""Four drives at a SYNC rate, 200 Hz markers: frames lost, SYNC → record, share of a core.

Everything that a session has is on: cyclic position mode (one RPDO a drive and cycle), moves to and fro, the raw CAN
log, the marker stream. A record is there once both TPDOs of a drive are decoded. Frames are matched with their SYNC by
order: before and after the measured stretch the bus is silent, so the n-th answer of a drive is that to the n-th SYNC
as long as none is lost.
"""

import asyncio
import contextlib
import tempfile
import time
from collections.abc import AsyncGenerator, Callable
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.bus.devices import MARKERS, NODES, TARGETS, Devices, Witness, devices, simulated_drives, winch_config
from benchmarks.page import table
from benchmarks.rig_processes import free_port
from drivers.canbus.candump import CandumpLog
from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanFrame, CanTransport
from drivers.cia402.motion.cyclic import CyclicWinch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock, precise_loop
from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.feeds import UdpFeed
from drivers.mocap.source import StreamMarkerSource
from fidim_lab.errors import DeviceError
from sim_backends.in_process_bus import InProcessBus

RATE = 200.0
"""Hz, of the markers"""
SILENCE = 0.3
"""s before and after: whatever is under way arrives"""
PLACES = (1.0, 1.1)
"""m of cable, to and fro"""
SPEED, ACCELERATION = 0.2, 1.0
_LAST_PART = {0x280 + node: node for node in NODES}


@dataclass
class Counted:
    """What the host saw of the measured stretch."""

    syncs: list[float] = field(default_factory=list[float])
    """monotonic s, as the drivers stamp their samples"""
    frames: int = 0
    """TPDOs"""
    records: dict[int, list[float]] = field(default_factory=lambda: {node: [] for node in NODES})
    """monotonic s at which a drive's record was there"""
    stamps: dict[int, list[float]] = field(default_factory=lambda: {node: [] for node in NODES})
    """what each record says of its time, s"""
    targets: int = 0
    """sent, since the very beginning"""

    def begin(self) -> None:
        """What has arrived up to now belongs to the bring-up."""
        self.frames = 0
        for times in (self.syncs, *self.records.values(), *self.stamps.values()):
            times.clear()


@dataclass(frozen=True)
class Rates:
    """One line of the table."""

    over: str
    sync: float
    seconds: float
    cycles: int
    lost: int
    """TPDOs and targets that did not arrive"""
    skipped: int
    """SYNCs that were never sent, for the loop came too late"""
    misdated: int
    """records that say another SYNC than the one that sampled them"""
    delay: np.ndarray
    """s from SYNC to record, of every record"""
    sampled: np.ndarray
    """s from a SYNC's stamp until the drives had it"""
    markers: tuple[int, int]
    """frames received, lost"""
    cpu: float
    """of the host, share of a core"""
    cpu_devices: float

    def row(self) -> list[str]:
        p50, p99, worst = np.quantile(self.delay, (0.5, 0.99, 1.0))
        taken = "–" if not len(self.sampled) else "{:.2f}, {:.2f}".format(*1e3 * np.quantile(self.sampled, (0.5, 0.99)))
        return [
            f"{self.over}, {self.sync:g} Hz",
            f"{self.cycles:,} ({self.skipped})",
            f"{8 * self.cycles:,}, {4 * self.cycles:,}",
            f"{self.lost}, {self.misdated}",
            f"{1e3 * p50:.2f}, {1e3 * p99:.2f}, {1e3 * worst:.1f}",
            taken,
            f"{self.markers[0]:,}, {self.markers[1]}",
            f"{100 * self.cpu:.0f}, {100 * self.cpu_devices:.0f} %",
        ]


HEAD = [
    *("bus, SYNC", "cycles (skipped)", "TPDOs, targets", "lost, wrongly dated", "SYNC → record: p50, p99, worst, ms"),
    *("SYNC’s stamp → drive: p50, p99, ms", "marker frames, lost", "CPU: host, devices"),
]


def rates(over: list[str], syncs: list[float], minutes: float) -> str:
    """The table of all."""
    rows: list[list[str]] = []
    for kind in over:
        for sync in syncs:
            with asyncio.Runner(loop_factory=precise_loop) as runner:  # as the service has it
                found = runner.run(measure(kind, sync, 60.0 * minutes))
            rows.append(found.row())
            print(" | ".join(rows[-1]), flush=True)
    return table(HEAD, rows)


async def measure(over: str, sync: float, seconds: float) -> Rates:
    """One bus at one rate."""
    clock, port, witness = LoopClock(), free_port(), Witness()
    with devices(over, port, RATE) as made:
        async with _host(over, made, witness, clock) as transport:
            master = CanopenMaster(transport, clock, sync_rate=sync)
            winches = [CyclicWinch(winch_config(node), master) for node in NODES]
            counted = _count(transport, master, winches)
            async with _markers(clock, port) as source:
                await _bring_up(master, winches)
                master.skipped, before = 0, source.counters()
                begun, spent = time.monotonic(), time.process_time()
                await _run(clock, master, counted, winches, seconds)
                wall, spent = time.monotonic() - begun, time.process_time() - spent
                after = source.counters()
            await clock.sleep(SILENCE)
        told, reached = made.end()
        if over == "inprocess":
            told |= {str(node): count for node, count in witness.targets.items()}
            reached = np.array(witness.syncs)
    return _judged(over, sync, wall, counted, told, reached, master.skipped, (before, after), spent / wall)


def _judged(
    over: str,
    sync: float,
    wall: float,
    counted: Counted,
    told: dict[str, float],
    reached: np.ndarray,
    skipped: int,
    markers: tuple[dict[str, int], dict[str, int]],
    cpu: float,
) -> Rates:
    syncs = np.array(counted.syncs)
    cycles, delays, misdated = len(syncs), [], 0
    for node in NODES:
        records, stamps = np.array(counted.records[node]), np.array(counted.stamps[node])
        if len(records) != cycles:  # something is lost: what is left can only be held against the SYNC before it
            delays.append(records - syncs[np.searchsorted(syncs, records) - 1])
            continue
        delays.append(records - syncs)
        misdated += int((np.abs(stamps - syncs) > 1e-4).sum())
    reached = reached[len(reached) - cycles :]
    targets = sum(round(told[str(node)]) for node in NODES)
    return Rates(
        over=over,
        sync=sync,
        seconds=wall,
        cycles=cycles,
        lost=8 * cycles - counted.frames + counted.targets - targets,
        skipped=skipped,
        misdated=misdated,
        delay=np.concatenate(delays),
        sampled=reached - syncs if len(reached) == cycles else np.empty(0),
        markers=(markers[1]["received"] - markers[0]["received"], markers[1]["lost"] - markers[0]["lost"]),
        cpu=cpu,
        cpu_devices=told["cpu"],
    )


@asynccontextmanager
async def _host(over: str, made: Devices, witness: Witness, clock: LoopClock) -> AsyncGenerator[CanTransport]:
    """The host's end of the bus, with the raw log; in process the drives live beside."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        transport: CanTransport
        living: asyncio.Task[None] | None = None
        if over == "inprocess":
            bus = transport = InProcessBus(clock.now)
            for node in (*simulated_drives(), witness):
                bus.attach(node)
            living = asyncio.create_task(_live(bus, clock))
        else:
            transport = PythonCanTransport("slcan", made.channel, sleep_after_open=0.1)
        stack.callback(transport.close)
        log = CandumpLog(Path(folder) / "can.log")
        stack.callback(log.close)
        transport.tap(log.write)
        try:
            yield transport
        finally:
            if living is not None:
                living.cancel()


async def _live(bus: InProcessBus, clock: LoopClock) -> None:
    while True:
        bus.advance(clock.now())
        await clock.sleep(min(max(bus.due - clock.now(), 1e-4), 0.05))


@asynccontextmanager
async def _markers(clock: LoopClock, port: int) -> AsyncGenerator[StreamMarkerSource]:
    source = StreamMarkerSource(
        UdpFeed(clock, port, "127.0.0.1"), ViconUdpDecoder(MarkerObjects(MARKERS)), clock, rate=RATE
    )
    await source.start()
    try:
        await source.ready(within=10.0)
        yield source
    finally:
        await source.close()


def _count(transport: CanTransport, master: CanopenMaster, winches: list[CyclicWinch]) -> Counted:
    """Count what comes; the subscriber is called after the master's, so the record is there."""
    counted = Counted()
    links = {winch.config.node_id: winch.link for winch in winches}

    def hear(frame: CanFrame) -> None:
        if 0x180 < frame.id < 0x300:
            counted.frames += 1
            node = _LAST_PART.get(frame.id)
            if node is not None and (values := links[node].values) is not None:
                counted.records[node].append(time.monotonic())
                counted.stamps[node].append(values.t)

    def see(frame: CanFrame) -> None:
        counted.targets += frame.id in TARGETS

    transport.subscribe(hear)
    transport.tap(see)
    return counted


async def _bring_up(master: CanopenMaster, winches: list[CyclicWinch]) -> None:
    async with _looping(master):
        await asyncio.gather(*(winch.configure() for winch in winches))
        await asyncio.gather(*(winch.enable() for winch in winches))
        await master.clock.sleep(0.2)


async def _run(
    clock: LoopClock, master: CanopenMaster, counted: Counted, winches: list[CyclicWinch], seconds: float
) -> None:
    """The measured stretch, between two silences. Drives watch the host's heartbeat, and allow so long a silence."""
    await clock.sleep(SILENCE)
    counted.begin()
    async with _looping(master, counted.syncs.append):
        moving = asyncio.create_task(_move(clock, winches))
        await clock.sleep(seconds)
        moving.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await moving
    await clock.sleep(SILENCE)


@asynccontextmanager
async def _looping(master: CanopenMaster, on_cycle: "Callable[[float], None] | None" = None) -> AsyncGenerator[None]:
    task = asyncio.create_task(master.run(on_cycle))
    try:
        yield
    finally:
        task.cancel()
        (ended,) = await asyncio.gather(task, return_exceptions=True)
        if isinstance(ended, Exception):
            raise ended


async def _move(clock: LoopClock, winches: list[CyclicWinch]) -> None:
    """To and fro, all together; a drive that does not get there in time ends it."""
    while True:
        for place in PLACES[::-1]:
            await asyncio.gather(*(winch.move_to(place, SPEED, ACCELERATION) for winch in winches))
            deadline = clock.now() + 10.0
            while not all((sample := winch.latest()) and sample.target_reached for winch in winches):
                if clock.now() > deadline:
                    raise DeviceError("benchmark", "a winch does not arrive.")
                await clock.sleep(0.05)
