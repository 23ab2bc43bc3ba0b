"""Robot logs by a map: long and wide, counts and degrees, padding and a cut-off end; and which take each belongs to."""

import re
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app.records.import_logs import match
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.robot_log import read_robot_log
from fidim_lab.data.importers.takes import EncoderLog, Take
from fidim_lab.errors import FileError, SetupError

LONG = """format = "fidim-log/1"
time = 2
actuator = 3
[[cable]]
actuator = 7
counts = 5
metres_per_count = 1e-6
swivel = 6
swivel_unit = "counts"
swivel_counts_per_turn = 4096
current = 4
[[cable]]
actuator = 9
counts = 5
metres_per_count = -2e-6
"""
WIDE = """format = "fidim-log/1"
time = "ms"
time_unit = "ms"
[[cable]]
length = "L1"
length_unit = "mm"
swivel = "S1"
swivel_unit = "deg"
[[cable]]
length = "L2"
length_unit = "mm"
swivel = "S2"
swivel_unit = "deg"
"""


def written(tmp_path: Path, text: str, columns: str | None = None) -> tuple[Path, Path | None]:
    log, map_file = tmp_path / "r_7.log", tmp_path / "log.toml"
    log.write_bytes(text.encode())
    map_file.write_text(columns or "", encoding="utf-8")
    return log, map_file if columns else None


def test_a_row_for_each_actuator_padded_with_nul_bytes_and_cut_off(tmp_path: Path):
    rows = [f"3,{0.01 * k:.2f},{a},{a / 10},{1000 * a + k},{(4090 + k) % 4096}" for k in range(60) for a in (7, 9)]
    log, map_file = written(tmp_path, "\n".join(rows) + "\n3,0.6" + "\0" * 500, LONG)
    found = read_robot_log(log, 2, map_file)
    assert found.t == pytest.approx(0.01 * np.arange(60))
    assert found.lengths[5] == pytest.approx([7005e-6, -2 * 9005e-6])
    assert found.swivels is None  # one cable has none
    assert found.currents is None
    assert "cut off" in found.decided[0]


def test_named_columns_in_ms_mm_and_degrees_with_decimal_commas(tmp_path: Path):
    rows = [f"{1.75e12 + 10 * k:.0f};1500,5;90;{2000 + k};180" for k in range(60)]
    log, map_file = written(tmp_path, "\n".join(["ms;L1;S1;L2;S2", *rows]) + "\n", WIDE)
    found = read_robot_log(log, 2, map_file)
    assert found.t[0] == pytest.approx(1.75e9)
    assert found.lengths[3] == pytest.approx([1.5005, 2.003])
    assert found.swivels is not None
    assert found.swivels[0] == pytest.approx([np.pi / 2, np.pi])


def test_without_a_map_the_columns_have_our_own_names(tmp_path: Path):
    rows = [f"{0.01 * k:.2f},1.5,{2 + 0.001 * k:.3f}" for k in range(60)]
    log, _ = written(tmp_path, "\n".join(["t,l1,l2", *rows]) + "\n")
    assert read_robot_log(log, 2, None).lengths[9] == pytest.approx([1.5, 2.009])
    with pytest.raises(FileError, match="'l3' is not there"):
        read_robot_log(log, 3, None)


@pytest.mark.parametrize(("unit", "step"), [("ms", 10.0), ("us", 1e4), ("ns", 1e7), ("s", 0.01), ("s", 0.5)])
def test_the_unit_of_time_is_found_by_the_steps_where_no_map_says_it(tmp_path: Path, unit: str, step: float):
    begin = 1.75e9 * {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    rows = [f"{begin + step * k:.2f};1,5;{2 + 0.001 * k:.3f}".replace(".", ",") for k in range(60)]
    log, _ = written(tmp_path, "\n".join(["t;l1;l2", *rows]) + "\n")
    found = read_robot_log(log, 2, None)
    assert found.t[0] == pytest.approx(1.75e9)
    assert np.diff(found.t) == pytest.approx(0.5 if step == 0.5 else 0.01, abs=1e-5)
    assert found.decided[-1] == f"times of logs are in {unit}"


def test_other_names_of_columns_are_told_with_what_to_do(tmp_path: Path):
    log, _ = written(tmp_path, "t;L1;l2\n" + "0,01;1;2\n" * 60)
    with pytest.raises(FileError, match=r"'l1' is not there.*nearest is 'L1'. Without --log-map .* l1 to l2"):
        read_robot_log(log, 2, None)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        (WIDE.partition('[[cable]]\nlength = "L2"')[0], "1 cables; the robot file has 2"),
        (WIDE.replace('length_unit = "mm"', 'length_unit = "ell"'), "ell"),
        (LONG.replace("metres_per_count = 1e-6\n", ""), "belong together"),
        (LONG.replace("actuator = 3\n", ""), "actuator"),
        (LONG.replace("swivel_counts_per_turn = 4096\n", ""), "swivel_counts_per_turn"),
        (LONG.replace("counts = 5", "counts = 50"), "column 50 is wanted"),
        (LONG.replace("actuator = 9", "actuator = 8"), "0 samples are common"),
    ],
)
def test_a_wrong_map_is_told(tmp_path: Path, columns: str, says: str):
    rows = [f"3,{0.01 * k:.2f},{a},0.1,{k},9" for k in range(60) for a in (7, 9)]
    text = "\n".join(rows) if columns.startswith(LONG[:40]) else "ms;L1;S1;L2;S2\n" + "1;2;3;4;5\n" * 60
    log, map_file = written(tmp_path, text + "\n", columns)
    with pytest.raises(FileError, match=says):
        read_robot_log(log, 2, map_file)


