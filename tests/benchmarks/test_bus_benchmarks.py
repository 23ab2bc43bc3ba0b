"""The bus benchmarks themselves, for a second or two each: they run, and what must hold on any computer holds."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(not (ROOT / "benchmarks" / "bus").is_dir(), reason="benchmarks/ is not here")


def run(*arguments: str) -> str:
    command = [sys.executable, "-m", "benchmarks.bus", *arguments, "--print"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def cells(text: str, first: str) -> list[str]:
    """The table's row that begins so."""
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {first}")]
    return [cell.strip() for cell in line.strip("|").split("|")]


@pytest.mark.parametrize("over", ["tcp", "inprocess", "slcan"])
@pytest.mark.sampled(1)
def test_nothing_is_lost_however_late_it_is(over):
    row = cells(run("rates", "--minutes", "0.02", "--sync", "250", "--over", over), over)
    assert row[3].split(",")[0] == "0"
    cycles = int(row[1].split()[0].replace(",", ""))
    assert row[2] == f"{8 * cycles:,}, {4 * cycles:,}"
    assert int(row[6].split(",")[0]) > 100


@pytest.mark.parametrize("over", ["tcp", "slcan"])
@pytest.mark.sampled(1)
def test_a_full_bus_is_read_whole(over):
    row = cells(run("saturated", "--minutes", "0.015", "--over", over), over)
    assert row[2] == "0"
    assert row[1] == row[3]
    assert int(row[1].replace(",", "")) > 2000


def test_dates_are_right_to_a_tenth_and_by_a_jog_to_a_millisecond():
    text = run("time", "--seeds", "1")
    for sync in (100, 250, 500):
        for kind, limit in (("relative", 0.1), ("absolute", 1.0)):
            (worst,) = re.findall(rf"SYNC {sync} Hz: {kind}.*?\| [\d.]+, ([\d.]+) ms", text)
            assert float(worst) < limit


@pytest.mark.slow
def test_drives_stop_by_themselves_and_stay():
    text = run("kills", "--rounds", "4")
    assert "move again: 0 of 2" in text
    assert cells(text, "all")[1] != "0 of 16"
