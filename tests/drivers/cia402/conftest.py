"""A small drive for tests, a bus in this process, and a loop whose time jumps.

The drive is not the simulated drive of `sim_backends`: it is as plain as possible, and can be told to misbehave.
"""

import asyncio
import struct
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager, closing
from dataclasses import dataclass, field
from typing import Any, TypeVar

import pytest

from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from fidim_lab.errors import BusError

T = TypeVar("T")
_SIGNED = {0x6007, 0x605A, 0x605D, 0x605E, 0x6060, 0x6061, 0x6064, 0x606C, 0x6078, 0x607A, 0x607D}
_STATUS = {"disabled": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "quick stop": 0x07, "fault": 0x08}


def _objects() -> dict[tuple[int, int], tuple[int, int]]:
    """(index, sub) → (value, bytes)"""
    objects = {(0x1000, 0): (0x20192, 4), (0x1005, 0): (0x80, 4), (0x1016, 1): (0, 4), (0x1017, 0): (0, 2)}
    objects |= {(0x1018, sub): (value, 4) for sub, value in ((1, 77), (2, 88), (3, 1), (4, 99))}
    objects |= {(0x1001, 0): (0, 1), (0x1029, 1): (0, 1), (0x6502, 0): (1, 4), (0x6075, 0): (4000, 4)}
    objects |= {(index, 0): (0, 2) for index in (0x6007, 0x605A, 0x605D, 0x605E, 0x6066, 0x6072, 0x6073)}
    objects |= {(index, 0): (0, 4) for index in (0x6065, 0x607F, 0x6081, 0x6083, 0x6084, 0x6085, 0x607A)}
    objects |= {(0x607D, 1): (0, 4), (0x607D, 2): (0, 4), (0x6060, 0): (0, 1), (0x6061, 0): (0, 1)}
    objects |= {(0x6040, 0): (0, 2), (0x6041, 0): (0x40, 2), (0x6064, 0): (0, 4), (0x606C, 0): (0, 4)}
    objects |= {(0x6078, 0): (0, 2)}
    for number in range(4):
        for base in (0x1400, 0x1800):
            objects |= {(base + number, 1): (0x80000000, 4), (base + number, 2): (255, 1)}
        for base in (0x1600, 0x1A00):
            objects |= {(base + number, sub): (0, 1 if sub == 0 else 4) for sub in range(9)}
    return objects


