"""A session in real processes: killed and tripped at random moments, resumed each time; memory over a long one.

    python -m benchmarks.session chain --rounds 100 --sync 250      SIGKILL and guard trips by turns, then resume
    python -m benchmarks.session memory --minutes 60                growth of the service, frames lost, share of a core

Everything is on: four drives on a bus of the given SYNC rate, 200 Hz markers, recording, `fidim ui` in a terminal. The
computer runs the simulators, too. Times are of the monotonic clock, which all processes share.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.page import meanwhile, spent, table, write_section
from benchmarks.rig_processes import Bench, bench, comes, newest, pause, terminal_ui, wait_for
from drivers.canbus.candump import read_candump
from fidim_lab.data.campaign import read_campaign
from procedures.recording.journal import LineKind, read_journal

SECONDS = 6.0
"""of a window"""
LONGEST = 20.0
"""s until something happens at the latest, counted from motion-ready: windows begin 8 to 18 s after it"""
QUICK_STOP, ENABLED, READY = 0x02, 0x27, 0x21
NODES = (1, 2, 3, 4)
WINDOWS, TRIES = 40, 3
LEAST = 14.0
"""s that a window of ten takes at least"""
SETTLED = 20.0
"""s after which memory counts: by then everything has been imported and opened once"""


@dataclass(frozen=True)
class Round:
    """What one kill or one trip came to."""

    killed: bool
    ready: float
    """s from typing `fidim resume` to all drives enabled and the place checked"""
    lost: float | None = None
    """s of the open window that are in no file; None where none was open"""
    reaction: float | None = None
    """s from the violating frame on the bus to the last of the four quick-stop frames"""
    whole: bool = True
    """whether every window that had been accepted can be read, with all its rows"""
    tries: int = 1
    """of `fidim resume` until it went on"""


def chain(options: argparse.Namespace) -> str:
    """Rounds in one folder, until there are enough."""
    rng = random.Random(options.seed)
    rounds: list[Round] = []
    alone: list[str] = []
    """runs that ended before anything was done to them"""
    with tempfile.TemporaryDirectory() as place, ExitStack() as stack:
        made = stack.enter_context(bench(Path(place), options.sync, SECONDS, WINDOWS, options.slow, options.markers))
        folder, since = made.folder / "run", time.monotonic()
        process = made.run("run")
        since = wait_for(folder, LineKind.STEP_FINISHED, "Enable", since, process).t
        for number in range(options.rounds):
            with terminal_ui(made, "run") if options.ui else ExitStack():
                pause(rng.uniform(0.3, LONGEST))
                kill = bool(number % 2) if options.trips else True
                if process.poll() is not None:  # a guard was there first: this computer, or a fault of ours
                    alone.append(process.communicate()[0].splitlines()[-1])
                    print(number, alone[-1], flush=True)
                    process, _, _, since = _resume(made, folder)
                    continue
                found = _kill(made, folder, since) if kill else _trip(made, folder, process, rng.choice(NODES))
            process.communicate(timeout=60)
            process, ready, tries, since = _resume(made, folder)
            rounds.append(Round(kill, ready, found[0], found[1], _whole(made, folder), tries))
            print(number, rounds[-1], flush=True)
        os.kill(made.service(), signal.SIGTERM)
        process.communicate(timeout=60)
    return _chained(rounds) + "\n\n" + "; ".join([f"Runs that ended by themselves: {len(alone)}", *alone]) + "."


def _resume(made: Bench, folder: Path) -> "tuple[subprocess.Popen[str], float, int, float]":
    """The process that goes on, s from typing it to motion-ready, how many were needed, and when it was ready."""
    for tries in range(1, TRIES + 1):
        began = time.monotonic()
        process = made.start("resume", folder)
        entry = comes(folder, LineKind.STEP_FINISHED, "Enable", began, process)
        if entry is not None:
            return process, entry.t - began, tries, entry.t
        print(process.communicate(timeout=60)[0], flush=True)
    sys.exit(f"not resumed in {TRIES} tries")


def _kill(made: Bench, folder: Path, since: float) -> tuple[float | None, None]:
    """SIGKILL the service, which was ready at `since`; what is lost of the window that was open."""
    at = time.monotonic()
    os.kill(made.service(), signal.SIGKILL)
    pause(0.1)
    begun = newest(folder, LineKind.STEP_STARTED, "Record", since)
    ended = newest(folder, LineKind.STEP_FINISHED, "Record", since)
    if begun is None or (ended is not None and ended.number > begun.number):
        return None, None
    rate = made.markers
    rows = [path.read_bytes().count(b"\n") - 1 for path in (folder / "windows").glob("*.csv.part")]
    return at - begun.t - max([0, *rows]) / rate, None


def _trip(made: Bench, folder: Path, process: "subprocess.Popen[str]", node: int) -> tuple[None, float | None]:
    """Another program switches a drive off; the time from its first frame that says so to the last quick stop."""
    devices = made.processes[0]
    if devices.stdin is not None:
        devices.stdin.write(f"off {node}\n")
        devices.stdin.flush()
    process.communicate(timeout=120)
    log = max((folder / "raw").glob("can*.log"), key=lambda path: path.stat().st_mtime)
    violation, enabled = None, False
    stops: dict[int, float] = {}
    for frame in read_candump(log):
        if frame.id == 0x180 + node and violation is None:
            state = frame.data[0] & 0x6F
            enabled |= state == ENABLED
            violation = frame.t if enabled and state == READY else None
        elif violation is not None and frame.id - 0x200 in NODES and frame.data[0] == QUICK_STOP:
            stops.setdefault(frame.id - 0x200, frame.t)
    return None, max(stops.values()) - violation if violation is not None and len(stops) == len(NODES) else None


def _whole(made: Bench, folder: Path) -> bool:
    """Accepted windows by the journal are in the campaign, with all their rows."""
    accepted = {e.window for e in read_journal(folder / "journal.jsonl") if (e.kind, e.step) == WINDOW_KEPT}
    rows = {window.id: len(window.t) for window in read_campaign(folder).windows} if accepted else {}
    return all(rows.get(window) == round(SECONDS * made.markers) + 1 for window in accepted)


WINDOW_KEPT = (LineKind.STEP_FINISHED, "Accept")


def _chained(rounds: list[Round]) -> str:
    kills = [r for r in rounds if r.killed]
    lost = [r.lost for r in kills if r.lost is not None]
    reactions = [r.reaction for r in rounds if r.reaction is not None]
    missing = sum(not r.killed and r.reaction is None for r in rounds)
    lines = [
        ("kills (SIGKILL of the service), in an open window", f"{len(kills)}, {len(lost)}"),
        ("of the open window in no file, median, worst", _quantiles(lost, (0.5, 1.0), "s")),
        ("rounds in which a finished window was lost", sum(not r.whole for r in rounds)),
        ("`fidim resume` that went on at the first try", f"{sum(r.tries == 1 for r in rounds)} of {len(rounds)}"),
        ("… to motion-ready, median, worst", _quantiles([r.ready for r in rounds], (0.5, 1.0), "s", 1)),
        ("guard trips, seen whole in the CAN log", f"{len(reactions) + missing}, {len(reactions)}"),
        ("violating frame to last quick-stop frame: p50, p99, worst", _quantiles(reactions, (0.5, 0.99, 1.0), "ms")),
    ]
    return table(["", ""], lines)


def _quantiles(values: list[float], which: tuple[float, ...], unit: str, digits: int = 2) -> str:
    if not values:
        return "–"
    factor = 1e3 if unit == "ms" else 1.0
    return ", ".join(f"{factor * value:.{digits}f} {unit}" for value in np.quantile(values, which))


def memory(options: argparse.Namespace) -> str:
    """One session; the service's resident memory after its first minute and at the end."""
    with tempfile.TemporaryDirectory() as place, ExitStack() as stack:
        windows = WINDOWS + round(60.0 * options.minutes / LEAST)
        made = stack.enter_context(bench(Path(place), options.sync, 10.0, windows, options.slow, options.markers))
        folder, since = made.folder / "run", time.monotonic()
        process = made.run("run")
        wait_for(folder, LineKind.STEP_FINISHED, "Accept", since, process)
        if options.ui:
            stack.enter_context(terminal_ui(made, "run"))
        pause(SETTLED)
        service, begin, cpu = made.service(), time.monotonic(), _cpu(made.service())
        sizes = [_resident(service)]
        while time.monotonic() - begin < 60.0 * options.minutes and process.poll() is None:
            pause(2.0)
            with suppress(OSError):
                sizes.append(_resident(service))
        if process.poll() is not None:
            sys.exit(f"ended after {time.monotonic() - begin:.0f} s:\n{process.communicate()[0][-2000:]}")
        seconds, used = time.monotonic() - begin, _cpu(service) - cpu
        os.kill(service, signal.SIGTERM)
        process.communicate(timeout=60)
        windows = len(read_campaign(folder).windows)
        lost = sum("lost" in e.reason for e in read_journal(folder / "journal.jsonl") if e.step == "Record")
    tenth = max(1, len(sizes) // 10)
    first, last = float(np.median(sizes[:tenth])), float(np.median(sizes[-tenth:]))
    return table(
        ["", ""],
        [
            ("session, windows accepted", f"{seconds / 60:.1f} min, {windows}"),
            ("resident memory of the service, first and last tenth", f"{first:.1f}, {last:.1f} MB"),
            ("growth", f"{100 * (last / first - 1):+.1f} %"),
            ("windows with a lost marker frame", lost),
            ("CPU of the service", f"{100 * used / seconds:.0f} % of a core"),
        ],
    )


def _resident(process: int) -> float:
    """MB."""
    (line,) = [x for x in Path(f"/proc/{process}/status").read_text().splitlines() if x.startswith("VmRSS")]
    return int(line.split()[1]) / 1024.0


def _cpu(process: int) -> float:
    """s, user and system."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("chain", "memory"))
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--sync", type=float, default=250.0)
    parser.add_argument("--markers", type=float, default=200.0, help="frames a second")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slow", type=float, default=1.0, help="how much later than on an idle computer guards look")
    parser.add_argument("--no-ui", dest="ui", action="store_false")
    parser.add_argument("--no-trips", dest="trips", action="store_false")
    parser.add_argument("--others-idle", dest="idle", action="store_true", help="whatever else runs is SCHED_IDLE")
    parser.add_argument("--print", dest="printed", action="store_true", help="do not write the page")
    options = parser.parse_args()
    before = spent()
    text = {"chain": chain, "memory": memory}[options.what](options)
    shown = f"--rounds {options.rounds}" if options.what == "chain" else f"--minutes {options.minutes:g}"
    shown += f" --sync {options.sync:g}" + (f" --slow {options.slow:g}" if options.slow != 1.0 else "")
    text += f"\n\nSYNC {options.sync:g} Hz, markers {options.markers:g} Hz, UI {'on' if options.ui else 'off'}."
    text += f" {meanwhile(before, idle=options.idle)}"
    if options.printed:
        print(text)
        return
    title = {
        "chain": f"Killed, tripped, resumed at {options.sync:g} Hz",
        "memory": f"A long session, {options.sync:g} Hz",
    }
    write_section("session", title[options.what], f"python -m benchmarks.session {options.what} {shown}", text)


if __name__ == "__main__":
    main()
