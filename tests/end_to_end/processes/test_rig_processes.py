"""From a rig file to a running rig: simulators in a process of their own, a real bus and sockets, real time.

Doctor, run, plugs pulled in the middle, and what a person does afterwards. Nothing here reaches behind the ports.
"""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from drivers.ports import Trial
from fidim_lab.app import cli, compose
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.rigs.proof_file import proofs_path, read_proofs
from fidim_lab.data.rigs.rig_file import read_rig
from procedures.events import RunFinished, StepStarted
from procedures.protocols import catalogue
from procedures.recording.journal import read_journal
from procedures.run import run_procedure
from procedures.settings import HandSettings, MotionSettings, RecordSettings, Settings, TensionSettings

pytestmark = pytest.mark.slow
MAIN = "from fidim_lab.app.cli import main; main()"
EXAMPLE = Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml"
SETTINGS = Settings(
    motion=MotionSettings(settle_over=0.5),
    tension=TensionSettings(over=0.3),
    hand=HandSettings(over=0.3),
    record=RecordSettings(seconds=2.0, longest_gap=1.0, complete=0.8),
)
"""short windows; a busy machine may lose some samples"""


def _window(id_, lengths, position):
    return PlannedWindow(id_, Role.IDENTIFY, np.array(lengths), np.array([-0.02, 0.03]), np.array(position))


PLAN = Plan(
    "two windows",
    (
        _window("i01", (1.30283, 1.39119, 1.52772, 1.41231), (1.111, -0.271, -0.315)),
        _window("i02", (1.36283, 1.37119, 1.49772, 1.46231), (1.175, -0.260, -0.352)),
    ),
)


def _free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


