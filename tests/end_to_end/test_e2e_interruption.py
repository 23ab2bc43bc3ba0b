"""Ctrl-C, polite and impolite kills at any step: the robot is held, and what was recorded is there."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading

import pytest

from drivers.canbus.candump import read_candump
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import HardwareError
from procedures.outcomes import Outcome
from procedures.recording.journal import LineKind, read_journal
from sim_backends.drive.axis.machine import State

STEPS = ("Enable", "MoveTo", "Settle", "Hold", "ReadEncoders", "CheckTension", "Ask", "AwaitHandsOff", "Record")
SECONDS_LEFT = 120.0


def press(times, number=signal.SIGINT, apart=0.02):
    """Signals to this process, 20 ms apart or all at once: the first ends the run, the others meet its end."""

    async def pressing(stage):
        for _ in range(times):
            signal.raise_signal(number)
            if apart:
                await stage.rig.rig.clock.sleep(apart)

    return lambda stage: stage.tasks.append(asyncio.ensure_future(pressing(stage)))


def check_interrupted(ended):
    report = ended.check()
    assert isinstance(ended.error, KeyboardInterrupt)
    assert report.outcome is Outcome.ABORTED
    assert report.exit_code == 130
    assert report.reason.startswith("Interrupted at “")
    return report


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.sampled(1)
def test_ctrl_c_at_any_step(rehearsal, step):
    rehearsal.at(step, press(1), after=0.08)
    ended = rehearsal.run()
    check_interrupted(ended)
    powered = {drive.state for drive in ended.drives}
    assert powered == ({State.SWITCH_ON_DISABLED} if step == "Enable" else {State.OPERATION_ENABLED})
    assert (ended.folder / "rejected" / "i01-attempt1.csv").exists() == (step == "Record")
    if step == "MoveTo":  # the single frames that brought the winches to rest: halt, with power
        words = ended.controlwords(since=ended.planted[0])
        assert {node for _, node, word in words if word & 0x10F == 0x10F} == {1, 2, 3, 4}


def test_ctrl_c_as_a_window_is_accepted(rehearsal):
    rehearsal.at("Accept", press(1))
    ended = rehearsal.run()
    check_interrupted(ended)
    assert [row.id for row in ended.report.accepted] == ["i01"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("step", ["MoveTo", "Record"])
@pytest.mark.parametrize(("times", "apart"), [(3, 0.0), (30, 0.02)])
@pytest.mark.sampled(1)
def test_impatience_does_not_keep_the_robot_from_being_held(rehearsal, step, number, times, apart):
    before = signal.getsignal(number)
    rehearsal.at(step, press(times, number, apart), after=0.3)
    ended = rehearsal.run()
    check_interrupted(ended)
    assert ended.report.held_says == "All winches stand still, held."
    assert signal.getsignal(number) == before


# the command, as a process of its own -------------------------------------------------------------------------------


class Command:
    """`fidim dry-run` with four windows, watched by its journal; it may be two windows on before it is interrupted."""

    def __init__(self, folder, *more):
        self.folder = folder
        self.journal = folder / "journal.jsonl"
        self.begun = folder.with_name(f"{folder.name}-begun")
        """there once the command takes interrupts: before, Python itself ends with a traceback"""
        self._read = 0
        """bytes of the journal that were looked at"""
        script = f"from fidim_lab.app.cli import main; open({str(self.begun)!r}, 'w').close(); main()"
        command = ["dry-run", "--equilibria", "4", "--validate", "0", "--out", str(folder), *more]
        self.process = subprocess.Popen(
            [sys.executable, "-c", script, *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def _written(self):
        """Lines of the journal that were not told before."""
        if self.journal.exists():
            with self.journal.open("rb") as file:
                file.seek(self._read)
                lines = file.read().splitlines(keepends=True)
            whole = [line for line in lines if line.endswith(b"\n")]
            self._read += sum(map(len, whole))
            yield from whole

    def wait_for(self, step, window, *, may_end=False):
        """Until the journal has this step's begin; False where the command has ended before, which it may."""
        pause = threading.Event()
        for _ in range(round(SECONDS_LEFT / 0.005)):
            for line in self._written():
                entry = json.loads(line)
                if entry["kind"] == "step-started" and (entry["step"], entry.get("window")) == (step, window):
                    return True
            if self.process.poll() is not None:
                assert may_end, self.process.stderr.read()
                return False
            pause.wait(0.005)
        raise TimeoutError(step)

    def end(self):
        """(exit code, standard output, standard error)."""
        out, err = self.process.communicate(timeout=SECONDS_LEFT)
        return self.process.returncode, out, err


