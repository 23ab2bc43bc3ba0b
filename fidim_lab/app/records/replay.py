"""`fidim replay`: the raw bytes of a run once more through the same drivers, held against what was recorded.

CAN frames go through the CANopen master into the winches, packets through decoder and sequencing into the marker
source, each at its own time. Where a window's MCAP file says something else, the first such place is named: the bytes
of a field problem have become a test.
"""

import asyncio
import heapq
import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from drivers.canbus.candump import read_candump
from drivers.canbus.transport import CanFrame
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.mocap.packet_log import Packet, read_packets
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import MarkerFrame, WinchSample
from drivers.recorded import RecordedBus, RecordedClock, RecordedFeed
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.devices_file import DEVICES, Devices, read_devices
from fidim_lab.app.terminal import console
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.files.mcap_schemas import ROW, WINCH
from fidim_lab.errors import FidimError, FileError
from procedures.recording.raw_logs import can_logs, packet_logs

_TOLERANCE = 1e-9
"""m, m/s, A: the same bytes by the same arithmetic"""
_MICRO = 1e6
"""times are compared to the µs, as the raw CAN log has them"""
_LAST_DIGIT = 1e-6
"""s"""

FORMAT = "fidim-replay/1"
_SYNC, _SDO_ANSWERS = 0x080, range(0x580, 0x600)
_LARGE = 1e9


@dataclass(frozen=True)
class _Place:
    """Where a value was recorded."""

    window: str
    t: float
    value: Any


@dataclass
class Expected:
    """Recorded values by their source's own keys; what has come out is taken off."""

    windows: tuple[str, ...] = ()
    rows: dict[tuple[int, int], _Place] = field(default_factory=dict[tuple[int, int], _Place])
    """by device frame and arrival, µs"""
    samples: dict[tuple[int, int], _Place] = field(default_factory=dict[tuple[int, int], _Place])
    """by cable (from 0) and SYNC, µs"""
    syncs: tuple[float, ...] = ()
    """s, in order: instants of the SYNCs that samples were recorded with"""
    _passed: float = -math.inf

    def sync(self, logged: float) -> float:
        """The instant by which samples know the SYNC that the log has at `logged` (s); that itself where none does.

        A SYNC is dated when the control loop sends it, and logged when the bus takes it: on a real bus some ten µs
        later, on a busy computer more, but before the next one.
        """
        before, self._passed = self._passed, logged
        k = bisect_right(self.syncs, logged + _LAST_DIGIT) - 1
        return self.syncs[k] if k >= 0 and self.syncs[k] > before + _LAST_DIGIT else logged

    def marker(self, frame: MarkerFrame) -> str | None:
        """None where this frame was not recorded; else what differs, empty where nothing does."""
        place = _taken(self.rows, frame.number, frame.t)
        if place is None:
            return None
        found = [v for p in frame.positions for v in (p or (math.nan,) * 3)][: len(place.value)]
        for k, (was, now) in enumerate(zip(place.value, found, strict=False)):
            if not _same(was, now):
                axis = f"{'xyz'[k % 3]} of marker {k // 3 + 1}"
                return f"{place.window}, frame {frame.number}: {axis} was {was:.6f} m, is {now:.6f} m now"
        return ""

    def sample(self, cable: int, sample: WinchSample, *, arrival: bool = True) -> str | None:
        """None where this sample was not recorded (or came already); else what differs, empty where nothing does.

        arrival: whether the drive itself says that it has arrived. In cyclic modes the host knows: it makes the way.
        """
        place = _taken(self.samples, cable, sample.t)
        if place is None:
            return None
        for name, unit in (("length", "m"), ("velocity", "m/s"), ("current", "A")):
            was, now = getattr(place.value, name), getattr(sample, name)
            if not _same(was, now):
                return f"{place.window}, winch {cable + 1}: {name} was {was:.6f} {unit}, is {now:.6f} {unit} now"
        if arrival and place.value.target_reached != sample.target_reached:
            return f"{place.window}, winch {cable + 1}: target reached was {place.value.target_reached}"
        return ""

    def missing(self) -> Iterator[tuple[float, str]]:
        """What was recorded but did not come out of the raw bytes."""
        for (number, _), place in self.rows.items():
            yield place.t, f"{place.window}: frame {number} was recorded, but the raw bytes do not give it"
        for (cable, _), place in self.samples.items():
            yield place.t, f"{place.window}: a sample of winch {cable + 1} was recorded, the raw bytes do not give it"


