"""Trajectory exports: read back what was written, name the line of every mistake, survive any bytes."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.errors import FileError

HEADER = [
    "Trajectories",
    "100",
    "\t\tplatform:a\t\t\tplatform:b\t\t\t",
    "Frame\tSub Frame\tX\tY\tZ\tX\tY\tZ",
    "\t\tmm\tmm\tmm\tmm\tmm\tmm",
]
ROWS = [f"{k}\t0\t{k}.5\t2\t3\t-4\t5\t1e3" for k in range(1, 31)]


def export(tmp_path: Path, lines: list[str]) -> Path:
    path = tmp_path / "motion.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_an_export_becomes_metres_and_seconds(tmp_path: Path):
    log = read_trajectories(export(tmp_path, HEADER + ROWS))
    assert log.names == ("platform:a", "platform:b")
    assert log.rate == 100.0
    assert log.positions.shape == (30, 2, 3)
    assert log.t[-1] == pytest.approx(0.29)
    assert log.positions[4] == pytest.approx(np.array([[0.0055, 0.002, 0.003], [-0.004, 0.005, 1.0]]))


def test_blanks_are_missing_and_dropped_frames_leave_a_gap_in_time(tmp_path: Path):
    rows = ROWS.copy()
    rows[3] = "4\t0\t\t\t\t1\t2\t3"
    del rows[10:15]
    log = read_trajectories(export(tmp_path, [*HEADER, *rows, "", "\t\t"]))
    assert np.isnan(log.positions[3, 0]).all()
    assert np.isfinite(log.positions[3, 1]).all()
    assert np.diff(log.t).max() == pytest.approx(0.06)


def test_windows_line_ends_and_trailing_tabs_are_read_alike(tmp_path: Path):
    path = tmp_path / "motion.txt"
    path.write_bytes("\r\n".join([*HEADER, *(row + "\t" for row in ROWS)]).encode("utf-8-sig"))
    assert len(read_trajectories(path).t) == 30


def replaced(index: int, line: str) -> list[str]:
    lines = HEADER + ROWS
    return [*lines[:index], line, *lines[index + 1 :]]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (HEADER[:1], "1 lines"),
        (replaced(0, "Model Outputs"), "line 1: 'Model Outputs' was found"),
        (ROWS, "Is its header lost? fidim import csv reads any table"),
        (replaced(1, "fast"), "line 2, column 1: 'fast' is not a number"),
        (replaced(1, "0"), "line 2: a frame rate of '0' Hz"),
        (replaced(1, ""), "line 2: a frame rate of '' Hz"),
        (replaced(2, "\t\t"), "line 3: names no marker"),
        (replaced(2, "\t\t\t\t\tb"), "line 3, column 3: a marker without a name"),
        (replaced(3, "Frame\tSub Frame\tX\tY\tZ"), "line 4: 5 columns"),
        (replaced(4, "\t\tmm\tmm\tmm\tcm\tcm\tcm"), "line 5: units 'cm mm'"),
        (replaced(7, "3\t0\t1\t2"), "line 8: 4 columns, the header has 8; is the file truncated?"),
        (replaced(7, "3\t0\t1\t2\t3\t4\t5\tmany"), "line 8, column 8: 'many' is not a number"),
        (replaced(7, "3\t0\t1\t2\t3\t4\t5\tinf"), "line 8, column 8: 'inf' is not a number"),
        (replaced(7, "2\t0\t1\t2\t3\t4\t5\t6"), "line 8, column 1: frame 2 comes after frame 2"),
        (replaced(7, "\t0\t1\t2\t3\t4\t5\t6"), "line 8, column 1: a frame without its number"),
        (HEADER + ROWS[:5], "5 frames"),
    ],
)
def test_every_mistake_names_its_line(tmp_path: Path, lines: list[str], says: str):
    with pytest.raises(FileError) as caught:
        read_trajectories(export(tmp_path, lines))
    assert says in str(caught.value)
    assert "motion.txt" in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(FileError, match="no such file"):
        read_trajectories(tmp_path / "none.txt")


CELLS = st.sampled_from(["", "1", "-2.5", "nan", "1e400", "x", "\t", "9" * 400, "١", "mm", "Trajectories"])


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.lists(CELLS, max_size=9).map("\t".join), max_size=30),
    keep=st.integers(0, 5),
    raw=st.none() | st.binary(max_size=60),
)
def test_whatever_is_in_the_file_it_is_read_or_refused_with_a_sentence(
    tmp_path: Path, rows: list[str], keep: int, raw: bytes | None
):
    path = export(tmp_path, [*HEADER[:keep], *rows, *ROWS[:20]])
    if raw is not None:
        path.write_bytes(path.read_bytes() + raw)
    with contextlib.suppress(FileError):  # anything else fails the test
        log = read_trajectories(path)
        assert log.positions.shape == (len(log.t), len(log.names), 3)
        assert (np.diff(log.t) > 0).all()