@pytest.fixture
def command(tmp_path):
    command = Command(tmp_path / "run")
    yield command
    if command.process.poll() is None:
        command.process.kill()
    command.process.communicate()


def test_the_command_ends_with_130_and_a_whole_folder(command):
    command.wait_for("MoveTo", "i02")
    for _ in range(3):
        command.process.send_signal(signal.SIGINT)
        threading.Event().wait(0.002)
    code, out, err = command.end()
    assert code == 130
    assert "run aborted: Interrupted at “" in out
    assert "All winches stand still, held." in out
    assert f"run folder  {command.folder}" in out
    assert "Traceback" not in out + err
    last = read_journal(command.journal)[-1]
    assert (last.kind, last.outcome) == (LineKind.RUN_FINISHED, Outcome.ABORTED)
    assert [w.id for w in read_campaign(command.folder).windows] in (["i01"], ["i01", "i02"], ["i01", "i02", "i03"])
    assert {p.name for p in command.folder.iterdir()} >= {"truth.json", "plan.toml", "raw", "robot.toml"}


def test_after_a_kill_the_accepted_windows_are_a_campaign(command):
    command.wait_for("Record", "i02")
    threading.Event().wait(0.2)
    os.kill(command.process.pid, signal.SIGKILL)
    assert command.end()[0] == -signal.SIGKILL
    campaign = read_campaign(command.folder)
    assert [len(w.t) for w in campaign.windows] == [1001] * len(campaign.windows)
    assert 1 <= len(campaign.windows) < 4
    part = command.folder / "windows" / "i02.csv.part"
    if not part.exists():  # it was quicker than the kill
        assert (command.folder / "windows" / "i02.csv").exists()
    assert read_journal(command.journal)
    assert len(list(read_candump(command.folder / "raw" / "can.log"))) > 1000


@pytest.mark.slow
def test_in_real_time_with_threads_and_sockets_it_is_the_same(tmp_path, scene):
    for attempt in range(scene.tries):  # anew where a busy machine starved it, so that a guard had to stop it first
        command = Command(tmp_path / f"run{attempt}", "--real-time")
        reached = command.wait_for("Settle", "i01", may_end=True)
        command.process.send_signal(signal.SIGINT)
        command.process.send_signal(signal.SIGTERM)
        code, out, err = command.end()
        if reached and code != HardwareError.exit_code:
            break
    else:
        scene.skip_if_busy()
    assert code == 130, out + err
    assert "All winches stand still, held." in out
    assert "Traceback" not in out + err
    assert len(list(read_candump(command.folder / "raw" / "can.log"))) > 500


def test_ctrl_c_while_planning(tmp_path):
    command = Command(tmp_path / "run")
    for _ in range(round(SECONDS_LEFT / 0.02)):
        if command.begun.exists():
            break
        threading.Event().wait(0.02)
    threading.Event().wait(0.5)
    for _ in range(3):  # as a person would: Python drops an interrupt that strikes within a destructor
        command.process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            command.process.wait(3.0)
            break
    code, out, err = command.end()
    assert code == 130
    assert err.strip().endswith("interrupted")
    assert "Traceback" not in out + err