@dataclass
class Replayed:
    """What came of it."""

    frames: int = 0
    """CAN frames of the logs"""
    packets: int = 0
    samples: int = 0
    """winch samples that came out, of those that were recorded"""
    markers: int = 0
    """marker frames that came out, of those that were recorded"""
    windows: tuple[str, ...] = ()
    differences: list[tuple[float, str]] = field(default_factory=list[tuple[float, str]])
    """(monotonic s, sentence) of each"""
    counters: dict[str, int] = field(default_factory=dict[str, int])
    """of motion capture: received, lost, late, doubled, malformed …"""

    @property
    def first(self) -> tuple[float, str] | None:
        """The earliest difference."""
        return min(self.differences, default=None)


def replay_command(folder: Path, speed: float, json_file: Path | None) -> int:
    """Replay and say whether it agrees; 0 or 1. Raises FileError where something that is needed is missing or wrong."""
    found = asyncio.run(replay(folder, speed))
    write_answer(json_file, FORMAT, {**asdict(found), "agrees": found.first is None, "first": found.first})
    console.out.print(f"replayed    {found.frames} CAN frames, {found.packets} motion-capture packets", markup=False)
    console.out.print(
        f"compared    {found.samples} winch samples, {found.markers} marker frames of {len(found.windows)} recordings",
        markup=False,
    )
    if found.first is None:
        console.out.print("agrees      what the drivers read now is what was recorded", markup=False)
        return 0
    t, says = found.first
    console.out.print(f"differs     {len(found.differences)} times, first at {t:.6f} s: {says}", markup=False)
    return 1


async def replay(folder: Path, speed: float = 0.0) -> Replayed:
    """Play a run folder back; `speed` times real time, 0: as fast as it goes. Raises FileError."""
    if not (folder / DEVICES).exists():
        raise FileError(folder / DEVICES, "", "no such file.", hint="Only what runs recorded can be replayed.")
    expected = expected_of(folder)
    devices = read_devices(folder)
    logs = can_logs(folder)
    if not logs:
        raise FileError(folder / "raw", "", "there is no raw CAN log (can.log) to replay.")
    if not expected.windows:
        raise FileError(folder, "", "no recording in MCAP form to compare with, in windows/ or rejected/.")
    return await _Player(devices, expected).play(_merged(folder), speed)


def _merged(folder: Path) -> Iterator[CanFrame | Packet]:
    """All raw bytes in the order of their times."""
    frames = (frame for path in can_logs(folder) for frame in read_candump(path))
    packets = (packet for path in packet_logs(folder) for packet in read_packets(path))
    return heapq.merge(frames, packets, key=lambda item: item.t)