@dataclass
class PlainDrive:
    """One drive: frames in, frames out. The lower half are its ways to misbehave."""

    node: int
    objects: dict[tuple[int, int], tuple[int, int]] = field(default_factory=_objects)
    nmt: int = 0x7F
    state: str = "disabled"
    controlword: int = 0
    goal: int | None = None
    flags: int = 0x10
    sync_t: float | None = None
    heartbeat_t: float = -1e9
    controlwords: list[int] = field(default_factory=list[int])

    mute: bool = False
    refuses: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])
    keeps: set[tuple[int, int]] = field(default_factory=set[tuple[int, int]])
    deaf_to: set[int] = field(default_factory=set[int])
    """controlwords (low byte) that it ignores"""
    drops_tpdo: int = -1
    stubborn_mode: bool = False
    host_t: float | None = None
    acknowledges_early: bool = False
    """bit 12 is high from the moment it is enabled until the end of its first handshake"""
    acts_on_changes_only: bool = False
    """in quick stop an enable has no effect that its controlword already has"""
    starts_without_error_only: bool = False
    """NMT start is ignored while 1001 is not 0, as CANopenNode does"""

    def get(self, index: int, sub: int = 0) -> int:
        return self.objects[index, sub][0]

    def put(self, index: int, value: int, sub: int = 0) -> None:
        self.objects[index, sub] = (value, self.objects[index, sub][1])

    def receive(self, frame_id: int, data: bytes, t: float) -> list[tuple[int, bytes]]:
        if self.mute:
            return []
        if frame_id == 0x000 and data[1] == self.node:
            if data[0] != 0x01 or not (self.starts_without_error_only and self.get(0x1001)):
                self.nmt = {0x01: 0x05, 0x02: 0x04, 0x80: 0x7F}[data[0]]
        elif frame_id == 0x77F:
            self.host_t = t
        elif frame_id == 0x080:
            return self._sync(t)
        elif frame_id == 0x600 + self.node:
            return [(0x580 + self.node, answer)] if (answer := self._sdo(data)) else []
        elif frame_id == self.get(0x1400, 1) and self.nmt == 0x05:
            self._rpdo(data)
        return []

    def watch_host(self, t: float) -> list[tuple[int, bytes]]:
        """The heartbeat consumer: quick stop, and an emergency, where the host has gone."""
        timeout = (self.get(0x1016, 1) & 0xFFFF) / 1000.0
        if self.host_t is None or not timeout or t - self.host_t <= timeout:
            return []
        self.host_t = None
        if self.state == "enabled":
            self.state, self.goal = "quick stop", None
        return [(0x80 + self.node, struct.pack("<HB5x", 0x8130, 0x11))]

    def fail(self, code: int) -> tuple[int, bytes]:
        self.state, self.goal = "fault", None
        return 0x80 + self.node, struct.pack("<HB5x", code, 0x21)

    def _sdo(self, data: bytes) -> bytes | None:
        command, index, sub = struct.unpack("<BHB", data[:4])
        if command == 0x80:
            return None
        key = (index, sub)
        refusal = 0x06020000 if key not in self.objects else self.refuses.get(key, 0)
        if refusal:
            return struct.pack("<BHBI", 0x80, index, sub, refusal)
        value, size = self.objects[key]
        if command == 0x40:
            if index == 0x6041:
                value = self._statusword()
            raw = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
            return struct.pack("<BHB", 0x43 | (4 - size) << 2, index, sub) + raw.ljust(4, b"\0")
        written = 4 - (command >> 2 & 3)
        number = int.from_bytes(data[4 : 4 + written], "little", signed=index in _SIGNED)
        if key not in self.keeps:
            self.objects[key] = (number, size)
        if index == 0x6060 and not self.stubborn_mode:
            self.put(0x6061, number)
        if index == 0x6040:
            self._control(number)
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def _rpdo(self, data: bytes) -> None:
        word, mode, target = struct.unpack("<Hbi", data)
        if not self.stubborn_mode:
            self.put(0x6061, mode)
        self.put(0x607A, target)
        self._control(word)

    def _control(self, word: int) -> None:
        self.controlwords.append(word)
        if word & 0xFF in self.deaf_to:
            return
        before, self.controlword = self.controlword, word
        low = word & 0x8F
        if self.state == "fault":
            if word & 0x80 and not before & 0x80:
                self.state = "disabled"
        elif low & 0x02 == 0:
            self.state = "disabled"
        elif low & 0x06 == 0x02:
            self.state = "quick stop" if self.state in ("enabled", "quick stop") else "disabled"
            self.goal = None
        elif low & 0x07 == 0x06:
            self.state = "ready" if self.state != "quick stop" else self.state
        elif low & 0x0F == 0x07 and self.state in ("ready", "enabled"):
            self.state = "on"
        elif low & 0x0F == 0x0F and self.state in ("on", "quick stop"):
            again = self.state == "quick stop" and before & 0x0F == 0x0F
            self.state = self.state if again and self.acts_on_changes_only else "enabled"
        if self.state == "enabled":
            if word & 0x10 and not before & 0x10:
                self.goal = self.get(0x607A)
            ended = before & 0x10 and not word & 0x10
            self.acknowledges_early = self.acknowledges_early and not ended
            early = self.acknowledges_early
            self.flags = self.flags | 0x1000 if word & 0x10 or early else self.flags & ~0x1000

    def _statusword(self) -> int:
        reached = self.goal is None or self.goal == self.get(0x6064)
        return _STATUS[self.state] | self.flags | (0x400 if reached else 0)

    def _sync(self, t: float) -> list[tuple[int, bytes]]:
        self._move(0.0 if self.sync_t is None else t - self.sync_t)
        self.sync_t = t
        out: list[tuple[int, bytes]] = []
        period = self.get(0x1017) / 1000.0
        if period and t - self.heartbeat_t >= period - 1e-9:
            self.heartbeat_t = t
            out.append((0x700 + self.node, bytes([self.nmt])))
        if self.nmt == 0x05:
            first = struct.pack("<Hib", self._statusword(), self.get(0x6064), self.get(0x6061))
            second = struct.pack("<ih", self.get(0x606C), self.get(0x6078))
            tpdos = [(self.get(0x1800 + n, 1) & 0x7FF, data) for n, data in enumerate((first, second))]
            out += [tpdo for n, tpdo in enumerate(tpdos) if n != self.drops_tpdo]
        return out

    def _move(self, dt: float) -> None:
        position, speed = self.get(0x6064), self.get(0x6081)
        halted = bool(self.controlword & 0x100)
        if self.goal is None or self.state != "enabled" or halted or dt == 0.0:
            self.put(0x606C, 0)
            return
        step = max(-speed * dt, min(speed * dt, self.goal - position))
        self.put(0x6064, position + round(step))
        self.put(0x606C, round(step / dt))


class InProcessBus:
    """A transport that hands each frame to the drives and their answers back, all within `send`."""

    at_once = True

    def __init__(self, drives: list[PlainDrive]) -> None:
        self.drives = drives
        self.fault: str | None = None
        self.remark = ""
        self.sent: list[tuple[int, bytes]] = []
        self.unplugged = False
        self._receivers: list[Callable[[CanFrame], None]] = []
        self._observers: list[Callable[[CanFrame], None]] = []

    def send(self, frame_id: int, data: bytes) -> None:
        if self.unplugged:
            raise BusError("unplugged")
        t = asyncio.get_running_loop().time()
        self.sent.append((frame_id, data))
        for drive in self.drives:
            for answer_id, answer in drive.receive(frame_id, data, t):
                self.deliver(answer_id, answer)

    def deliver(self, frame_id: int, data: bytes) -> None:
        frame = CanFrame(frame_id, data, asyncio.get_running_loop().time())
        for receiver in self._receivers:
            receiver(frame)

    def subscribe(self, receiver: Callable[[CanFrame], None]) -> None:
        self._receivers.append(receiver)

    def tap(self, observer: Callable[[CanFrame], None]) -> None:
        self._observers.append(observer)

    def call(self, key: int, exchange: Callable[[], T]) -> Awaitable[T]:
        async def at_once() -> T:
            return exchange()

        return at_once()

    def close(self) -> None:
        pass


