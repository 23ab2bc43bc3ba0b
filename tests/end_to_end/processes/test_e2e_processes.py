"""Real processes: simulated devices in one, the service in another, clients in others; killed, stopped, doubled."""

import contextlib
import json
import os
import pty
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.canbus.candump import read_candump
from fidim_lab.app.formats.manifest import read_manifest, verify
from fidim_lab.data.campaign import read_campaign
from procedures.recording.journal import LineKind, read_journal

RIG = Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml"
ONE_WINDOW = Path(__file__).parents[2] / "one_window.toml"
PLAN = (
    ONE_WINDOW.read_text(encoding="utf-8")
    + """
[[window]]
id = "i02"
lengths = [1.36283, 1.37119, 1.49772, 1.46231]
displacement = [-0.02, 0.03]
position = [1.175, -0.260, -0.352]
"""
)
FAST = ["record.seconds=1.5", "motion.settle_over=0.3", "tension.over=0.2"]
PATIENT = ["guard.sample_age=2", "guard.loop_late=3"]
"""on a busy machine everything is late"""
NODES = {1, 2, 3, 4}
HOST_MISSED = b"\x30\x81"
"""emergency 0x8130"""
NEW_SET_POINT = 0x10
"""bit of the controlword"""

pytestmark = pytest.mark.slow


@dataclass
class Bench:
    folder: Path
    rig: Path
    plan: Path
    environment: dict[str, str]
    processes: "list[subprocess.Popen[str]]" = field(default_factory=list)

    def start(self, *arguments: object) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [str(Path(sys.executable).with_name("fidim")), *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
            cwd=self.folder,
        )
        self.processes.append(process)
        return process

    def run(self, *more: object) -> "subprocess.Popen[str]":
        answers = ["--answer", "displace-and-release=done", "--answer", "steady=done"]
        settings = [part for text in FAST + PATIENT for part in ("--set", text)]
        out = ["--out", self.folder / "run"]
        return self.start("run", self.plan, "--rig", self.rig, "--unattended", *answers, *settings, *out, *more)

    def service(self) -> int:
        """Its process."""
        (lock,) = (self.folder / "runtime").glob("*.lock")
        return int(json.loads(lock.read_text())["pid"])


def until(process: "subprocess.Popen[str]", text: str, within: float = 90.0) -> str:
    """Read a process's output until it says so."""
    timer = threading.Timer(within, process.kill)
    timer.start()
    said: list[str] = []
    try:
        for line in process.stdout or ():
            said.append(line)
            if text in line:
                return line
    finally:
        timer.cancel()
    pytest.fail(f"never said {text!r}:\n{''.join(said)}")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    ports = [free_port() for _ in range(3)]
    text = RIG.read_text(encoding="utf-8")
    for old, new in zip((20100, 20101, 20102), ports, strict=True):
        text = text.replace(str(old), str(new))
    text = text.replace("heartbeat = 0.3 ", "heartbeat = 1.0 ")  # simulators on a busy machine miss three of 0.3 s
    text = text.replace("age = 1.0 ", "age = 2.0 ")
    assert "heartbeat = 1.0" in text
    assert "age = 2.0" in text
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    (tmp_path / "runtime").mkdir(mode=0o700)
    environment = {**os.environ, "FIDIM_RUNTIME_DIR": str(tmp_path / "runtime"), "OPENBLAS_NUM_THREADS": "1"}
    made = Bench(tmp_path, tmp_path / "rig.toml", tmp_path / "plan.toml", environment)
    simulators = made.start("simulators", made.rig, "--plan", made.plan)
    until(simulators, "ready")
    yield made
    for process in reversed(made.processes):
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=30)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.fault(
    "people and programs",
    "the service is killed (SIGKILL)",
    reaction="the drives stop by themselves; `fidim resume` takes them over, the load is held all the while",
    says="1 windows are judged, 1 remain",
    window="recorded again",
)
@pytest.mark.parametrize("wait", [0.0, 4.0], ids=["still running", "stopped by their missing heartbeat"])
def test_a_killed_service_leaves_drives_that_hold_and_its_run_takes_them_over(bench, wait):
    run = bench.run()
    until(run, "accept as windows/i01")
    until(run, "i02  move to")
    os.kill(bench.service(), signal.SIGKILL)
    threading.Event().wait(wait)  # the drives miss their host after 1.5 s
    resumed = bench.start("resume", bench.folder / "run")
    until(resumed, "1 windows are judged, 1 remain")
    until(resumed, "i02  move to")
    early, _ = bench.start("power-off", bench.rig).communicate("y\n", timeout=60)
    assert "Another service has this rig" in early
    said, _ = resumed.communicate(timeout=120)
    assert resumed.returncode == 0, said
    assert [w.id for w in read_campaign(bench.folder / "run").windows] == ["i01", "i02"]
    assert drops(bench.folder / "run") == []
    verified = bench.start("verify", bench.folder / "run")
    assert "intact" in verified.communicate(timeout=60)[0]
    assert verified.returncode == 0