class _Player:
    """The drivers on recorded devices."""

    def __init__(self, devices: Devices, expected: Expected) -> None:
        self._expected = expected
        self._found = Replayed(windows=expected.windows)
        self._clock = RecordedClock(-math.inf)
        self._bus = RecordedBus()
        # It never runs: SYNCs come from the log. Its own limits must not refuse what the recording's master allowed.
        self._master = CanopenMaster(self._bus, self._clock, sync_rate=1000.0, heartbeat_period=0.001, bitrate=_LARGE)
        self._winches = [Cia402Winch(entry.config, self._master) for entry in devices.winches]
        self._nodes = {entry.config.node_id: k for k, entry in enumerate(devices.winches)}
        self._feed = RecordedFeed()
        self._source: StreamMarkerSource | None = None
        if devices.markers is not None:
            decoder = devices.markers.decoder.make()
            self._source = StreamMarkerSource(self._feed, decoder, self._clock, rate=devices.markers.rate)

    async def play(self, items: Iterator[CanFrame | Packet], speed: float) -> Replayed:
        """Every item at its time, then whatever is missing."""
        wall = LoopClock()
        begin, started = None, wall.now()
        reader: asyncio.Task[None] | None = None
        for item in items:
            if begin is None:
                begin, started = item.t, wall.now()
                self._clock.advance(item.t)
                reader = await self._listen()
            elif speed > 0.0:
                await wall.sleep(started + (item.t - begin) / speed - wall.now())
            self._clock.advance(item.t)
            if isinstance(item, Packet):
                self._found.packets += 1
                self._feed.put(item)
                await wall.sleep(0.0)
                await wall.sleep(0.0)
            else:
                self._found.frames += 1
                self._deliver(item)
        if self._source is not None and reader is not None:
            await wall.sleep(0.0)
            await self._source.close()
            await reader
            self._found.counters = self._source.counters()
        self._found.differences += self._expected.missing()
        return self._found

    async def _listen(self) -> "asyncio.Task[None] | None":
        if self._source is None:
            return None
        await self._source.start()
        return asyncio.ensure_future(self._read(self._source))

    async def _read(self, source: StreamMarkerSource) -> None:
        frames = source.frames()
        while True:
            try:
                self._mark(await anext(frames))
            except StopAsyncIteration:
                return
            except FidimError:
                continue  # a silent stream: it was silent then, too

    def _mark(self, frame: MarkerFrame) -> None:
        says = self._expected.marker(frame)
        self._found.markers += says is not None
        if says:
            self._found.differences.append((frame.t, says))

    def _deliver(self, frame: CanFrame) -> None:
        if frame.id == _SYNC:
            self._master.sync.advance(self._expected.sync(frame.t))
        elif frame.id not in _SDO_ANSWERS:
            self._bus.deliver(frame)
            cable = self._nodes.get(frame.id & 0x7F)
            if cable is not None and 0x180 <= frame.id < 0x580:
                self._sampled(cable, self._winches[cable].latest())

    def _sampled(self, cable: int, sample: WinchSample | None) -> None:
        if sample is None:
            return
        by_drive = self._winches[cable].config.mode is not Mode.CYCLIC_POSITION
        says = self._expected.sample(cable, sample, arrival=by_drive)
        self._found.samples += says is not None
        if says:
            self._found.differences.append((sample.t, says))


def expected_of(folder: Path) -> Expected:
    """From every MCAP file of a run, unfinished ones too. Raises FileError for a damaged one."""
    expected = Expected()
    paths = sorted(path for place in ("windows", "rejected") for path in (folder / place).glob("*.mcap*"))
    expected.windows = tuple(path.relative_to(folder).as_posix() for path in paths)
    for path, name in zip(paths, expected.windows, strict=True):
        for message in read_mcap(path).messages:
            value = message.value
            if message.schema == ROW and not math.isnan(value.host_time):
                place = _Place(name, value.host_time, list(value.markers))
                expected.rows[value.device_frame, round(value.host_time * _MICRO)] = place
            elif message.schema == WINCH:
                key = value.cable - 1, round(value.host_time * _MICRO)
                expected.samples[key] = _Place(name, value.host_time, value)
    expected.syncs = tuple(sorted({place.t for place in expected.samples.values()}))
    return expected


def _taken(table: dict[tuple[int, int], _Place], which: int, t: float) -> _Place | None:
    """Take a value off by its key; one half way between two µs may have been rounded to either."""
    key = round(t * _MICRO)
    places = (table.pop((which, near), None) for near in (key, key - 1, key + 1))
    return next((place for place in places if place is not None), None)


def _same(was: float, now: float) -> bool:
    return (math.isnan(was) and math.isnan(now)) or abs(was - now) <= _TOLERANCE