class JumpingLoop(asyncio.SelectorEventLoop):
    """Time passes only when nothing is left to do."""

    _jumped = 0.0

    def time(self) -> float:
        return self._jumped

    def _run_once(self) -> None:
        if not self._ready and self._scheduled:  # pyright: ignore
            self._jumped = max(self._jumped, self._scheduled[0].when())  # pyright: ignore
        super()._run_once()  # pyright: ignore


@dataclass
class Bench:
    """One winch on an in-process bus, its control loop running."""

    drive: PlainDrive
    bus: InProcessBus
    master: CanopenMaster
    winch: Cia402Winch
    loop_task: asyncio.Task[None]

    async def ready(self) -> None:
        await self.winch.configure()

    async def enabled(self) -> None:
        await self.winch.configure()
        await self.winch.enable()

    async def cycles(self, count: int) -> None:
        await self.master.clock.sleep(count * self.master.period)


def make_config(**changes: Any) -> WinchConfig:
    values: dict[str, Any] = {
        "name": "winch 3",
        "node_id": 3,
        "counts_per_turn": 20000.0,
        "drum_radius": 0.03,
        "rated_current": 4.0,
        "current_limit": 6.0,
        "max_speed": 0.5,
        "max_acceleration": 1.0,
        "length_limits": (0.5, 3.0),
        "home_length": 1.0,
        "sdo_timeout": 0.05,
        "step_timeout": 0.2,
    }
    return WinchConfig(**(values | changes))


@pytest.fixture
def config() -> Callable[..., WinchConfig]:
    return make_config


@pytest.fixture
def plain_drive() -> Callable[[int], PlainDrive]:
    return PlainDrive


@pytest.fixture
def in_process_bus() -> Callable[[list[PlainDrive]], InProcessBus]:
    return InProcessBus


@pytest.fixture
def jump() -> Callable[[Coroutine[Any, Any, Any]], Any]:
    """Run a coroutine on a loop whose time jumps."""

    def run(main: Coroutine[Any, Any, Any]) -> Any:
        with asyncio.Runner(loop_factory=JumpingLoop) as runner:
            return runner.run(main)

    return run


@asynccontextmanager
async def controlled(master: CanopenMaster) -> AsyncIterator[asyncio.Task[None]]:
    """While the master's control loop runs."""
    task = asyncio.create_task(master.run())
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
def control_loop() -> Callable[[CanopenMaster], Any]:
    return controlled


@pytest.fixture
def on_bench(jump: Callable[..., Any]) -> Callable[..., Any]:
    """Run `script(bench)` with one winch, its drive and a running control loop."""

    def run(script: Callable[[Bench], Coroutine[Any, Any, None]], **changes: Any) -> None:
        async def main() -> None:
            drive = PlainDrive(3)
            bus = InProcessBus([drive])
            master = CanopenMaster(bus, LoopClock())
            winch = Cia402Winch(make_config(**changes), master)
            async with controlled(master) as task:
                await script(Bench(drive, bus, master, winch, task))

        jump(main())

    return run


@pytest.fixture
def against() -> Callable[..., None]:
    """Run `script(transport, master, winch)` against a peer behind slcan on a TCP port, in real time."""

    def run(port: int, script: Callable[..., Awaitable[None]], kind: Any = Cia402Winch, **changes: Any) -> None:
        async def main() -> None:
            transport = PythonCanTransport("slcan", f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
            master = CanopenMaster(transport, LoopClock(), sync_rate=50.0)
            slow = {"sdo_timeout": 2.0, "step_timeout": 5.0, "sample_age": 1.0, "rated_current": 5.0}
            winch = kind(make_config(**(slow | changes)), master)
            with closing(transport):
                async with controlled(master):
                    await script(transport, master, winch)

        asyncio.run(main())

    return run


@pytest.fixture
def there_and_back() -> Callable[..., Awaitable[bytes]]:
    """A long text to object 2FFF and back, in segments or in blocks."""

    async def exchange(transport: Any, master: Any, text: bytes, *, block: bool) -> bytes:
        sdo = master._network[3].sdo
        sdo.RESPONSE_TIMEOUT = 2.0

        def at_once() -> bytes:
            with sdo.open(0x2FFF, 0, "wb", size=len(text), block_transfer=block) as file:
                file.write(text)
            with sdo.open(0x2FFF, 0, "rb", block_transfer=block) as file:
                return file.read()

        return await transport.call(3, at_once)

    return exchange
