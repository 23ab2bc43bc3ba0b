"""The longest silence between two SYNCs of a whole session while something tries to keep the control loop busy.

A session in real processes (simulators, service), an unattended run; each strain lasts the whole run. SYNCs are those
of raw/can.log, stamped by the service as it sends them; from the first step on.
"""

import json
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.page import ROOT, table
from benchmarks.rig_processes import Bench, bench, wait_for
from drivers.canbus.candump import read_candump
from procedures.recording.journal import LineKind, read_journal

LATE = 0.020
"""s between two SYNCs of 100 Hz: one was left out"""
WINDOWS, SECONDS = 3, 4.0
"""of a run, and s of each window"""
SYNC = 100.0
"""Hz"""
PATIENT = 5.0
"""times as long as hardware is waited for: simulators share the computer"""
FSYNC = 0.4
"""s that a slow disk takes for each fsync"""
CLIENTS = 25
PAIR = (
    b'{"type":"command","id":1,"command":{"name":"take-lease","force":true}}\n'
    b'{"type":"command","id":2,"command":{"name":"release-lease"}}\n'
)
FLOOD = PAIR * 3000
"""396 kB of commands"""
MEASURED = """import os, sys
sys.path.append({root!r})
if "fidim_lab.app.service.main" in sys.orig_argv:
    from benchmarks.bus.turns import install
    install({folder!r})
"""
SLOW = f"""
import time
_fsync = os.fsync
def fsync(descriptor):
    time.sleep({FSYNC})
    return _fsync(descriptor)
os.fsync = fsync
"""

Strain = Callable[[Bench, threading.Event], None]
"""goes on until the event is set"""


@dataclass(frozen=True)
class Gaps:
    """One line of the table."""

    strain: str
    gaps: np.ndarray
    """(N,) s between SYNCs"""
    turn: float
    """s of CPU time that the longest callback of the control loop took"""
    said: str
    """how the run ended"""

    def row(self) -> list[str]:
        p50, p999, worst = 1e3 * np.quantile(self.gaps, (0.5, 0.999, 1.0))
        late, turn = int((self.gaps > LATE).sum()), f"{1e3 * self.turn:.1f}"
        return [
            self.strain,
            f"{len(self.gaps):,}",
            f"{p50:.1f}, {p999:.1f}",
            f"{worst:.1f}",
            str(late),
            turn,
            self.said,
        ]


HEAD = [
    *("strain", "SYNCs", "gap: p50, p99.9, ms", "longest gap, ms", f"gaps over {1e3 * LATE:g} ms"),
    *("longest callback, ms of CPU", "run"),
]


def gaps(strains: list[str]) -> str:
    """The table of all."""
    rows: list[list[str]] = []
    for name in strains:
        found = measure(name)
        rows.append(found.row())
        print(" | ".join(rows[-1]), flush=True)
    return table(HEAD, rows)


def measure(name: str, *, verbose: bool = False) -> Gaps:
    """One run under one strain."""
    says, strain = STRAINS[name]
    with tempfile.TemporaryDirectory() as folder, bench(Path(folder), SYNC, SECONDS, WINDOWS, PATIENT, 100.0) as made:
        measured = made.folder / "measured"
        measured.mkdir()
        custom = MEASURED.format(root=str(ROOT), folder=str(measured)) + (SLOW if name == "fsync" else "")
        (measured / "sitecustomize.py").write_text(custom, encoding="utf-8")
        made.further["PYTHONPATH"] = str(measured)
        run = made.run("out", "--tcp", "0")
        out = made.folder / "out"
        begun = wait_for(out, LineKind.STEP_STARTED, "Enable", 0.0, run).t
        ended = threading.Event()
        worker = threading.Thread(target=strain, args=(made, ended), daemon=True)
        worker.start()
        told = run.communicate(timeout=600)[0]
        ended.set()
        worker.join(30)
        last = read_journal(out / "journal.jsonl")[-1]
        syncs = np.array([f.t for f in read_candump(out / "raw" / "can.log") if f.id == 0x080 and f.t >= begun])
        turns = [json.loads(path.read_text(encoding="utf-8")) for path in measured.glob("*.json")]
    long = sorted((turn for made in turns for turn in made if turn[0] >= begun), key=lambda turn: -turn[1])
    if verbose:
        for t, cpu, wall, what in long[:20]:
            print(f"{t - begun:8.3f} s: {1e3 * cpu:.1f} ms of CPU, {1e3 * wall:.1f} ms: {what}")
    worst = long[0][1] if long else 0.0
    return Gaps(says, np.diff(syncs), worst, f"{last.outcome.value or told[-200:]} {last.reason}".strip())


