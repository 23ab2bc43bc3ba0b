"""SIGKILL while a window is recorded, in real processes: at most 0.1 s of the open window, never a finished one."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.data.window_csv import WindowColumns
from fidim_lab.data.window_mcap import window_as_mcap
from procedures.recording.part_file import keep_unfinished

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "killed_recording.py"


@pytest.mark.parametrize("kills", [3, pytest.param(25, marks=pytest.mark.slow)])
def test_sigkill_at_random_moments(kills):
    if not SCRIPT.exists():
        pytest.skip("benchmarks/ is not beside the tests")
    told = subprocess.run([sys.executable, str(SCRIPT), str(kills), "7"], capture_output=True, text=True, timeout=300)
    assert told.returncode == 0, told.stderr
    found = json.loads(told.stdout)
    assert found["summary"]["in_an_open_window"] >= kills - 1
    for kill in found["kills"]:
        allowed = 0.1 + 0.01 + 2.0 * kill["stall"]  # one frame may be under way; a stalled process catches up at once
        assert kill["lost_csv"] <= allowed, kill
        assert kill["lost_mcap"] <= allowed, kill
        assert kill["finished_whole"] == kill["finished"], kill


def test_what_is_left_is_moved_aside_and_never_overwritten(tmp_path):
    (tmp_path / "windows").mkdir()
    whole = window_as_mcap(WindowColumns(np.arange(30) / 100.0, np.zeros((30, 1, 3)), None, None, {}))
    for _ in range(2):
        (tmp_path / "windows" / "i01.csv.part").write_text("t,x,y,z\n")
        (tmp_path / "windows" / "i01.mcap.part").write_bytes(whole[:200])
        (tmp_path / "windows" / "i02.csv").write_text("whole")
        kept = keep_unfinished(tmp_path)
        assert len(kept) == 2
    names = sorted(path.name for path in (tmp_path / "rejected").iterdir())
    assert names == [f"i01-unfinished{k}.{kind}.part" for k in (1, 2) for kind in ("csv", "mcap")]
    assert [path.name for path in (tmp_path / "windows").iterdir()] == ["i02.csv"]
    assert keep_unfinished(tmp_path) == ()
