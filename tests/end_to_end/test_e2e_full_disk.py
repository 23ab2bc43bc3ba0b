"""A disk that is full at any write: a held robot, a sentence that names the file, everything kept that it had taken."""

import errno
import os
import re
import signal
import subprocess
import sys

import pytest

from drivers.canbus.candump import CandumpLog, read_candump
from fidim_lab.data.campaign import read_campaign
from procedures.recording.journal import Journal, LineKind, read_journal

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def full(*_args, **_more):
    raise FULL


def full_after(count):
    """`os.write` on a disk with room for so many bytes."""
    left = [count]

    def write(descriptor, data):
        if left[0] <= 0:
            raise FULL
        written = os.write(descriptor, data[: left[0]])
        left[0] -= written
        return written

    return write


@pytest.mark.parametrize("room", [0, 1, 60, 500, 4_000, 9_000, 14_000, 30_000])
@pytest.mark.sampled(1)
def test_a_full_disk_under_a_recording(rehearsal, room):
    rehearsal.at("Record", lambda stage: None)
    ended = rehearsal.run(write=full_after(room))
    report = ended.check()
    assert re.search(r"windows/i01\.(csv|mcap)\.part: cannot be written: No space left on device\.", report.reason)
    assert "What was recorded of the open window is kept in rejected/i01-attempt1.csv." in report.reason
    assert report.exit_code == 3
    csv = (ended.folder / "rejected" / "i01-attempt1.csv").read_bytes()
    log = (ended.folder / "rejected" / "i01-attempt1.mcap.part").read_bytes()
    assert room - 120 < len(csv) + len(log) <= room  # all that there was room for, but for the last line's part


@pytest.mark.parametrize("step", ["Enable", "MoveTo", "Ask", "Record", "CheckWindow"])
@pytest.mark.parametrize("where", ["fsync", "write"])
@pytest.mark.sampled(1)
def test_a_full_disk_under_the_journal(rehearsal, monkeypatch, step, where):
    target = (os, "fsync") if where == "fsync" else (Journal, "_append")
    rehearsal.at(step, lambda stage: monkeypatch.setattr(*target, full))
    ended = rehearsal.run()
    monkeypatch.undo()
    report = ended.check(journal=False)
    assert "No space left on device" in report.reason
    assert report.exit_code == 3
    assert [e.kind for e in ended.journal][:2] == [LineKind.RUN_STARTED, LineKind.STEP_STARTED]  # readable up to there
    for word in report.reason.split():
        if word.startswith(("windows/", "rejected/")) and "kept in" in report.reason:
            assert (ended.folder / word.rstrip(".")).exists(), "the sentence names where the window is"


@pytest.mark.parametrize("target", ["procedures.recording.run_folder.write_index", "pathlib.Path.replace"])
@pytest.mark.sampled(1)
def test_a_full_disk_as_a_window_is_accepted(scene, rehearsal, monkeypatch, target):
    rehearsal.plan = scene.two
    rehearsal.at("Record", lambda stage: monkeypatch.setattr(target, full), nth=2)
    ended = rehearsal.run()
    monkeypatch.undo()
    report = ended.check(part=True)
    assert "cannot be written: No space left on device." in report.reason
    assert report.exit_code == 3
    assert [row.id for row in report.accepted] == ["i01"]
    assert [w.id for w in read_campaign(ended.folder).windows] == ["i01"]


class FullFile:
    """A file on a disk that has just become full."""

    closed = False
    write = flush = full

    def __init__(self, file):
        self.name, self.close = file.name, file.close


@pytest.mark.parametrize("step", ["MoveTo", "Record"])
@pytest.mark.sampled(1)
def test_a_full_disk_under_the_raw_log(rehearsal, monkeypatch, step):
    logs, make = [], CandumpLog.__init__

    def noted(log, *more):
        make(log, *more)
        logs.append(log)

    def fill(_stage):
        logs[0]._file._file = FullFile(logs[0]._file._file)

    monkeypatch.setattr(CandumpLog, "__init__", noted)
    rehearsal.at(step, fill, after=0.3)
    ended = rehearsal.run()
    report = ended.check(log=False)
    assert "The log guard stopped the run" in report.reason
    assert "can.log cannot be written: No space left on device" in report.reason
    assert report.exit_code == 3
    logged = list(read_candump(ended.folder / "can.log"))
    assert [f.data for f in logged] == [f.data for f in ended.frames[: len(logged)]]


def test_a_file_size_limit_of_the_operating_system(tmp_path):
    """The kernel itself refuses, in a real process: whichever file comes first, the run ends as it should."""
    script = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000)); sys.argv = sys.argv[1:]\n"
    )
    script += "from fidim_lab.app.cli import main; main()"
    command = ["fidim", "dry-run", "--equilibria", "1", "--validate", "0", "--out", str(tmp_path / "run")]
    ended = subprocess.run([sys.executable, "-c", script, *command], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 3, ended.stderr
    assert "raw/can.log cannot be written: File too large" in ended.stdout
    assert "All winches stand still, held." in ended.stdout
    assert "Traceback" not in ended.stdout + ended.stderr
    last = read_journal(tmp_path / "run" / "journal.jsonl")[-1]
    assert last.kind is LineKind.RUN_FINISHED
    assert len(list(read_candump(tmp_path / "run" / "raw" / "can.log"))) > 500
    assert signal.getsignal(signal.SIGXFSZ) is signal.SIG_IGN  # as Python has it: a refusal, not a death