def _nothing(_made: Bench, _ended: threading.Event) -> None:
    pass


def _attach(made: Bench, ended: threading.Event) -> None:
    """A long history, then clients that come at once, read all, and go; again and again."""
    with _connected(made, b"writer") as writer:
        for _ in range(12):
            _send(writer, PAIR * 100)
            ended.wait(0.2)
    while not ended.is_set():
        clients = [_client(made, b"late%d" % number) for number in range(CLIENTS)]
        until = time.monotonic() + 2.0
        while time.monotonic() < until and not ended.is_set():
            for client in clients:
                _drain(client)
            ended.wait(0.01)
        for client in clients:
            client.close()
        ended.wait(0.5)


def _unread(made: Bench, ended: threading.Event) -> None:
    """Clients that listen to everything and never read."""
    while not ended.is_set():
        clients = [_client(made, b"dead%d" % number, buffer=2048) for number in range(CLIENTS)]
        ended.wait(4.0)
        for client in clients:
            client.close()


def _flood(made: Bench, ended: threading.Event) -> None:
    """Commands as fast as they are taken, while others read what comes of them."""
    readers = [_client(made, b"reader%d" % number) for number in range(5)]
    while not ended.is_set():
        flooder, rest = _client(made, b"flooder"), memoryview(FLOOD)
        until = time.monotonic() + 3.0
        while time.monotonic() < until and not ended.is_set():
            try:
                rest = rest[flooder.send(rest[: 1 << 16]) :] if rest else rest
            except BlockingIOError:
                ended.wait(0.001)
            except OSError:
                break  # cut off
            _drain(flooder)
            for reader in readers:
                _drain(reader)
        flooder.close()


def _lockout(made: Bench, ended: threading.Event) -> None:
    """Forty connections on TCP that say nothing, each made anew when it is dropped."""
    while not ended.is_set():
        silent: list[socket.socket] = []
        with suppress(OSError, ValueError, KeyError):
            while len(silent) < 40:
                silent.append(socket.create_connection(("127.0.0.1", made.port()), 1.0))
        ended.wait(0.2)
        for one in silent:
            one.close()


STRAINS: dict[str, tuple[str, Strain]] = {
    "nothing": ("nothing", _nothing),
    "fsync": (f"each fsync takes {FSYNC:g} s", _nothing),
    "attach": (f"{CLIENTS} clients attach at once, again and again", _attach),
    "unread": (f"{CLIENTS} clients that never read", _unread),
    "flood": (f"{len(FLOOD) // 1000} kB of commands, again and again", _flood),
    "lockout": ("40 connections on TCP, again and again", _lockout),
}


@contextmanager
def _connected(made: Bench, name: bytes) -> Generator[socket.socket]:
    client = _client(made, name)
    try:
        yield client
    finally:
        client.close()


def _client(made: Bench, name: bytes, buffer: int = 0) -> socket.socket:
    """Says hello, and nothing more."""
    client = socket.socket(socket.AF_UNIX)
    if buffer:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    with suppress(OSError, StopIteration):  # the service has ended
        client.settimeout(3.0)
        client.connect(str(next((made.folder / "runtime").glob("*.sock"))))
        client.sendall(b'{"type":"hello","client":"%s","samples":true}\n' % name)
    client.setblocking(False)
    return client


def _send(client: socket.socket, data: bytes) -> None:
    with suppress(OSError):
        client.send(data)
        _drain(client)


def _drain(client: socket.socket) -> None:
    with suppress(OSError):
        while client.recv(1 << 16):
            pass