class Simulators:
    """`fidim simulators` as a child, on ports of its own."""

    def __init__(self, folder, change=lambda text: text):
        self.path = folder / "rig.toml"
        ports = {20100: _free_port(), 20101: _free_port(socket.SOCK_DGRAM), 20102: _free_port()}
        text = EXAMPLE.read_text()
        for ours, free in ports.items():
            assert str(ours) in text
            text = text.replace(str(ours), str(free))
        self.path.write_text(change(text))
        plan = folder / "plan.toml"
        write_plan(plan, PLAN)
        self.child = subprocess.Popen(
            [sys.executable, "-c", MAIN, "simulators", str(self.path), "--plan", str(plan)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            bufsize=1,
            start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        self.said = []
        for line in self.child.stdout:
            self.said.append(line)
            if line.startswith("ready"):
                return
        pytest.fail(f"the simulators did not start: {self.said}")

    def pull(self, plug):
        if plug == "kill":
            self.child.kill()
        else:
            self.child.stdin.write(plug + "\n")

    def end(self):
        self.child.send_signal(signal.SIGINT)
        try:
            rest, _ = self.child.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self.child.kill()
            raise
        return self.child.returncode, rest


@pytest.fixture
def simulators(tmp_path):
    made = []

    def make(change=lambda text: text):
        made.append(Simulators(tmp_path, change))
        return made[-1]

    yield make
    for one in made:
        if one.child.poll() is None:
            one.child.kill()
        with contextlib.suppress(ValueError):
            one.child.communicate(timeout=10)


def run(path, folder, at=None, pull=lambda: None):
    """A run of the plan; `pull` is called when a step of the type named `at` begins. Returns the report."""
    file = read_rig(path)
    experiment = catalogue.experiment("identify", PLAN, file.robot, compose.rig_settings(file, SETTINGS))
    pending, ended = [pull], []

    def listen(event):
        if isinstance(event, StepStarted) and type(event.step).__name__ == at and pending:
            pending.pop()()
        elif isinstance(event, RunFinished):
            ended.append(event.report)

    async def main():
        async with compose.real_rig(file) as real:
            return await run_procedure(experiment, real.rig, folder, wall_time=lambda: "now", listeners=(listen,))

    report = compose.run_loop(main(), real_time=True)
    assert ended == [report]
    return report


def wait(seconds):
    threading.Event().wait(seconds)


def doctor(path):
    return cli.run(["doctor", "--rig", str(path)])


def test_doctor_is_green_the_run_passes_and_the_power_can_be_taken_afterwards(simulators, tmp_path, capsys):
    world = simulators()
    assert doctor(world.path) == 0, capsys.readouterr().out

    report = run(world.path, tmp_path / "run")
    assert report.exit_code == 0, report.reason
    assert [row.id for row in report.accepted] == ["i01", "i02"]
    assert report.held

    wait(2.0)  # the drives miss their host
    assert doctor(world.path) == 1
    shown = capsys.readouterr().out
    assert "quick stop active" in shown
    assert "fidim power-off" in shown
    assert cli.run(["power-off", str(world.path), "--yes", "--acknowledge", "tester"]) == 0
    assert "→ switch on disabled" in capsys.readouterr().out
    assert doctor(world.path) == 0, capsys.readouterr().out

    code, rest = world.end()
    assert code == 0
    assert "simulators ended" in rest
    assert "Traceback" not in rest


PLUGS = {
    "drive without power": ("drive 2", "Record", "winch 2", True),
    "drive in fault": ("fault 3", "Settle", "winch 3", True),
    "motion capture ends": ("mocap", "MoveTo", "no frame has come from motion capture", True),
    "adapter unplugged": ("bus", "MoveTo", "slcan", False),
    "everything gone": ("kill", "Settle", "slcan", False),
}


@pytest.mark.parametrize("case", PLUGS)
def test_a_pulled_plug_ends_the_run_held_with_its_cause_named(simulators, tmp_path, case):
    plug, step, cause, held = PLUGS[case]
    world = simulators()
    report = run(world.path, tmp_path / "run", step, lambda: world.pull(plug))
    assert report.exit_code == 3
    assert cause in report.reason, report.reason
    if held:
        assert report.held or cause in report.held_says, report.held_says
    else:  # nothing can be asked any more, and that is said
        assert not report.held
    last = [entry.kind.value for entry in read_journal(tmp_path / "run" / "journal.jsonl")][-2:]
    assert last == ["held", "run-finished"], last


def test_the_plug_of_an_adapter_on_a_serial_port_is_pulled_while_the_robot_moves(simulators, tmp_path, capsys):
    adapter = tmp_path / "usb" / "can"

    def on_a_port(text):
        return re.sub(r'channel = "socket://.*?"', f'channel = "{adapter}"', text)

    world = simulators(on_a_port)
    assert doctor(world.path) == 0, capsys.readouterr().out
    report = run(world.path, tmp_path / "run", "MoveTo", lambda: world.pull("bus"))
    assert report.exit_code == 3
    assert f"slcan {adapter}" in report.reason, report.reason
    assert not report.held  # nothing can be asked any more, and that is said
    assert cli.run(["doctor", "--rig", str(world.path), "--json", str(tmp_path / "doctor.json")]) == 3
    assert f"slcan {adapter} cannot be opened" in (tmp_path / "doctor.json").read_text()


def test_doctor_names_what_cannot_be_reached(simulators, tmp_path, capsys):
    world = simulators()
    world.pull("drive 4")
    world.pull("mocap")
    wait(1.0)
    assert doctor(world.path) == 3
    shown = capsys.readouterr().out
    assert "winch 4: drive" in shown
    assert "motion capture: stream" in shown
    assert "2 of" in shown
    world.pull("drive 4 again")
    world.pull("mocap again")
    wait(0.5)
    assert doctor(world.path) == 0, capsys.readouterr().out
    world.pull("bus")
    wait(0.5)
    world.pull("bus again")
    wait(0.5)
    assert doctor(world.path) == 0, capsys.readouterr().out
    code, _ = world.end()
    assert code == 0


def test_doctor_finds_a_drive_that_is_another(simulators, tmp_path, capsys):
    world = simulators()
    other = tmp_path / "other.toml"
    other.write_text(world.path.read_text().replace('name = "winch 2"', 'name = "winch 2"\nrated_current = 4.0'))
    assert doctor(other) == 1
    shown = capsys.readouterr().out
    assert "winch 2: 6075:0 rated current" in shown
    assert "4000" in shown


def test_the_same_over_udp_multicast_and_lines_of_text_with_y_up(simulators, tmp_path, capsys):
    pytest.importorskip("msgpack")
    group = f"239.74.163.{os.getpid() % 250 + 2}"

    def change(text):
        port = _free_port(socket.SOCK_DGRAM)
        lines = [line for line in text.splitlines() if not line.startswith(("channel", "options"))]
        text = "\n".join(lines).replace('interface = "slcan"', f'interface = "udp_multicast"\nchannel = "{group}"')
        text = text.replace("sync_rate", f"options = {{ port = {port} }}\nsync_rate", 1)
        return text.replace('kind = "vicon-udp"', 'kind = "marker-text"\ntransport = "tcp"\nup = "y"')

    try:
        world = simulators(change)
    except OSError as error:
        pytest.skip(f"no multicast here: {error}")
    assert doctor(world.path) == 0, capsys.readouterr().out
    assert world.end()[0] == 0


@pytest.mark.slow
def test_stops_are_proven_as_typed_and_the_report_shows_them(tmp_path):
    """`fidim commission --embedded`: real sockets, a service, a person who types; then its page."""
    example = tmp_path / EXAMPLE.name
    example.write_text(EXAMPLE.read_text())
    command = ["commission", str(example), "--by", "A. Tester", "--embedded", "--out", str(tmp_path / "run")]
    child = subprocess.Popen(
        [sys.executable, "-c", MAIN, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    said = ""
    try:
        answered = 0
        while chunk := os.read(child.stdout.fileno(), 4096):
            said += chunk.decode()
            asked = said.rfind("abort] ")  # what is typed before the question does not answer it
            if asked > answered:
                question = said[said.rfind("ask: ", 0, asked) : asked]
                answered = asked
                # the first winch is tried; the others are left out, for the test's time
                child.stdin.write("skip\n" if "Next is" in question and "winch-1" not in question else "done\n")
                child.stdin.flush()
        assert child.wait(30) == 1, said
    finally:
        child.kill()
        child.wait()
        child.stdin.close()
        child.stdout.close()
    assert "1 of 4 winches stop by themselves" in said
    assert not proofs_path(example).exists()  # a rehearsal proves nothing of the real drives
    proofs = read_proofs(tmp_path / "run" / "proofs.toml")
    assert {(proof.winch, proof.trial) for proof in proofs} == {
        ("winch 1", trial) for trial in Trial if trial is not Trial.LOST_SYNC
    }
    assert cli.run(["report", str(tmp_path / "run")]) == 0
    page = (tmp_path / "run" / "report.html").read_text()
    assert "Stops proven by trial" in page
    assert "heartbeat withheld" in page
