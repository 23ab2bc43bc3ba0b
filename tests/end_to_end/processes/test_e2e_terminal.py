"""A robot as a person has it: a terminal (tmux), commands, keys, and what stands on the screen."""

import os
import pty
import socket
import subprocess
import termios
from contextlib import ExitStack
from pathlib import Path

import pytest

LARGE = (140, 40)
RIG = Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml"
PLAN = (Path(__file__).parents[2] / "one_window.toml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_dry_run_by_keys_with_an_emergency_stop_left_and_attached_again(terminal, tmp_path, fidim):
    run = tmp_path / "run"
    lab = terminal("dry-run", "--ui", "--equilibria", "1", "--validate", "0", "--out", str(run))
    lab.until("L A T C H E D")
    lab.press("g")
    lab.until("emergency stop is latched")
    lab.press("r")
    lab.until("Reset the emergency stop?")
    lab.press("y")
    lab.until("the emergency stop is reset")
    lab.press("g")
    lab.until("RUNNING")
    lab.press("2")
    lab.until("operation enabled")
    assert all(len(row) <= 80 for row in lab.screen().splitlines())

    lab.until("[d] done")
    lab.press("q")
    other = terminal("ui", str(run))
    other.until("[d] done")
    while other.until("[d] done", "recording  ", "THE SERVICE HAS ENDED") == "[d] done":
        other.press("d", "3")
    other.until("✓ pass", "THE SERVICE HAS ENDED", "the last recording", "[d] done")
    other.press("1")
    while other.until("[d] done", "THE SERVICE HAS ENDED") == "[d] done":
        other.press("d")
    other.until("✓ pass", "~ marginal")
    other.until("THE SERVICE HAS ENDED")
    other.press("i")
    assert other.until("converged", "not-converged", "misfit", "refused", "✗ fidim identify") != "✗ fidim identify"
    other.press("q")
    check = [*fidim, "verify", str(run)]
    assert "intact" in subprocess.run(check, capture_output=True, text=True, check=True).stdout
    assert list((run / "windows").glob("i01*"))


@pytest.mark.slow
def test_after_the_emergency_stop_key_a_run_goes_on_by_keys_alone(terminal, tmp_path):
    lab = terminal("dry-run", "--ui", "--equilibria", "1", "--validate", "0", "--out", str(tmp_path / "run"))
    lab.until("L A T C H E D")
    lab.press("r")
    lab.until("Reset the emergency stop?")
    lab.press("y")
    lab.until("the emergency stop is reset")
    lab.press("g")
    lab.until("RUNNING")
    lab.press("?")
    lab.until("EMERGENCY STOP: all winches")
    lab.press("F12")
    lab.until("L A T C H E D", "THE SERVICE HAS ENDED")
    lab.press("Escape")
    lab.until("emergency stop by fidim ui")
    assert (tmp_path / "run" / "journal.jsonl").exists()
    lab.until("starts the service again")
    lab.press("r")
    lab.until("Continue this run?")
    lab.press("y")
    lab.until("resets it")
    lab.until("emergency stop by fidim ui")
    lab.press("g")
    lab.until("emergency stop is latched")
    lab.press("r")
    lab.until("Has its cause been removed?")
    lab.press("y")
    lab.until("Is nobody near the platform")
    lab.press("n")
    lab.press("r")
    lab.until("Has its cause been removed?")
    lab.press("y")
    lab.until("Is nobody near the platform")
    lab.press("y")
    lab.until("the emergency stop is reset")
    lab.press("g")
    lab.until("RUNNING")
    lab.until("[d] done")
    lab.press("q")


def free_ports(number):
    with ExitStack() as open_:
        sockets = [open_.enter_context(socket.socket()) for _ in range(number)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


@pytest.fixture
def rig(tmp_path, terminal):
    """Simulated devices with power of their own, as drives have it."""
    text = RIG.read_text(encoding="utf-8")
    for old, new in zip(("20100", "20101", "20102"), free_ports(3), strict=True):
        text = text.replace(old, str(new))
    text = text.replace("heartbeat = 0.3 ", "heartbeat = 1.0 ").replace("age = 1.0 ", "age = 2.0 ")  # a busy computer
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    terminal("simulators", str(path), "--plan", str(tmp_path / "plan.toml")).until("ready")
    return path


def answer_both(lab):
    lab.until("1 of 2: has the cause been removed?")
    lab.press("yes", "Enter")
    lab.until("2 of 2: is nobody near the platform and the cables?")
    lab.press("yes", "Enter")


@pytest.mark.slow
def test_power_is_taken_in_every_state_where_no_service_holds_the_load(terminal, rig, tmp_path):
    run, plan = tmp_path / "run", tmp_path / "plan.toml"

    def power_off(says, *, answer=""):
        other = terminal("power-off", str(rig), size=LARGE)
        if answer:
            other.until("Is the load secured?")
            other.press(answer, "Enter")
        other.until(says)
        other.until("exit code")
        return other.screen()

    idle = power_off("winch 4 (node 4): switch on disabled → switch on disabled", answer="y")
    assert "exit code 0" in idle

    lab = terminal("run", str(plan), "--rig", str(rig), "--out", str(run), size=LARGE)
    lab.until("RUN-STARTED")
    assert "exit code 2" in power_off("A service holds the load with the drives' power")  # running
    lab.until("[done")
    assert "exit code 2" in power_off("A service holds the load with the drives' power")  # asked
    screen = terminal("ui", str(run), size=LARGE)
    screen.until("[d] done")
    screen.press("F12")
    screen.until("L A T C H E D")
    lab.until("exit code 3")
    assert any(" GUARD-TRIPPED " in row[:30] for row in lab.screen().splitlines()), "not behind the open question"
    assert "exit code 1" in power_off("Nothing was sent to the drives.", answer="n")  # latched
    assert "exit code 0" in power_off("winch 4 (node 4): quick stop active → switch on disabled", answer="y")
    screen.press("q")

    lab = terminal("run", str(plan), "--rig", str(rig), "--out", f"{run}2", "--stay", size=LARGE)
    answer_both(lab)
    lab.until("RUN-STARTED")
    terminal("stop", "--rig", str(rig)).until("exit code 0")
    lab.until("The service continues to run (--stay)")
    assert "exit code 2" in power_off("A service holds the load with the drives' power")  # the service alone
    terminal("shutdown", "--rig", str(rig)).until("exit code 0")
    lab.until("exit code 3")
    assert "exit code 0" in power_off("→ switch on disabled", answer="y")

    reset = terminal("reset", "--rig", str(rig))
    answer_both(reset)
    reset.until("The emergency stop is reset.")


def test_a_screen_whose_terminal_is_gone_without_a_hang_up_ends(fidim, tmp_path, monkeypatch):
    """A lost container or pipe of terminals sends no SIGHUP: the UI read on for ever, with half of a core."""
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path / "run"))
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    command = [*fidim, "ui"]
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
    os.close(theirs)
    drawn = b""
    while b"No service" not in drawn:
        drawn += os.read(ours, 1 << 16)
    os.close(ours)
    with process:
        assert process.wait(timeout=60) == 0
