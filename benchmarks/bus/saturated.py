"""A full bus: every frame of it through python-can, the raw log and the decoders, while SYNC goes out at 250 Hz."""

import asyncio
import json
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.bus.devices import NODES, winch_config
from benchmarks.bus.flood import FRAMES_PER_SECOND, MICROSECONDS
from benchmarks.page import table
from drivers.canbus.candump import CandumpLog, read_candump
from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanFrame
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock, precise_loop

SYNC = 250.0
"""Hz"""
ALL_ARRIVED = 0.5
"""s of silence after the last frame"""
HEAD = ["bus", "sent", "lost", "in the raw log", "a second", "sent → decoded: p50, p99, worst, ms", "CPU: host, sender"]


def saturated(over: list[str], minutes: float) -> str:
    """The table."""
    rows: list[list[str]] = []
    for kind in over:
        with asyncio.Runner(loop_factory=precise_loop) as runner:
            rows.append(runner.run(_measure(kind, 60.0 * minutes)))
        print(" | ".join(rows[-1]), flush=True)
    full = f"\n\nFrames of 6 and 7 bytes: {FRAMES_PER_SECOND:.0f} a second fill 1 Mbit/s at worst-case stuffing."
    return table(HEAD, rows) + full + " (Of 8 bytes it would be 7407.)"


async def _measure(over: str, seconds: float) -> list[str]:
    command = [sys.executable, "-m", "benchmarks.bus.flood", over, str(seconds)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    if process.stdin is None or process.stdout is None:
        sys.exit("the flood has no pipes")
    numbers: dict[int, list[int]] = {node: [] for node in NODES}
    delays: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        try:
            channel = json.loads(process.stdout.readline())["channel"]
            transport = PythonCanTransport("slcan", channel, sleep_after_open=0.1)
            clock, log = LoopClock(), CandumpLog(Path(folder) / "can.log")
            transport.tap(log.write)
            master = CanopenMaster(transport, clock, sync_rate=SYNC)
            for node in NODES:
                master.add_node(winch_config(node))

            def hear(frame: CanFrame) -> None:
                if frame.id & 0x780 == 0x180:
                    numbers[frame.id - 0x180].append(struct.unpack_from("<i", frame.data, 2)[0])
                else:
                    sent = struct.unpack_from("<i", frame.data)[0]
                    delays.append(((int(time.monotonic() * 1e6) - sent) & MICROSECONDS) / 1e6)

            transport.subscribe(hear)
            loop = asyncio.create_task(master.run())
            await clock.sleep(0.1)
            begun, spent, garbled = time.monotonic(), time.process_time(), transport.counters.garbled
            process.stdin.write("go\n")
            process.stdin.flush()
            told = json.loads(await asyncio.to_thread(process.stdout.readline))
            wall, spent = time.monotonic() - begun, time.process_time() - spent
            await clock.sleep(ALL_ARRIVED)
            loop.cancel()
            await asyncio.gather(loop, return_exceptions=True)
            received = transport.counters.received
            transport.close()
            log.close()
            logged = sum(frame.id & 0x780 in (0x180, 0x280) for frame in read_candump(Path(folder) / "can.log"))
        finally:
            process.kill()
            process.wait()
    whole = all(found == list(range(len(found))) for found in numbers.values())
    lost = int(told["sent"]) - received + garbled
    p50, p99, worst = 1e3 * np.quantile(delays, (0.5, 0.99, 1.0))
    return [
        over,
        f"{int(told['sent']):,}",
        f"{lost}" + ("" if whole else ", not in order"),
        f"{logged:,}",
        f"{told['sent'] / told['seconds']:.0f}",
        f"{p50:.2f}, {p99:.2f}, {worst:.1f}",
        f"{100 * spent / wall:.0f}, {100 * told['cpu']:.0f} %",
    ]
