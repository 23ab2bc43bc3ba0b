"""How long the emergency stop takes from the key in a real terminal to the service, in every state of the UI.

    python -m benchmarks.ui_stop [--times 10]     median and longest delay of each state, ms

The bytes of F12 go into a pseudo-terminal; the clock ends where the service's socket has the command. The UI draws ten
new states a second meanwhile (`benchmarks.ui_cost`).
"""

import argparse
import asyncio
import json
import os
import pty
import statistics
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from fcntl import ioctl
from pathlib import Path
from termios import TIOCSWINSZ

from benchmarks.ui_cost import COMMAND, WINDOWS, samples, state
from drivers.clock import LoopClock
from fidim_lab.app.service.commands import EmergencyStop
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.messages import Answer, History, Question, Welcome
from fidim_lab.app.service.place import CHOSEN, ServicePlace
from fidim_lab.app.service.process.hub import Hub

F12, ESCAPE, PALETTE = b"\x1b[24~", b"\x1b", b"\x10"
LONGEST = 10.0
"""s that a stop is waited for"""
QUESTION = Question(number=1, kind="confirm", window="i03", text="Is the platform still?", choices=("done", "abort"))


class Bench:
    """A service and a UI in a pseudo-terminal."""

    def __init__(self, folder: Path, clock: LoopClock) -> None:
        self.folder, self.clock = folder, clock
        self.heard = asyncio.Event()
        greeting = Welcome(you=1, run="run", folder=str(folder), rig="rig", windows=WINDOWS, winches=("winch 1",))
        said = [greeting, History(events=()), state(0.0), QUESTION]
        self.hub = Hub(self._answer, lambda _: said, lambda _: None)
        self.quiet = False
        self._ours, self._theirs = pty.openpty()

    def _answer(self, _: object, request: object) -> Answer:
        if isinstance(request.command, EmergencyStop):
            self.heard.set()
        return Answer(id=request.id, ok=True, says="stopped")

    async def tell(self) -> None:
        """States and samples, for ever."""
        begin = self.clock.now()
        while True:
            await self.clock.sleep(0.1)
            if not self.quiet:
                self.hub.tell(state(self.clock.now() - begin).model_copy(update={"prompt": 1}))
                self.hub.tell(samples(self.clock.now() - begin))

    def size(self, rows: int, columns: int) -> None:
        ioctl(self._theirs, TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def start(self) -> "subprocess.Popen[bytes]":
        """The UI; what it draws is read and thrown away."""
        self.size(24, 80)
        environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        words = [sys.executable, "-c", COMMAND, "ui", str(self.folder)]
        asyncio.get_running_loop().add_reader(self._ours, lambda: os.read(self._ours, 1 << 16))
        return subprocess.Popen(
            words, stdin=self._theirs, stdout=self._theirs, stderr=self._theirs, env=environment, start_new_session=True
        )

    async def press(self, *keys: bytes) -> None:
        for key in keys:
            os.write(self._ours, key)
            await self.clock.sleep(0.4)

    async def stop(self) -> float:
        """s from the key to the service."""
        self.heard.clear()
        begin = self.clock.now()
        os.write(self._ours, F12)
        await asyncio.wait_for(self.heard.wait(), LONGEST)
        return self.clock.now() - begin


def spoil(path: Path, how: str) -> None:
    """A file of the run that cannot be read."""
    path.unlink(missing_ok=True)
    if how == "fifo":
        os.mkfifo(path)
    elif how == "nested":
        path.write_text('{"a":' * 200_000, encoding="utf-8")
    else:
        table = {"format": "fidim-explanation/1", "verdict": "explained", "message": "word " * 1_500_000}
        path.write_text(json.dumps(table), encoding="utf-8")


async def measure(times: int) -> None:
    """Print a line for each state."""
    clock = LoopClock()
    with tempfile.TemporaryDirectory(prefix="fu") as base:
        runtime, folder = Path(base) / "rt", Path(base) / "run"
        runtime.mkdir(mode=0o700)
        folder.mkdir()
        os.environ[CHOSEN] = str(runtime)
        bench, place = Bench(folder, clock), ServicePlace(runtime, "x")
        with held(place, folder):
            await bench.hub.listen_unix(place.socket)
            telling = asyncio.ensure_future(bench.tell())
            process = bench.start()
            try:
                await clock.sleep(8.0)
                await _walk(bench, times, folder)
            finally:
                process.kill()
                process.wait()
                telling.cancel()
                bench.hub.close()


async def _walk(bench: Bench, times: int, folder: Path) -> None:
    nothing: Callable[[], None] = lambda: None  # noqa: E731
    screens = [
        (f"screen {name}", [key], nothing)
        for name, key in zip(
            ("Session", "Rig", "Window", "Result", "Why", "Log"), (b"1", b"2", b"3", b"4", b"5", b"6"), strict=True
        )
    ]
    over = [
        ("help", [b"?"]),
        ("abort?", [b"x"]),
        ("skip: reason", [b"k"]),
        ("filter", [b"/", b"d"]),
        ("palette", [PALETTE, b"a"]),
    ]
    files = [
        (f"{name} {how}", [b"5"], lambda name=name, how=how: spoil(folder / name, how))
        for how in ("fifo", "nested", "large")
        for name in ("result.json", "explanation.json")
    ]
    sizes = [
        (f"terminal {columns} × {rows}", [b"1"], lambda r=rows, c=columns: bench.size(r, c))
        for rows, columns in ((2, 5), (12, 50), (60, 200), (24, 80))
    ]
    for name, keys, first in [*screens, *((n, k, nothing) for n, k in over), *files, *sizes]:
        await bench.press(*keys)
        first()
        delays = []
        for _ in range(times):
            await bench.clock.sleep(0.23)
            delays.append(await bench.stop())
        print(
            f"{name:26} median {1e3 * statistics.median(delays):6.0f} ms, longest {1e3 * max(delays):6.0f} ms",
            flush=True,
        )
        await bench.press(ESCAPE, ESCAPE)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=10)
    asyncio.run(measure(parser.parse_args().times))
