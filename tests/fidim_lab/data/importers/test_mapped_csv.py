"""Any CSV by a column map: decimal commas, epoch milliseconds, gaps; and what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.errors import FileError

MAP = """format = "fidim-columns/1"
time = "stamp"
time_unit = "ms"
delimiter = ";"
decimal = ","
unit = "mm"
[[marker]]
name = "A"
columns = ["ax", "ay", "az"]
"""


def files(tmp_path: Path, stamps: np.ndarray, text: str = MAP) -> tuple[Path, Path]:
    table, columns = tmp_path / "take.csv", tmp_path / "map.toml"
    columns.write_text(text, encoding="utf-8")
    rows = [f"{stamp:.0f};7;{k},5;2;" for k, stamp in enumerate(stamps)]
    table.write_text("\n".join(["stamp;other;ax;ay;az", *(row + "3" for row in rows)]), encoding="utf-8")
    return table, columns


def test_decimal_commas_and_epoch_milliseconds(tmp_path: Path):
    stamps = 1.7e12 + 10.0 * np.delete(np.arange(40), 7)
    log = read_mapped(*files(tmp_path, stamps))
    assert log.rate == pytest.approx(100.0)
    assert np.diff(log.t).max() == pytest.approx(0.02)
    assert log.positions[3, 0] == pytest.approx([0.0035, 0.002, 0.003])


@pytest.mark.parametrize("seed", range(5))
def test_stamps_of_arrival_that_jitter_have_the_rate_of_all_steps(seed: int, tmp_path: Path):
    """Their median step is 0.1 % off: over 1000 samples a whole one. A pause does not count as one step."""
    late = np.random.default_rng(seed).uniform(0.0, 2.0, 2000)
    stamps = np.delete(1.7e15 + 1e3 * (10.0 * np.arange(2000) + late), slice(700, 850))
    log = read_mapped(*files(tmp_path, stamps, MAP.replace('"ms"', '"us"')))
    assert log.rate == pytest.approx(100.0, rel=1e-5)
    assert np.rint(log.t * log.rate)[[0, 699, 700, -1]] == pytest.approx([0, 699, 850, 1999])
    assert any(words.startswith("stamps jitter by 6% of a step") for words in log.decided)


@pytest.mark.parametrize("seed", [1, 3, 11, 13, 16, 28])
def test_every_sample_is_counted_where_stamps_jitter_by_a_tenth_of_a_step(seed: int, tmp_path: Path):
    """Step by step one was counted wrongly in every third of such takes: refused, or told as a clock that was set."""
    random, rows = np.random.default_rng(seed), np.delete(np.arange(1200), np.r_[300:340])
    log = read_mapped(*files(tmp_path, np.sort(1.7e12 + 10.0 * rows + random.normal(size=len(rows)))))
    assert np.rint(log.t * log.rate) == pytest.approx(rows)
    assert log.rate == pytest.approx(100.0, rel=4e-5)
    assert not any("was set" in words for words in log.decided)


@pytest.mark.parametrize("began", [0.0, 0.3, 0.45])
def test_stamps_in_whole_milliseconds_have_the_rate_of_all(began: float, tmp_path: Path):
    """By the first and the last alone it was wrong by 1e-4, and inertias by many times their ±."""
    log = read_mapped(*files(tmp_path, np.floor(1.7e12 + began + 1e3 * np.arange(1005) / 119.88)))
    assert log.rate == pytest.approx(119.88, rel=1e-5)
    assert not any("jitter" in words for words in log.decided)


@given(began=st.floats(0.0, 86399.99), gap=st.integers(1, 500))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_times_of_day_go_on_after_midnight(began: float, gap: int, tmp_path: Path):
    """pandas writes them; some frames are missing, perhaps those at midnight."""
    counted = np.delete(np.arange(1200), slice(300, 300 + gap))
    stamps = pd.Timestamp("2026-03-01") + pd.to_timedelta(np.round(began + 0.01 * counted, 3), unit="s")
    table = pd.DataFrame({"stamp": stamps.strftime("%H:%M:%S.%f"), "ax": counted, "ay": 2.5, "az": 3.5})
    table.to_csv(tmp_path / "take.csv", sep=";", decimal=",", index=False)
    (tmp_path / "map.toml").write_text(MAP.replace('time_unit = "ms"', ""), encoding="utf-8")
    log = read_mapped(tmp_path / "take.csv", tmp_path / "map.toml")
    assert log.rate == pytest.approx(100.0, rel=1e-4)
    assert np.rint(log.t * log.rate) == pytest.approx(counted)


def test_a_stamp_far_from_the_others_is_named(tmp_path: Path):
    stamps = 1.7e12 + 10.0 * np.arange(400)
    stamps[0] = 0.0
    with pytest.raises(FileError, match=r"longest gap is 1\.7e\+09 s, before sample 2"):
        read_mapped(*files(tmp_path, stamps))


@pytest.mark.parametrize("by", [-4.0, 2.0, 4.0, 37.0])
@pytest.mark.parametrize("at", [60, 600, 1100])
def test_a_clock_that_is_set_while_samples_continue_leaves_the_rate_as_it_was(by: float, at: int, tmp_path: Path):
    """As NTP sets a computer's clock; by 4 ms an inertia was wrong by 50 stated standard deviations."""
    rows = np.arange(1151)
    log = read_mapped(*files(tmp_path, 1_767_225_600_123.0 + 10.0 * rows + by * (rows >= at)))
    assert log.rate == pytest.approx(100.0, rel=1e-6)
    assert np.diff(log.t)[: at - 1] == pytest.approx(0.01)
    assert any(f"stamps step by {by:+.3g} ms at" in words for words in log.decided)
    assert log.breaks == pytest.approx([log.t[at] - 0.005] if by > 10.0 else [])  # then frames may be lost, too


