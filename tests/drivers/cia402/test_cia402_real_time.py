"""The same classes in real time: python-can's virtual bus, a drive on a thread of its own, the usual event loop."""

import asyncio
import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can
import pytest

from drivers.canbus.candump import CandumpLog, read_candump
from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.errors import BusError

_numbers = itertools.count()
PATIENT = {"host_timeout": 1.0, "heartbeat": 0.5, "sdo_timeout": 5.0, "step_timeout": 20.0, "sample_age": 2.0}
"""s: a busy machine lets threads wait"""
WITHIN = 30.0
"""s in which what is expected comes on any machine"""


async def until(master: CanopenMaster, condition: Callable[[], object]) -> None:
    async with asyncio.timeout(WITHIN):
        while not condition():
            await master.clock.sleep(0.01)


@dataclass
class DriveThread:
    """Drives on the other end of the bus."""

    channel: str
    drives: list[Any]
    _end: threading.Event = field(default_factory=threading.Event)

    def serve(self) -> None:
        with can.Bus(self.channel, "virtual") as bus:
            while not self._end.is_set():
                message = bus.recv(0.002)
                now = time.monotonic()
                answers: list[tuple[int, bytes]] = []
                for drive in self.drives:
                    if message is not None:
                        answers += drive.receive(message.arbitration_id, bytes(message.data), now)
                    answers += drive.watch_host(now)
                for frame_id, data in answers:
                    bus.send(can.Message(arbitration_id=frame_id, data=data, is_extended_id=False))

    def stop(self) -> None:
        self._end.set()


@pytest.fixture
def on_real_bus(
    plain_drive: Callable[[int], Any], config: Callable[..., WinchConfig], control_loop: Callable[[CanopenMaster], Any]
) -> Iterator[Callable[..., None]]:
    channel = f"fidim-rt-{next(_numbers)}"
    drives = [plain_drive(node) for node in (1, 2)]
    peer = DriveThread(channel, drives)
    thread = threading.Thread(target=peer.serve)
    thread.start()

    def run(script: Callable[..., Any]) -> None:
        async def main() -> None:
            transport = PythonCanTransport("virtual", channel)
            master = CanopenMaster(transport, LoopClock(), sync_rate=100.0)
            winches = [Cia402Winch(config(name=f"w{n}", node_id=n, **PATIENT), master) for n in (1, 2)]
            with closing(transport):
                async with control_loop(master) as task:
                    await script(transport, master, winches, drives, task)

        asyncio.run(main())

    yield run
    peer.stop()
    thread.join(30.0)


def test_two_winches_move_together(on_real_bus: Callable[..., None], tmp_path: Path) -> None:
    async def script(transport: Any, master: Any, winches: Any, drives: Any, task: Any) -> None:
        log = CandumpLog(tmp_path / "can.log")
        transport.tap(log.write)
        await asyncio.gather(*(w.configure() for w in winches))
        await asyncio.gather(*(w.enable() for w in winches))
        await asyncio.gather(winches[0].move_to(1.02, 0.2, 1.0), winches[1].move_to(0.98, 0.2, 1.0))
        await until(master, lambda: all(w.latest().target_reached for w in winches))
        assert [w.latest().length for w in winches] == pytest.approx([1.02, 0.98], abs=1e-4)
        await winches[0].hold()
        assert winches[0].latest().state is DriveState.OPERATION_ENABLED
        for winch in winches:
            winch.power_off()
        await until(master, lambda: [drive.state for drive in drives] == ["disabled", "disabled"])
        assert [w.latest().fault for w in winches] == ["", ""]
        log.close()
        frames = list(read_candump(tmp_path / "can.log"))
        assert {0x080, 0x77F, 0x181, 0x282, 0x201, 0x581, 0x602, 0x702} <= {f.id for f in frames}

    on_real_bus(script)


def test_when_the_control_loop_dies_the_drives_stop_themselves(on_real_bus: Callable[..., None]) -> None:
    async def script(transport: Any, master: Any, winches: Any, drives: Any, task: Any) -> None:
        for winch in winches:
            await winch.configure()
            await winch.enable()
        task.cancel()
        await until(master, lambda: [drive.state for drive in drives] == ["quick stop", "quick stop"])
        await until(master, lambda: "0x8130" in winches[0].latest().fault)
        await until(master, lambda: winches[0].latest().state is DriveState.UNKNOWN)

    on_real_bus(script)


def test_when_receiving_dies_the_drives_are_told_to_stop(on_real_bus: Callable[..., None]) -> None:
    async def script(transport: Any, master: Any, winches: Any, drives: Any, task: Any) -> None:
        for winch in winches:
            await winch.configure()
            await winch.enable()
        transport._receiver.on_error(OSError("unplugged"))
        with pytest.raises(BusError, match="unplugged"):
            await task
        await until(master, lambda: [drive.state for drive in drives] == ["quick stop", "quick stop"])

    on_real_bus(script)
