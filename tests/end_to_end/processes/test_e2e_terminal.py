"""A whole dry run as a person does it: a terminal (tmux, 80 × 24), keys, and what stands on the screen."""

import shutil
import subprocess
import sys
import time

import pytest

SIZE = ("80", "24")
FIDIM = "from fidim_lab.app.cli import main; main()"
PATIENCE = 240.0
"""s, on a computer that others use too"""


class Terminal:
    def __init__(self, folder, command):
        self._tmux = ["tmux", "-S", str(folder / "tmux")]
        self._call("new-session", "-d", "-s", "lab", "-x", SIZE[0], "-y", SIZE[1], command)

    def press(self, *keys):
        self._call("send-keys", "-t", "lab", *keys)

    def screen(self):
        return self._call("capture-pane", "-p", "-t", "lab")

    def until(self, *wanted):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            shown = self.screen()
            found = next((text for text in wanted if text in shown), None)
            if found is not None:
                return found
            time.sleep(0.3)  # noqa: TID251 - the terminal's own time
        pytest.fail(f"none of {wanted} came within {PATIENCE:g} s; the screen shows\n{self.screen()}")

    def close(self):
        subprocess.run([*self._tmux, "kill-server"], capture_output=True, check=False)

    def _call(self, *words):
        return subprocess.run([*self._tmux, *words], capture_output=True, text=True, check=True).stdout


@pytest.fixture
def terminal(tmp_path):
    if shutil.which("tmux") is None:
        pytest.skip("tmux is not installed (apt install tmux)")
    opened = []

    def open_terminal(*words):
        command = " ".join(
            [f"FIDIM_RUNTIME_DIR={tmp_path / 'rt'}", "TERM=tmux-256color", sys.executable, "-c", f"'{FIDIM}'", *words]
        )
        folder = tmp_path / f"t{len(opened)}"
        folder.mkdir()
        opened.append(Terminal(folder, command))
        return opened[-1]

    yield open_terminal
    for each in opened:
        each.close()


@pytest.mark.slow
def test_a_dry_run_by_keys_with_an_emergency_stop_left_and_attached_again(terminal, tmp_path):
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
    check = [sys.executable, "-c", FIDIM, "verify", str(run)]
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
    lab.until("Go on with this run?")
    lab.press("y")
    lab.until("resets it")
    lab.until("emergency stop by fidim ui")
    lab.press("g")
    lab.until("emergency stop is latched")
    lab.press("r")
    lab.until("Has the cause gone?")
    lab.press("y")
    lab.until("Is nobody near the platform")
    lab.press("n")
    lab.press("r")
    lab.until("Has the cause gone?")
    lab.press("y")
    lab.until("Is nobody near the platform")
    lab.press("y")
    lab.until("the emergency stop is reset")
    lab.press("g")
    lab.until("RUNNING")
    lab.until("[d] done")
    lab.press("q")