def drops(folder: Path) -> list[int]:
    """Controlwords of a run, by RPDO or SDO, that take the power from a drive."""
    words: list[int] = []
    for log in sorted((folder / "raw").glob("can*.log")):
        for frame in read_candump(log):
            function, data = frame.id & 0x780, frame.data
            if function == 0x200 or (function == 0x600 and data[:4] == b"\x2b\x40\x60\x00"):
                words.append(int.from_bytes(data[:2] if function == 0x200 else data[4:6], "little"))
    assert words, "no controlword was logged"
    return [word for word in words if not word & 0x02]


def test_a_drive_that_holds_but_was_set_otherwise_is_not_let_go(bench):
    run = bench.run()
    until(run, "i01  move to")
    os.kill(bench.service(), signal.SIGKILL)
    run.wait(30)
    text = bench.rig.read_text(encoding="utf-8")
    bench.rig.write_text(text.replace("max_speed = 0.5 ", "max_speed = 0.5\nfollowing_error = 0.015"), encoding="utf-8")
    refused, _ = (early := bench.start("resume", bench.folder / "run")).communicate(timeout=120)
    assert early.returncode == 3
    assert "6065:0 following error window, counts" in refused
    assert f"fidim power-off {bench.rig}" in refused
    bench.start("power-off", bench.rig).communicate("y\n", timeout=60)
    resumed = bench.start("resume", bench.folder / "run")
    said, _ = resumed.communicate(timeout=120)
    assert resumed.returncode == 0, said


def test_an_embedded_rehearsal_passes_and_leaves_a_whole_folder_and_no_process(bench):
    run = bench.run("--embedded")
    said, _ = run.communicate(timeout=240)
    assert run.returncode == 0, said
    folder = bench.folder / "run"
    assert (folder / "rig.toml").read_bytes() == bench.rig.read_bytes()
    assert "summary.json" in read_manifest(folder).files
    assert verify(folder).intact
    assert children_of_a_rehearsal(bench.rig) == []


def test_the_devices_of_a_rehearsal_end_with_a_killed_service(bench):
    run = bench.run("--embedded")
    until(run, "i01  move to")
    assert len(children_of_a_rehearsal(bench.rig)) == 1
    os.kill(bench.service(), signal.SIGKILL)
    assert run.wait(30) == 3
    for _ in range(100):
        if not children_of_a_rehearsal(bench.rig):
            return
        threading.Event().wait(0.2)
    pytest.fail("the simulated devices live on")


def children_of_a_rehearsal(rig: Path) -> list[str]:
    """Command lines of the processes that serve this rig's devices to a rehearsal."""
    found: list[str] = []
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            command = line.read_bytes().decode(errors="replace")
            if str(rig) in command and "--until-input-ends" in command:
                found.append(command)
    return found


@pytest.mark.fault(
    "people and programs",
    "the service is stopped for 2 s (SIGSTOP)",
    reaction="the drives stop by themselves",
    says="guard stopped the run",
    window="kept",
)
def test_a_stopped_service_does_not_keep_the_drives_from_stopping(bench):
    run = bench.run()
    until(run, "i01  move to")
    os.kill(bench.service(), signal.SIGSTOP)
    threading.Event().wait(2.0)
    os.kill(bench.service(), signal.SIGCONT)
    said, _ = run.communicate(timeout=60)
    assert run.returncode == 3, said
    assert "guard stopped the run" in said
    stopped_by_themselves(bench.folder / "run")
    journal = read_journal(bench.folder / "run" / "journal.jsonl")
    assert [e.kind for e in journal][-2:] == [LineKind.HELD, LineKind.RUN_FINISHED]
    assert json.loads((bench.folder / "run" / "summary.json").read_text())["exit_code"] == 3


def stopped_by_themselves(folder: Path) -> None:
    """Each drive has missed its host and said so; nobody told one to move afterwards."""
    frames = [frame for log in sorted((folder / "raw").glob("can*.log")) for frame in read_candump(log)]
    missed = {f.id - 0x80: f.t for f in frames if f.id - 0x80 in NODES and f.data[:2] == HOST_MISSED}
    assert set(missed) == NODES
    since = min(missed.values())
    assert [f for f in frames if f.t > since and f.id - 0x200 in NODES and f.data[0] & NEW_SET_POINT] == []


