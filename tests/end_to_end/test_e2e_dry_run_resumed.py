"""A killed dry run goes on like a run: as typed, from its folder alone, by one process at a time."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

FIDIM = [sys.executable, "-c", "import sys; from fidim_lab.app.cli import run; sys.exit(run(sys.argv[1:]))"]
PATIENCE = 240.0
"""s, on a computer that others use too"""


def fidim(*words):
    return subprocess.run([*FIDIM, *map(str, words)], capture_output=True, text=True, timeout=PATIENCE, check=False)


def accepted(folder):
    """Files of accepted windows, once their journal says so."""
    lines = (folder / "journal.jsonl").read_text().splitlines() if (folder / "journal.jsonl").exists() else []
    done = [line for line in lines if '"step": "Accept"' in line and '"kind": "step-finished"' in line]
    return {path: path.read_bytes() for path in sorted((folder / "windows").glob("*.csv"))} if done else {}


@pytest.fixture
def cut_off(tmp_path):
    """A dry run, stopped in mid-course by SIGSTOP after its first window; its process."""
    folder = tmp_path / "run"
    process = subprocess.Popen(
        [*FIDIM, "dry-run", "--equilibria", "3", "--validate", "0", "--seed", "3", "--out", str(folder)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    end = time.monotonic() + PATIENCE
    while not accepted(folder) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.005)  # noqa: TID251 - another process's time
    os.kill(process.pid, signal.SIGSTOP)
    assert process.poll() is None
    yield folder, process
    process.kill()
    process.wait()


@pytest.mark.slow
def test_a_killed_dry_run_goes_on_and_its_finished_windows_stay_as_they_are(cut_off, tmp_path):
    folder, process = cut_off
    journal = (folder / "journal.jsonl").read_bytes()
    busy = fidim("resume", folder)
    assert busy.returncode == 2
    assert "another process writes this run" in busy.stderr
    assert (folder / "journal.jsonl").read_bytes() == journal

    process.kill()
    process.wait()
    before = accepted(folder)
    assert 1 <= len(before) < 3, "it was too quick, or too slow, for this test"
    done = fidim("resume", folder, "--json", tmp_path / "result.json")
    assert done.returncode == 0, done.stderr
    assert "run pass" in done.stdout
    after = accepted(folder)
    assert {path: after[path] for path in before} == before
    assert len(after) == 3
    assert len(set(after.values())) == 3
    assert json.loads((tmp_path / "result.json").read_text())["format"] == "fidim-result/1"
    assert (folder / "report.html").exists()
    assert "intact" in fidim("verify", folder).stdout
    numbers = [json.loads(line)["number"] for line in (folder / "journal.jsonl").read_text().splitlines()]
    assert numbers == list(range(1, len(numbers) + 1))
