"""A terminal (tmux) with a shell-like command in it."""

import shutil
import subprocess
import sys
import time

import pytest

SMALL = (80, 24)
FIDIM = "from fidim_lab.app.cli import main; main()"
PATIENCE = 240.0
"""s, on a computer that others use too"""


class Terminal:
    """One command in a terminal of its own; its last screen stays."""

    def __init__(self, folder, command, size):
        self._tmux = ["tmux", "-S", str(folder / "tmux")]
        width, height = map(str, size)
        shell = f"{command}; echo exit code $?; sleep 1000"
        self._call("new-session", "-d", "-s", "lab", "-x", width, "-y", height, shell)

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
def fidim():
    """The command, for a process of its own."""
    return [sys.executable, "-c", FIDIM]


@pytest.fixture
def terminal(tmp_path):
    if shutil.which("tmux") is None:
        pytest.skip("tmux is not installed (apt install tmux)")
    opened = []

    def open_terminal(*words, size=SMALL):
        command = " ".join(
            [
                "env -u COLUMNS",
                f"FIDIM_RUNTIME_DIR={tmp_path / 'rt'}",
                "TERM=tmux-256color",
                sys.executable,
                "-c",
                f"'{FIDIM}'",
                *words,
            ]
        )
        folder = tmp_path / f"t{len(opened)}"
        folder.mkdir()
        opened.append(Terminal(folder, command, size))
        return opened[-1]

    yield open_terminal
    for each in opened:
        each.close()