@pytest.mark.fault(
    "people and programs",
    "the terminal that started the run is killed",
    reaction="none",
    says="pass",
    window="accepted",
)
def test_the_terminal_that_started_a_run_may_be_killed(bench):
    run = bench.run("--on-finish", f"touch {bench.folder}/finished")
    until(run, "i01  move to")
    service = bench.service()
    run.kill()
    for _ in range(600):
        threading.Event().wait(0.2)
        if (bench.folder / "finished").exists():
            break
    assert json.loads((bench.folder / "run" / "summary.json").read_text())["outcome"] in ("pass", "marginal")
    assert (bench.folder / "finished").exists()
    assert service > 0


@pytest.mark.fault(
    "people and programs",
    "a second service is started on the same rig",
    reaction="refused, the first goes on",
    says="Another service has this rig",
    window="goes on",
)
def test_a_second_service_on_one_rig_is_refused_and_stop_stops_the_first(bench):
    run = bench.run()
    until(run, "i01  move to")
    second = bench.run("--out", bench.folder / "second")
    said, _ = second.communicate(timeout=60)
    assert second.returncode == 2
    assert "Another service has this rig" in said
    assert f"process {bench.service()}" in said
    stop = bench.start("stop", "--reason", "enough")
    assert "quick-stopped" in stop.communicate(timeout=30)[0]
    assert run.wait(30) == 3
    assert "enough" in json.loads((bench.folder / "run" / "summary.json").read_text())["reason"]


def test_a_polite_kill_of_the_service_ends_held(bench):
    run = bench.run()
    until(run, "i01  move to")
    os.kill(bench.service(), signal.SIGTERM)
    run.communicate(timeout=60)
    summary = json.loads((bench.folder / "run" / "summary.json").read_text())
    assert (summary["interrupted"], summary["held"]) == (True, True)


@pytest.mark.fault(
    "people and programs",
    "Ctrl-C at the terminal that started the run, or a polite kill of it (SIGTERM)",
    reaction="hold",
    says="aborted",
    window="none was open",
)
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "SIGTERM"])
def test_who_started_the_run_may_end_it(bench, sent):
    run = bench.run()
    until(run, "i01  move to")
    run.send_signal(sent)
    said, _ = run.communicate(timeout=60)
    assert run.returncode == 130, said
    summary = json.loads((bench.folder / "run" / "summary.json").read_text())
    assert (summary["outcome"], summary["held"]) == ("aborted", True)


@pytest.mark.fault(
    "people and programs",
    "UIs and the run's own terminal are stopped for 2 s, then the UIs are killed (SIGTERM, SIGKILL)",
    reaction="none",
    says="pass",
    window="accepted",
)
def test_clients_that_stop_or_die_change_nothing(bench):
    run = bench.run()
    until(run, "i01  move to")
    with ui(bench) as polite, ui(bench) as killed:
        until(run, "i01  record", within=120.0)
        for process in (run, polite, killed):
            os.kill(process.pid, signal.SIGSTOP)
        threading.Event().wait(2.0)
        os.kill(run.pid, signal.SIGCONT)
        os.kill(polite.pid, signal.SIGCONT)
        polite.terminate()
        assert polite.wait(30) is not None
    said, _ = run.communicate(timeout=180)
    assert run.returncode == 0, said
    summary = json.loads((bench.folder / "run" / "summary.json").read_text())
    assert summary["outcome"] in ("pass", "marginal")
    assert [row["attempts"] for row in summary["windows"]] == [1, 1]


@contextlib.contextmanager
def ui(bench: Bench) -> "Iterator[subprocess.Popen[bytes]]":
    """One that draws, in a terminal of its own; killed in the end."""
    reader, terminal = pty.openpty()
    process = subprocess.Popen(
        [str(Path(sys.executable).with_name("fidim")), "ui", str(bench.folder / "run")],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        env={**bench.environment, "TERM": "xterm-256color"},
        cwd=bench.folder,
    )
    os.close(terminal)
    drained = threading.Thread(target=drain, args=(reader,), daemon=True)
    try:
        assert os.read(reader, 1), "it draws"
        drained.start()
        yield process
    finally:
        process.kill()
        process.wait(30)
        drained.join(10)
        os.close(reader)


def drain(reader: int) -> None:
    """Take what is drawn, so that a full terminal stops nobody."""
    with contextlib.suppress(OSError):
        while os.read(reader, 1 << 16):
            pass
