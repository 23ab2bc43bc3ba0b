"""What the terminal UI costs, attached to a service that says new things ten times a second: CPU time, bytes written.

    python -m benchmarks.ui_cost [--seconds 20]     share of a core and kB/s to the terminal, on each screen

CPU time is the process's own (/proc), so that other work on the computer does not count.
"""

import argparse
import asyncio
import math
import os
import pty
import struct
import subprocess
import sys
import tempfile
from fcntl import ioctl
from pathlib import Path
from termios import TIOCSWINSZ

from drivers.clock import LoopClock
from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.messages import (
    BusState,
    EquilibriumState,
    GuardState,
    History,
    MocapState,
    Samples,
    Status,
    StepState,
    Welcome,
    WinchState,
)
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.service.process.hub import Hub

TICK = os.sysconf("SC_CLK_TCK")
ROWS, COLUMNS = 24, 80
WINDOWS = tuple(f"i{k:02}" for k in range(1, 13))
SCREENS = {"1": "Session", "2": "Rig", "3": "Window", "4": "Result", "6": "Log"}
COMMAND = "from fidim_lab.app.cli import main; main()"


def state(t: float) -> Status:
    """Every number another one each time."""
    swing = math.sin(6.0 * t)
    winches = tuple(
        WinchState(
            name=f"winch {k}",
            drive="operation enabled",
            length=1.4 + 1e-4 * swing,
            speed=1e-3 * swing,
            tension=60.0 + 10.0 * swing,
            temperature=31.0,
            following_error=1e-4 * abs(swing),
            age=0.01,
            tension_limits=(20.0, 200.0),
        )
        for k in (1, 2, 3, 4)
    )
    left = max(750.0 - t, 0.0)
    return Status(
        t=t,
        wall=f"2026-01-02T10:{int(t) // 60 % 60:02}:{t % 60:06.3f}",
        phase="running",
        latched=False,
        step=StepState(
            number=5,
            step="Record",
            window="i03",
            text="record 10 s",
            phase="recording",
            fraction=t % 10 / 10,
            left=left,
        ),
        winches=winches,
        mocap=MocapState(
            rate=100.0,
            measured_rate=99.0 + swing,
            age=0.01,
            position=(1.1 + 0.02 * swing, -0.27, -0.31),
            markers_seen=1,
            counters={"received": int(100 * t)},
        ),
        bus=BusState(load=0.12, frames=940.0 + swing),
        guards=(GuardState(name="tension", state="armed", reaction="quick stop"),),
        equilibria=tuple(EquilibriumState(window=w, role="identify", state="waiting") for w in WINDOWS),
    )


def samples(t: float) -> Samples:
    """Ten frames of a recording; a new attempt every ten seconds."""
    times = tuple(t + 0.01 * k for k in range(10))
    none = tuple(() for _ in times)
    places = tuple((1.1 + 0.02 * math.sin(6 * x), -0.27 + 0.04 * math.cos(8 * x), -0.31) for x in times)
    return Samples(window="i03", attempt=int(t // 10) + 1, t=times, positions=places, tensions=none, lengths=none)


def cpu(pid: int) -> float:
    """s of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


async def measure(seconds: float) -> None:
    """Print a line for each screen."""
    clock = LoopClock()
    with tempfile.TemporaryDirectory(prefix="fu") as base:
        os.environ["FIDIM_RUNTIME_DIR"] = base
        place, folder = ServicePlace(Path(base), "x"), Path(base) / "run"
        folder.mkdir()
        greeting = Welcome(
            you=1, run="twelve windows", folder=str(folder), rig="rig", windows=WINDOWS, winches=("winch 1",)
        )
        hub = Hub(lambda *_: None, lambda _: map(encode, (greeting, History(events=()), state(0.0))), lambda _: None)
        with held(place, folder):
            await hub.listen_unix(place.socket)
            telling = asyncio.ensure_future(_tell(hub, clock))
            try:
                await _watch(clock, folder, seconds)
            finally:
                telling.cancel()
                hub.close()


async def _tell(hub: Hub, clock: LoopClock) -> None:
    begin = clock.now()
    while True:
        await clock.sleep(0.1)
        hub.tell(state(clock.now() - begin))
        hub.tell(samples(clock.now() - begin))


async def _watch(clock: LoopClock, folder: Path, seconds: float) -> None:
    ours, theirs = pty.openpty()
    ioctl(theirs, TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
    words = [sys.executable, "-c", COMMAND, "ui", str(folder)]
    process = subprocess.Popen(words, stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
    written = [0, 0]

    def read() -> None:
        data = os.read(ours, 1 << 16)
        written[0] += len(data)
        written[1] += data.count(b"\x1b[2J")

    asyncio.get_running_loop().add_reader(ours, read)
    try:
        await clock.sleep(8.0)
        for key, name in SCREENS.items():
            os.write(ours, key.encode())
            await clock.sleep(2.0)
            before, cleared, begin, spent = written[0], written[1], clock.now(), cpu(process.pid)
            await clock.sleep(seconds)
            passed = clock.now() - begin
            share = 100 * (cpu(process.pid) - spent) / passed
            rate = (written[0] - before) / passed / 1e3
            print(f"{name:8} {share:5.1f} % of a core  {rate:6.1f} kB/s  {written[1] - cleared} times cleared")
    finally:
        asyncio.get_running_loop().remove_reader(ours)
        process.kill()
        process.wait()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    asyncio.run(measure(parser.parse_args().seconds))
