"""From a drive's fault on the bus to the first quick-stop frame of the host, over many runs.

`python -m benchmarks.guard_reaction [--runs 60] [--real-time]` puts its table into docs/benchmarks/bus.md. On the clock
that jumps it is what cycle and guards cost; in real time, host and simulated devices share one process and computer.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import fidim_lab.data.robots as robots
from benchmarks.page import meanwhile as told_meanwhile
from benchmarks.page import spent, table, write_section
from benchmarks.rehearsal import Rehearsal
from drivers.cia402.profile.machine import Command
from drivers.cia402.profile.words import controlword
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot

OVERCURRENT = 0x2310
FAULTED = 2
"""the drive that reports it"""
QUICK_STOP = controlword(Command.QUICK_STOP)
STEPS = ("MoveTo", "Settle", "Ask")


def reaction(robot: Robot, folder: Path, step: str, after: float, *, real_time: bool) -> float | None:
    """s from the emergency frame to the last of the four drives' first quick stop; None where something else struck."""
    rehearsal = Rehearsal(robot, folder)
    rehearsal.real_time = real_time
    rehearsal.at(step, lambda stage: stage.drive(FAULTED).faults.raise_fault(OVERCURRENT), after=after)
    ended = rehearsal.run()
    emergency = next((f.t for f in ended.frames if f.id == 0x80 + FAULTED and f.data[:2] == b"\x10\x23"), None)
    if emergency is None or "0x2310" not in ended.report.reason:
        return None
    first: dict[int, float] = {}
    for t, node, word in ended.controlwords(since=emergency):
        if word == QUICK_STOP:
            first.setdefault(node, t)
    return max(first.values()) - emergency


def main() -> None:
    """Measure, print, write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--real-time", action="store_true")
    options = parser.parse_args()
    robot = read_robot(Path(robots.__path__[0]) / "irma4.toml")
    rng, before = np.random.default_rng(1), spent()
    with tempfile.TemporaryDirectory() as folder:
        found = [
            reaction(
                robot,
                Path(folder) / str(number),
                STEPS[number % len(STEPS)],
                float(rng.uniform(0.1, 0.5)),
                real_time=options.real_time,
            )
            for number in range(options.runs)
        ]
    times = 1e3 * np.array([one for one in found if one is not None])
    p50, p99 = np.percentile(times, [50, 99])
    clock = "in real time" if options.real_time else "on the jumping clock"
    head = ("runs", "told by another guard first", "p50, ms", "p99, ms", "worst, ms")
    row = (len(found), len(found) - len(times), f"{p50:.1f}", f"{p99:.1f}", f"{times.max():.1f}")
    text = f"{table(head, [row])}\n\n{told_meanwhile(before)}" if options.real_time else table(head, [row])
    command = f"python -m benchmarks.guard_reaction --runs {options.runs}" + " --real-time" * options.real_time
    write_section("bus", f"From a drive's fault to four quick stops, {clock}", command, text)
    print(text)


if __name__ == "__main__":
    main()
