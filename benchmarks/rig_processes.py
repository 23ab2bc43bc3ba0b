"""Real processes for benchmarks of a session: simulated devices in one, services in others, on local sockets."""

import json
import os
import pty
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from procedures.recording.journal import Entry, LineKind, read_journal

ROOT = Path(__file__).parents[1]
RIG = ROOT / "examples" / "rigs" / "simulated.toml"
FIDIM = str(Path(sys.executable).with_name("fidim"))
PLACES = (
    ([1.30283, 1.39119, 1.52772, 1.41231], [1.111, -0.271, -0.315]),
    ([1.36283, 1.37119, 1.49772, 1.46231], [1.175, -0.260, -0.352]),
)
WINDOW = """
[[window]]
id = "w{number:03d}"
lengths = {lengths}
displacement = [-0.02, 0.03]
position = {position}
"""
READY_WITHIN = 120.0
"""s"""


@dataclass
class Bench:
    """A folder with a rig and a plan, and the processes that were started in it."""

    folder: Path
    sync: float
    seconds: float
    """of a window"""
    slow: float = 1.0
    """how much later than on an idle computer everything may be"""
    markers: float = 200.0
    """frames a second"""
    processes: "list[subprocess.Popen[str]]" = field(default_factory=list)
    further: dict[str, str] = field(default_factory=dict[str, str])
    """of the environment, for what is started from now on"""

    @property
    def environment(self) -> dict[str, str]:
        """As of an installed program: with its bytecode, which some build machines are told not to write."""
        inherited = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        return {
            **inherited,
            "FIDIM_RUNTIME_DIR": str(self.folder / "runtime"),
            "OPENBLAS_NUM_THREADS": "1",
            **self.further,
        }

    def make(self, windows: int) -> None:
        """Rig and plan."""
        text = RIG.read_text(encoding="utf-8")
        for old in (20100, 20101, 20102):
            text = text.replace(str(old), str(free_port()))
        text = text.replace("\nrate = 100.0", f"\nrate = {self.markers}")
        text = text.replace("sync_rate = 100.0", f"sync_rate = {self.sync}")
        if self.slow > 1.0:  # simulators on a busy computer miss what hardware would not
            text = text.replace("age = 1.0 ", f"age = {0.2 * self.slow} ").replace("= 0.3 ", f"= {0.1 * self.slow} ")
            text = text.replace("host_timeout = 1.5 ", f"host_timeout = {0.25 * self.slow} ")
        (self.folder / "rig.toml").write_text(text, encoding="utf-8")
        plan = 'format = "fidim-plan/1"\nname = "long"\n'
        for number in range(1, windows + 1):
            lengths, position = PLACES[number % 2]
            plan += WINDOW.format(number=number, lengths=lengths, position=position)
        (self.folder / "plan.toml").write_text(plan, encoding="utf-8")
        (self.folder / "runtime").mkdir(mode=0o700, exist_ok=True)

    def start(self, *arguments: object) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [FIDIM, *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
            cwd=self.folder,
        )
        self.processes.append(process)
        return process

    def run(self, name: str, *options: str) -> "subprocess.Popen[str]":
        """A run that nobody attends, with short waits between windows."""
        settings = {
            "record.seconds": self.seconds,
            "motion.settle_over": 0.3,
            "tension.over": 0.2,
            "hand.over": 0.3,
            "guard.sample_age": 0.2 * self.slow,
            "guard.loop_late": 0.25 * self.slow,
        }
        told = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
        answers = ["--answer", "displace-and-release=done", "--answer", "steady=done"]
        rig, out = self.folder / "rig.toml", self.folder / name
        return self.start(
            "run", self.folder / "plan.toml", "--rig", rig, "--unattended", *answers, *told, *options, "--out", out
        )

    def service(self) -> int:
        """The process that has the rig; 0 where none has."""
        return self._holder("pid")

    def port(self) -> int:
        """Of the service on TCP; 0 where there is none."""
        return self._holder("port")

    def _holder(self, key: str) -> int:
        for lock in (self.folder / "runtime").glob("*.lock"):
            with suppress(ValueError, KeyError, OSError):
                return int(json.loads(lock.read_text())[key])
        return 0

    def end(self) -> None:
        for process in reversed(self.processes):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=30)
            process.kill()


@contextmanager
def bench(
    folder: Path, sync: float, seconds: float, windows: int, slow: float = 1.0, markers: float = 200.0
) -> Generator[Bench]:
    """Devices that serve, until the context ends."""
    made = Bench(folder, sync, seconds, slow, markers)
    made.make(windows)
    try:
        devices = made.start("simulators", folder / "rig.toml", "--plan", folder / "plan.toml")
        until(devices, "ready")
        yield made
    finally:
        made.end()


@contextmanager
def terminal_ui(made: Bench, run: str) -> Generator[None]:
    """`fidim ui` in a terminal of its own, whose pictures somebody takes."""
    reader, terminal = pty.openpty()
    environment = {**made.environment, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    command = [FIDIM, "ui", str(made.folder / run)]
    ui = subprocess.Popen(command, stdin=terminal, stdout=terminal, stderr=terminal, env=environment, cwd=made.folder)
    os.close(terminal)

    def drain() -> None:
        with suppress(OSError):
            while os.read(reader, 1 << 16):
                pass

    threading.Thread(target=drain, daemon=True).start()
    try:
        yield
    finally:
        ui.kill()
        ui.wait(30)
        os.close(reader)


def until(process: "subprocess.Popen[str]", text: str) -> None:
    """Read what a process says until it says so; raises SystemExit where it never does."""
    said: list[str] = []
    for line in process.stdout or ():
        said.append(line)
        if text in line:
            return
    sys.exit(f"never said {text!r}:\n{''.join(said)}")


def newest(folder: Path, kind: LineKind, step: str, since: float) -> Entry | None:
    """The newest journal line of a step, said since a monotonic time."""
    if not (folder / "journal.jsonl").exists():
        return None
    found = [e for e in read_journal(folder / "journal.jsonl") if e.kind is kind and e.step == step and e.t >= since]
    return found[-1] if found else None


def wait_for(folder: Path, kind: LineKind, step: str, since: float, process: "subprocess.Popen[str]") -> Entry:
    """Wait for such a line; raises SystemExit where the process ends without one."""
    entry = comes(folder, kind, step, since, process)
    if entry is None:
        process.kill()
        sys.exit(f"{folder}: no {step} {kind.value}:\n{process.communicate()[0]}")
    return entry


def comes(folder: Path, kind: LineKind, step: str, since: float, process: "subprocess.Popen[str]") -> Entry | None:
    """Wait for such a line; None where the process ends without one."""
    deadline = time.monotonic() + READY_WITHIN
    while (entry := newest(folder, kind, step, since)) is None:
        if time.monotonic() > deadline or process.poll() is not None:
            return None
        pause(0.02)
    return entry


def pause(seconds: float) -> None:
    """Real seconds: other processes are looked at."""
    threading.Event().wait(seconds)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