def take(name: str, began: float | None = None) -> Take:
    markers = MarkerLog(Path(name), ("a",), 100.0, np.arange(1000) / 100.0, np.zeros((1000, 1, 3)), began=began)
    return Take(Path(name).stem, markers)


def log_of(name: str, begin: float = 0.0) -> EncoderLog:
    t = begin + np.arange(0.0, 60.0, 0.1)
    return EncoderLog(Path(name), t, np.zeros((len(t), 2)))


def test_logs_belong_to_takes_by_name_else_by_clock():
    takes, left = match([take("v_1.txt"), take("v_12.txt")], [log_of("r_12.log"), log_of("r_1.log"), log_of("r_9.log")])
    assert [one.log and one.log.source.name for one in takes] == ["r_1.log", "r_12.log"]
    assert set(left) == {"r_9.log"}
    day = log_of("day.log", 1.75e9)
    takes, left = match([take("a.mcap", 1.75e9 + 5.0), take("b.mcap", 1.75e9 + 55.0)], [day])
    assert [one.log is day for one in takes] == [True, False]  # the second runs on after the log's end
    assert match([take("a.csv")], [log_of("b.log")])[0][0].log is not None
    logs = [log_of("r_i01.log"), log_of("r_v01.log")]
    takes, left = match([take("v_v01.txt"), take("v_i01.txt")], logs)
    assert [one.log and one.log.source.name for one in takes] == ["r_v01.log", "r_i01.log"]
    assert left == {}
    with pytest.raises(SetupError, match=r"r_1.log and s_1.log both"):
        match([take("v_1.txt")], [log_of("r_1.log"), log_of("s_1.log")])


@pytest.mark.parametrize(
    ("shift", "says"),
    [(-2.0, "2 h later .* swing_a.csv, swing_b.csv.*local"), (5.75, "5.75 h earlier"), (0.3, None), (400.0, None)],
    ids=["two hours", "Nepal", "no zone", "another day"],
)
def test_a_log_in_local_time_is_told_by_how_many_hours(shift: float, says: str | None):
    """Two takes of a minute within a log of five; its clock is `shift` h ahead."""
    began = 1_770_000_000.0
    takes = [
        Take(name, MarkerLog(Path(f"swing_{name}.csv"), ("m1",), 100.0, t, np.zeros((len(t), 1, 3)), began=began + at))
        for name, at, t in [("a", 30.0, np.arange(6000) / 100), ("b", 120.0, np.arange(6000) / 100)]
    ]
    log = EncoderLog(Path("session.log"), began + 3600 * shift + np.arange(0.0, 300.0, 0.1), np.zeros((3000, 4)))
    matched, left = match(takes, [log])
    assert [take.log for take in matched] == [None, None]
    assert re.search(says or "^a log of no take, by name or clock$", left["session.log"])


@pytest.mark.parametrize(("full", "first"), [(2**16, 65_000), (2**32, 2**32 - 300), (2**16, 32_000)])
def test_a_counter_that_begins_anew_has_gone_on(tmp_path: Path, full: int, first: int):
    """As unsigned numbers, or from −2¹⁵ on."""
    counts = first + 40 * np.arange(60)
    low = -full // 2 if first < full // 2 else 0
    rows = [f"3,{0.01 * k:.2f},{a},1,{(c - low) % full + low},7" for k, c in enumerate(counts) for a in (7, 9)]
    log, map_file = written(tmp_path, "\n".join(rows) + "\n", LONG)
    found = read_robot_log(log, 2, map_file)
    assert np.diff(found.lengths[:, 0]) == pytest.approx(np.full(59, 40e-6))
    assert not any("jumps" in said for said in found.decided)


def test_a_counter_that_was_reset_is_told(tmp_path: Path):
    rows = [f"{0.01 * k:.2f},{1.5 if k < 40 else 0.2},{2 + 0.001 * k:.3f}" for k in range(60)]
    log, _ = written(tmp_path, "\n".join(["t,l1,l2", *rows]) + "\n")
    assert [said for said in read_robot_log(log, 2, None).decided if "jumps" in said] == [
        "cable 1 jumps by -1.3 m within a sample, 0.40 s after the log's begin: its counter was reset, or readings are "
        "wrong there"
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('time = "t"\nlength_unit = "mm"\n[[cable]]\nlength = "l1"\n', r"it belongs into \[\[cable\]\]"),
        ('time = "t"\n[[cable]]\nlength = "l1"\ntime_unit = "ms"\n', "it belongs above all tables"),
    ],
)
def test_a_key_in_another_table_is_told_where_it_belongs(text: str, says: str, tmp_path: Path):
    columns = tmp_path / "log.toml"
    columns.write_text(f'format = "fidim-log/1"\n{text}', "utf-8")
    with pytest.raises(FileError, match=rf"_unit: unknown key; {says}"):
        read_robot_log(tmp_path / "log.csv", 1, columns)
