"""SIGKILL at random moments of a recording: how much of the open window is lost, and whether a finished one ever is.

    python benchmarks/killed_recording.py [KILLS] [SEED]        (100 kills take about two minutes)

A child records one window after the other from a 100 Hz source in real time and tells each frame and each accepted
window through a pipe the moment it has them; then it is killed, and its folder is looked at.
"""

import asyncio
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

from drivers.clock import LoopClock
from drivers.disk import DiskThreads
from drivers.ports import DriveState, MarkerFrame, WinchSample
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.data.window_mcap import ROWS, read_window_mcap
from procedures.recording.recorder import Recorder

RATE = 100.0
SECONDS = 0.8
"""of one window"""
LONGEST = 2.5
"""s until a child is killed at the latest"""


@dataclass(frozen=True)
class Kill:
    """One child's end."""

    open_rows: int
    """rows that the open window had in the child's memory or on the disk; 0: none was open"""
    lost_csv: float
    """s of them that are not in the CSV file"""
    lost_mcap: float
    """s of them that are not in the MCAP file"""
    stall: float
    """s, longest time by which the child's own loop was late: a busy machine, not the recorder"""
    finished: int
    """windows accepted before the kill"""
    finished_whole: int
    """of them those that can be read whole, in both files"""


class Source:
    """Frames by the clock; tells each one that was handed out."""

    rate = RATE

    def __init__(self, clock: LoopClock, pipe: int) -> None:
        self._clock, self._pipe = clock, pipe

    def latest(self) -> None:
        """Nobody asks."""

    def counters(self) -> dict[str, int]:
        """Nothing is counted."""
        return {}

    async def frames(self) -> AsyncIterator[MarkerFrame]:
        """One every 10 ms."""
        begin = self._clock.now()
        for number in range(1_000_000):
            await self._clock.sleep(begin + number / RATE - self._clock.now())
            now = self._clock.now()
            yield MarkerFrame(now, number, ((0.001 * number, 0.0, 0.0),))
            os.write(self._pipe, b"f %.6f\n" % now)  # after the yield: the recorder has it


class Drum:
    """A winch that stands."""

    name = "winch 1"

    def __init__(self, clock: LoopClock) -> None:
        self._clock = clock

    def latest(self) -> WinchSample:
        """As of now."""
        return WinchSample(self._clock.now(), DriveState.OPERATION_ENABLED, 1.0, 0.0, 2.0, True)


def record_for_ever(folder: Path, pipe: int) -> None:
    """The child: windows w1, w2, … until somebody kills it."""

    async def main() -> None:
        clock = LoopClock()
        source, drums, disk = Source(clock, pipe), (Drum(clock),), DiskThreads()
        recorder = Recorder(folder, clock, source, drums, 1, 0.2, disk=disk)  # type: ignore[arg-type]
        for number in range(1, 1000):
            os.write(pipe, b"begin\n")
            await recorder.record(f"w{number}", 1, SECONDS, lambda _: None)
            await recorder.accept(f"w{number}")
            os.write(pipe, b"accepted\n")

    asyncio.run(main())


def kill_one(folder: Path, after: float) -> Kill:
    """Start a child, kill it after so many s, and look at what is there."""
    for name in ("windows", "rejected"):
        (folder / name).mkdir(parents=True)
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        try:
            record_for_ever(folder, writing)
        finally:
            os._exit(1)
    os.close(writing)
    time.sleep(after)  # noqa: TID251 - another process is to be killed in real time
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(reading, "rb") as pipe:
        told = [line.decode() for line in pipe.read().splitlines(keepends=True) if line.endswith(b"\n")]
    return look(folder, told)


def look(folder: Path, told: list[str]) -> Kill:
    """What the folder of a killed child holds, beside what the child told."""
    accepted = [k for k, line in enumerate(told) if line == "accepted\n"]
    begun = [k for k, line in enumerate(told) if line == "begin\n"]
    whole = sum(_whole(folder, number) for number in range(1, len(accepted) + 1))
    opened = begun[-1] if begun and (not accepted or begun[-1] > accepted[-1]) else None
    times = [] if opened is None else [float(line[2:]) for line in told[opened + 1 :] if line.startswith("f ")]
    gaps = [b - a - 1.0 / RATE for a, b in pairwise(times)]
    window = f"w{len(accepted) + 1}"
    csv, mcap = _rows(folder, window)
    return Kill(
        open_rows=len(times),
        lost_csv=max(0.0, (len(times) - csv) / RATE),
        lost_mcap=max(0.0, (len(times) - mcap) / RATE),
        stall=max([0.0, *gaps]),
        finished=len(accepted),
        finished_whole=whole,
    )


def _whole(folder: Path, number: int) -> bool:
    path = folder / "windows" / f"w{number}.csv"
    rows = round(SECONDS * RATE) + 1
    return len(read_window_csv(path, 1).t) == rows == len(read_window_mcap(path.with_suffix(".mcap"), 1).t)


def _rows(folder: Path, window: str) -> tuple[int, int]:
    """Rows of the open window in both files, under whichever name."""
    csv = [p for p in (folder / "windows").glob(f"{window}.csv*")]
    mcap = [p for p in (folder / "windows").glob(f"{window}.mcap*")]
    return (
        max(0, csv[0].read_bytes().count(b"\n") - 1) if csv else 0,
        len(read_mcap(mcap[0]).of(ROWS)) if mcap else 0,
    )


def kill_many(kills: int, seed: int) -> list[Kill]:
    """So many children, each killed at a random moment."""
    moments = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        return [kill_one(Path(folder) / str(k), moments.uniform(0.02, LONGEST)) for k in range(kills)]


def main() -> None:
    """Print the worst and every kill as JSON."""
    arguments = [int(a) for a in sys.argv[1:]]
    found = kill_many(arguments[0] if arguments else 100, arguments[1] if len(arguments) > 1 else 1)
    finished = sum(kill.finished for kill in found)
    summary = {
        "kills": len(found),
        "in_an_open_window": sum(kill.open_rows > 0 for kill in found),
        "worst_loss_csv_s": max(kill.lost_csv for kill in found),
        "worst_loss_mcap_s": max(kill.lost_mcap for kill in found),
        "longest_stall_s": round(max(kill.stall for kill in found), 3),
        "finished_windows": finished,
        "finished_windows_lost": finished - sum(kill.finished_whole for kill in found),
    }
    print(json.dumps({"summary": summary, "kills": [asdict(kill) for kill in found]}))


if __name__ == "__main__":
    main()