def test_stamps_that_jitter_or_are_rounded_are_of_no_clock_that_was_set(tmp_path: Path):
    rng = np.random.default_rng(5)
    jittery, rounded = 10.0 * np.arange(1151) + rng.normal(size=1151) / 2, np.round(1e3 * np.arange(1151) / 120)
    for stamps in (jittery, rounded):
        assert not any("clock" in words for words in read_mapped(*files(tmp_path, 1.7e12 + stamps)).decided)
    sped_up = np.cumsum(np.where(np.arange(1151) < 500, 1e4, 10004.0))  # as a clock is set right slowly
    log = read_mapped(*files(tmp_path, 1.7e15 + sped_up, MAP.replace('time_unit = "ms"', 'time_unit = "us"')))
    assert not any("was set" in words for words in log.decided)


def test_seconds_and_nanoseconds_are_one_stamp(tmp_path: Path):
    text = MAP.replace('time_unit = "ms"', 'nanoseconds = "part"').replace('"stamp"', '"whole"')
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    rows = [f"{1_700_000_000 + k // 100};{k % 100 * 10_000_000};{k};2;3" for k in range(90, 140)]
    (tmp_path / "take.csv").write_text("\n".join(["whole;part;ax;ay;az", *rows]), encoding="utf-8")
    log = read_mapped(tmp_path / "take.csv", tmp_path / "map.toml")
    assert log.rate == pytest.approx(100.0, rel=1e-5)
    assert log.t == pytest.approx(np.arange(50) / 100.0, abs=1e-5)
    assert log.began == pytest.approx(1_700_000_000.9)


@pytest.mark.parametrize(
    ("stamps", "text", "says"),
    [
        (np.repeat(np.arange(0, 400, 20), 2), MAP, "has the same time"),
        (10.0 * np.arange(40) + 5.0 * (np.arange(40) % 5 == 2), MAP, "even steps"),
        (10.0 * np.arange(40), MAP.replace('"ax', '"Ax'), "'Ax' is not there.*nearest is 'ax'. map.toml names it"),
        (10.0 * np.arange(40), MAP.replace('"ms"', '"s"'), r"map\.toml: time_unit: .*time_unit = \"ms\""),
        (10.0 * np.arange(40), MAP.replace('unit = "mm"', 'unit = "ell"'), "ell"),
    ],
)
def test_what_cannot_be_right_is_refused(tmp_path: Path, stamps: np.ndarray, text: str, says: str):
    with pytest.raises(FileError, match=says):
        read_mapped(*files(tmp_path, stamps, text))


def test_vicon_csv_is_read_as_its_text(tmp_path: Path):
    head = ["Trajectories", "100", ",,s:a,,,s:b,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm"]
    path = tmp_path / "take.csv"
    path.write_text("\n".join([*head, *(f"{k},0,1,2,3,4,5,6" for k in range(1, 31))]), encoding="utf-8")
    assert read_trajectories(path).positions[0] == pytest.approx(1e-3 * np.array([[1, 2, 3], [4, 5, 6]]))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_rows_in_any_order_and_twice_are_the_same_take(tmp_path: Path, data: st.DataObject):
    """Networks deliver late and twice, and some programs write the newest row first."""
    rows = list(range(60))
    for at in data.draw(st.lists(st.integers(0, 54), max_size=6)):
        rows.insert(at, rows.pop(at + data.draw(st.integers(0, 5))))
    for at in data.draw(st.lists(st.integers(0, 59), max_size=6)):
        rows.insert(at, rows[at])
    rows = rows[::-1] if data.draw(st.booleans()) else rows
    table, columns = files(tmp_path, 10.0 * np.arange(60))
    even = read_mapped(table, columns)
    head, *lines = table.read_text(encoding="utf-8").split("\n")
    table.write_text("\n".join([head, *(lines[k] for k in rows)]) + "\n", encoding="utf-8")
    log = read_mapped(table, columns)
    np.testing.assert_array_equal(log.t, even.t)
    np.testing.assert_array_equal(log.positions, even.positions)
    assert any("twice" in said for said in log.decided) is (len(rows) > 60)


def test_a_clock_that_begins_anew_is_no_disorder(tmp_path: Path):
    stamps = 10.0 * np.concatenate([np.arange(40), np.arange(30) + 0.5])
    with pytest.raises(FileError, match=r"sample 41 is 0\.385 s before the one above.*two takes"):
        read_mapped(*files(tmp_path, stamps))


@pytest.mark.parametrize(
    ("times", "of"),
    [
        ([f"{46082.5 + k / 100 / 86400:.11f}" for k in range(90)], "days of a spreadsheet"),
        ([f"{k // 6000 + 9:02d}:{k % 6000 / 100:06.3f}" for k in range(5950, 6040)], "minutes and seconds"),
    ],
    ids=["days", "minutes"],
)
def test_times_of_a_spreadsheet(times: list[str], of: str, tmp_path: Path):
    table, columns = files(
        tmp_path, np.arange(90.0), MAP.replace('time_unit = "ms"\n', "").replace('decimal = ","\n', "")
    )
    rows = table.read_text(encoding="utf-8").replace(",", ".").split("\n")
    rows[1:] = [";".join([time, *row.split(";")[1:]]) for time, row in zip(times, rows[1:], strict=True)]
    table.write_text("\n".join(rows), encoding="utf-8")
    log = read_mapped(table, columns)
    assert log.rate == pytest.approx(100.0, rel=1e-4), of
    assert log.began is None
