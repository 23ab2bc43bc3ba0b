import asyncio
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from drivers.canbus.load import bus_load, frame_bits
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from fidim_lab.errors import BusError, SetupError

Jump = Callable[[Coroutine[Any, Any, Any]], Any]
Make = Callable[..., WinchConfig]
MakeBus = Callable[[list[Any]], Any]
MakeDrive = Callable[[int], Any]


@pytest.mark.parametrize(("size", "bits"), [(0, 55), (8, 135)])
def test_worst_case_frames(size: int, bits: int) -> None:
    assert frame_bits(size) == bits


def test_the_load_of_four_winches(in_process_bus: MakeBus, config: Make) -> None:
    for rate, low, high in ((100.0, 0.14, 0.18), (250.0, 0.35, 0.42), (500.0, 0.69, 0.8)):
        master = CanopenMaster(in_process_bus([]), LoopClock(), sync_rate=rate)
        for node in range(1, 5):
            master.add_node(config(node_id=node))
        assert low < master.load < high
    assert bus_load({8: 7407.0}, 1e6) == pytest.approx(1.0, abs=1e-3)


def test_a_bus_that_would_be_too_full_is_refused(in_process_bus: MakeBus, config: Make) -> None:
    master = CanopenMaster(in_process_bus([]), LoopClock(), sync_rate=250.0, bitrate=250e3)
    for node in (1, 2):
        master.add_node(config(node_id=node))
    before = master.load
    with pytest.raises(SetupError, match=r"would be 11\d% full with 3 of the winches at 250 Hz; allowed is 80%"):
        master.add_node(config(node_id=3))
    assert master.load == before


def test_what_cannot_be_set_up(in_process_bus: MakeBus, config: Make, tmp_path: Path) -> None:
    bus = in_process_bus([])
    with pytest.raises(SetupError, match="sync_rate: 0"):
        CanopenMaster(bus, LoopClock(), sync_rate=0.0)
    with pytest.raises(SetupError, match=r"heartbeat_period: 0\.001"):
        CanopenMaster(bus, LoopClock(), heartbeat_period=0.001)
    master = CanopenMaster(bus, LoopClock())
    master.add_node(config())
    with pytest.raises(SetupError, match="node_id 3 is taken"):
        master.add_node(config())
    with pytest.raises(SetupError, match=r"host_timeout: 0\.1 s found, must be at least 0\.15 s"):
        master.add_node(config(node_id=4, host_timeout=0.1))
    for text in (None, "", "nonsense"):
        eds = tmp_path / "x.eds"
        if text is not None:
            eds.write_text(text)
        with pytest.raises(SetupError, match=r"x\.eds"):
            master.add_node(config(node_id=5, eds=eds))


def test_sync_and_heartbeat_come_from_one_loop(in_process_bus: MakeBus, jump: Jump) -> None:
    async def main() -> None:
        bus = in_process_bus([])
        master = CanopenMaster(bus, LoopClock(), sync_rate=100.0, heartbeat_period=0.05)
        hung = asyncio.Event()

        def guard(t: float) -> None:
            if t >= 0.995:
                hung.set()
                raise BusError("a guard tripped")

        with pytest.raises(BusError, match="a guard tripped"):
            await master.run(guard)
        assert hung.is_set()
        assert [frame_id for frame_id, _ in bus.sent].count(0x080) == 101
        assert [frame for frame in bus.sent if frame[0] == 0x77F] == [(0x77F, b"\x05")] * 21
        await master.clock.sleep(1.0)
        assert bus.sent[-1][0] == 0x77F, "with the loop, the heartbeat ends"

    jump(main())


def test_a_loop_that_comes_late_skips_and_counts(in_process_bus: MakeBus) -> None:
    async def main() -> tuple[int, float]:
        master = CanopenMaster(in_process_bus([]), LoopClock(), sync_rate=100.0)
        hangs, begin = iter([True]), time.monotonic()

        def guard(t: float) -> None:
            if next(hangs, False):
                threading.Event().wait(0.06)  # the whole loop hangs

        task = asyncio.create_task(master.run(guard))
        await master.clock.sleep(0.1)
        task.cancel()
        return master.skipped, time.monotonic() - begin

    skipped, passed = asyncio.run(main())
    assert 4 <= skipped <= 6 + (passed - 0.1) / 0.01  # a busy machine adds hangs of its own


def test_a_quick_stop_for_all_reaches_those_it_can(in_process_bus: MakeBus, config: Make, jump: Jump) -> None:
    async def main() -> None:
        bus = in_process_bus([])
        master = CanopenMaster(bus, LoopClock())
        for node in (1, 2):
            master.add_node(config(node_id=node))
        master.quick_stop_all()
        assert [frame[0] for frame in bus.sent] == [0x601, 0x602]
        bus.unplugged = True
        master.quick_stop_all()

    jump(main())


def test_samples_carry_the_instant_of_their_sync(
    in_process_bus: MakeBus, plain_drive: MakeDrive, config: Make, jump: Jump
) -> None:
    async def main() -> None:
        bus = in_process_bus([plain_drive(3)])
        master = CanopenMaster(bus, LoopClock())
        winch = Cia402Winch(config(), master)
        syncs: list[float] = []
        task = asyncio.create_task(master.run(syncs.append))
        await winch.configure()
        sample = winch.latest()
        assert sample is not None
        assert sample.t == syncs[-1]
        task.cancel()

    jump(main())


def test_frames_nobody_waits_for_do_no_harm(in_process_bus: MakeBus, config: Make, jump: Jump) -> None:
    async def main() -> None:
        bus = in_process_bus([])
        link = CanopenMaster(bus, LoopClock()).add_node(config())
        for frame_id in (0x000, 0x083, 0x183, 0x283, 0x583, 0x703, 0x7FF):
            for size in range(9):
                bus.deliver(frame_id, bytes([0x55] * size))
        assert link.counters.malformed == 2 + 8 + 9
        assert link.values is None

    jump(main())


def test_four_winches_cost_little(in_process_bus: MakeBus, plain_drive: MakeDrive, config: Make, jump: Jump) -> None:
    """The budget of a dry run: 50 000 cycles in a small part of 20 s. Only the master's own share is measured."""

    async def main() -> float:
        drives = [plain_drive(node) for node in range(1, 5)]
        bus = in_process_bus(drives)
        master = CanopenMaster(bus, LoopClock())
        winches = [Cia402Winch(config(name=f"w{d.node}", node_id=d.node), master) for d in drives]
        task = asyncio.create_task(master.run())
        for winch in winches:
            await winch.configure()
        task.cancel()
        t = master.sync.current
        answers = [(i, data) for d in drives for i, data in d.receive(0x080, b"", t + 1.0) if i < 0x300]
        assert len(answers) == 8
        bus.drives = []
        start = time.process_time()
        for cycle in range(2000):
            master.sync.advance(t + 0.004 * cycle)
            for frame_id, data in answers:
                bus.deliver(frame_id, data)
        spent = (time.process_time() - start) / 2000
        assert all(w.latest() is not None for w in winches)
        return spent

    assert jump(main()) < 200e-6
