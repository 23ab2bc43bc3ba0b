"""One motion as other programs write it: pandas in every dialect, ezc3d, rosbags, headers as laboratories have them."""

import contextlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fidim_lab.app.records.import_kinds import MARKER_READERS
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.importers.ros_bag import read_bag
from fidim_lab.errors import FileError

COUNT, RATE = 40, 100.0
PLACES = np.round(np.random.default_rng(3).uniform(-1500.0, 1500.0, (COUNT, 2, 3)), 4)
"""mm"""
BEGAN = pd.Timestamp("2026-03-01 23:58:59.990", tz="UTC")
AXES = [f"{marker}{axis}" for marker in "ab" for axis in "xyz"]
MAP = 'format = "fidim-columns/1"\ntime = "time"\nunit = "mm"\n' + "\n".join(
    f'[[marker]]\nname = "{m}"\ncolumns = ["{m}x", "{m}y", "{m}z"]' for m in "ab"
)


def same(log: MarkerLog, unit: float = 1e-3, atol: float = 1e-7) -> None:
    """The motion, its rate and its times."""
    assert log.rate == pytest.approx(RATE, rel=1e-4)
    assert log.t == pytest.approx(np.arange(COUNT) / RATE, abs=1e-5)
    np.testing.assert_allclose(log.positions, unit * PLACES, atol=atol)


def frame(times: object) -> pd.DataFrame:
    return pd.DataFrame(np.column_stack([PLACES.reshape(COUNT, 6)]), columns=AXES).assign(time=times)


STEPS = np.arange(COUNT) / RATE
STAMPS = pd.date_range(BEGAN, periods=COUNT, freq="10ms")
TIMES = {
    "seconds": STEPS + 12.34,
    "milliseconds": 1e3 * STEPS,
    "epoch, s": 1.7e9 + STEPS,
    "epoch, ms": 1.7e12 + 1e3 * STEPS,
    "epoch, ns": (1.7e18 + 1e9 * STEPS).astype(np.int64),
    "ISO, blank": STAMPS.strftime("%Y-%m-%d %H:%M:%S.%f"),
    "ISO, T and Z": STAMPS.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    "ISO with its zone": STAMPS.strftime("%Y-%m-%dT%H:%M:%S.%f+02:00"),
    "time of day": STAMPS.strftime("%H:%M:%S.%f"),
}
LAYOUTS = {
    "comma": {"sep": ","},
    "German Excel": {"sep": ";", "decimal": ",", "encoding": "utf-8-sig", "lineterminator": "\r\n"},
    "German Excel, Unicode text": {"sep": "\t", "decimal": ",", "encoding": "utf-16"},
    "tabs": {"sep": "\t"},
    "blanks": {"sep": " "},
    "quoted": {"sep": ",", "quoting": 1},
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("times", TIMES)
def test_what_pandas_writes(times: str, layout: str, tmp_path: Path):
    if layout == "blanks" and "blank" in times:
        pytest.skip("a time with a blank in it goes with no table of blanks")
    table, columns = tmp_path / "take.csv", tmp_path / "map.toml"
    frame(TIMES[times]).to_csv(table, index=False, **LAYOUTS[layout])
    columns.write_text(MAP, encoding="utf-8")
    log = read_mapped(table, columns)
    same(log)
    assert (log.began is not None) == times.startswith(("epoch", "ISO"))


@pytest.mark.parametrize(
    ("above", "below"),
    [
        ("sep=;\n", ""),
        ("Exported by LabTool 3\nsubject;platform\n\n", ""),
        ("# exported on a Monday\n", ""),
        ("", "[s];[mm];[mm];[mm];[mm];[mm];[mm];\n"),
        ("Robot: A\n", "s;mm;mm;mm;mm;mm;mm;\n# data follows\n"),
    ],
)
def test_lines_above_the_names_and_units_below_them(above: str, below: str, tmp_path: Path):
    table, columns = tmp_path / "take.csv", tmp_path / "map.toml"
    names = ["time", *AXES]
    rows = frame(STEPS).assign(note="a, b")[[*names, "note"]].to_csv(sep=";", index=False, header=False)
    table.write_text(above + ";".join([*names, "note"]) + "\n" + below + rows, encoding="utf-8")
    columns.write_text(MAP, encoding="utf-8")
    same(read_mapped(table, columns))


def test_names_behind_the_sign_of_a_comment(tmp_path: Path):
    np.savetxt(
        tmp_path / "take.txt",
        np.column_stack([STEPS, PLACES.reshape(COUNT, 6)]),
        header=" ".join(["time", *AXES]),
        fmt="%.6f",
    )
    (tmp_path / "map.toml").write_text(MAP, encoding="utf-8")
    same(read_mapped(tmp_path / "take.txt", tmp_path / "map.toml"))


def text_of(table: pd.DataFrame, sep: str, decimal: str = ".") -> str:
    return table.to_csv(sep=sep, decimal=decimal, index=False, header=False)


def numbered(sub_frames: bool) -> pd.DataFrame:
    lead = {"frame": np.arange(1, COUNT + 1)} | ({"sub": 0} if sub_frames else {"time": STEPS})
    return pd.concat([pd.DataFrame(lead), pd.DataFrame(PLACES.reshape(COUNT, 6))], axis=1)


def vicon(sep: str, decimal: str = ".", units: str = "mm", rate: str = "100") -> str:
    unit = sep.join(["", "", *[units] * 6])
    names = sep.join(["", "", "s:a", "", "", "s:b", "", ""])
    return "\n".join([
        "Trajectories", rate, names, sep.join(["Frame", "Sub Frame", *"XYZXYZ"]), unit,
    ]) + "\n" + text_of(numbered(True), sep, decimal)  # fmt: skip


def nexus_with_models() -> str:
    """Nexus' CSV with devices above and model outputs below the trajectories."""
    devices = "Devices\n1000\n,,Force.Fx\nFrame,Sub Frame,Fx\n,,N\n1,0,0.5\n1,1,0.6\n\n"
    models = "\nModel Outputs\n100\n,,s:CentreOfMass,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,3\n"
    return devices + vicon(",") + models


def motive(version: str, sep: str = ",", decimal: str = ".", *, unit: str | None = "Millimeters") -> str:
    head = ["Format Version", version, "Take Name", "a", "Take Notes", "", "Capture Frame Rate", "200.000000"]
    head += [
        "Export Frame Rate",
        "100.000000".replace(".", decimal),
        "Capture Start Time",
        "2026-03-01 10.00.00.000 AM",
    ]
    head += ["Total Frames in Take", str(COUNT), "Rotation Type", "Quaternion", "Coordinate Space", "Global"]
    head += ["Length Units", unit] if unit else []
    rows = [sep.join(head), ""]
    rows += [sep.join(["", kind, *values]) for kind, values in (
        ("Type", ["Marker"] * 6), ("Name", [*["s:a"] * 3, *["s:b"] * 3]), ("ID", ["1"] * 6),
    )]  # fmt: skip
    rows += [sep.join(["", "Parent", *["s"] * 6])] if version >= "1.24" else []
    rows += [sep.join(["", "", *["Position"] * 6]), sep.join(["Frame", "Time (Seconds)", *"XYZXYZ"])]
    table = numbered(False).assign(frame=np.arange(COUNT))
    return "\n".join(rows) + "\n" + text_of(table, sep, decimal)


def qtm(decimal: str = ".", *, bare: bool = False) -> str:
    head = [f"NO_OF_FRAMES\t{COUNT}", "NO_OF_CAMERAS\t8", "NO_OF_MARKERS\t2", f"FREQUENCY\t100{decimal}0"]
    head += ["NO_OF_ANALOG\t0", "DESCRIPTION\t--", "TIME_STAMP\t2026-03-01, 10:00:00.000\t123.4", "DATA_INCLUDED\t3D"]
    head += ["MARKER_NAMES\ta\tb", "TRAJECTORY_TYPES\tMeasured\tMixed"]
    table = numbered(False)
    if bare:
        return "\r\n".join(head) + "\r\n" + text_of(table.iloc[:, 2:], "\t", decimal)
    head += ["Frame\tTime\ta X\ta Y\ta Z\tb X\tb Y\tb Z"]
    return "\r\n".join(head) + "\r\n" + text_of(table, "\t", decimal)


def trc(decimal: str = ".", unit: str = "mm") -> str:
    head = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits"]
    head += [f"100{decimal}00\t100{decimal}00\t{COUNT}\t2\t{unit}", "Frame#\tTime\ta\t\t\tb\t\t\t"]
    head += ["\t\tX1\tY1\tZ1\tX2\tY2\tZ2", ""]
    return "\n".join(head) + "\n" + text_of(numbered(False), "\t", decimal)


DIALECTS = {
    "vicon-text tabs": vicon("\t"),
    "vicon-text decimal commas": vicon("\t", ","),
    "vicon-csv Nexus": nexus_with_models(),
    "vicon-csv saved by a German Excel": vicon(";", ","),
    "vicon-csv in quotes": "\n".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) if line else "" for line in vicon(",").split("\n")
    ),
    "vicon-csv padded to one width": "\n".join(
        line + "," * (8 - line.count(",") - 1) for line in vicon(",").split("\n") if line
    ),
    "motive-csv 1.1": motive("1.1"),
    "motive-csv 1.21": motive("1.21"),
    "motive-csv 1.25": motive("1.25"),
    "motive-csv saved by a German Excel": motive("1.25", ";", ","),
    "qtm-tsv": qtm(),
    "qtm-tsv decimal commas": qtm(","),
    "qtm-tsv without column names": qtm(bare=True),
    "trc": trc(),
    "trc decimal commas": trc(","),
}
ENCODINGS = {"utf-8": "\n", "utf-8-sig": "\r\n", "utf-16": "\r\n", "utf-16-le": "\n"}


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_in_every_encoding(name: str, encoding: str, tmp_path: Path):
    text = DIALECTS[name].replace("\r\n", "\n").replace("\n", ENCODINGS[encoding])
    (tmp_path / "take").write_bytes(text.encode(encoding))
    log = MARKER_READERS[name.split()[0]](tmp_path / "take")
    assert [known.rpartition(":")[2] for known in log.names] == ["a", "b"]
    same(log)
    assert log.unit_said


@pytest.mark.parametrize("name", ["vicon-csv", "motive-csv", "trc"])
def test_a_header_without_unit_leaves_it_open(name: str, tmp_path: Path):
    text = {"vicon-csv": vicon(",", units=""), "motive-csv": motive("1.25", unit=None), "trc": trc(unit="")}[name]
    (tmp_path / "take").write_text(text, encoding="utf-8")
    log = MARKER_READERS[name](tmp_path / "take")
    assert not log.unit_said
    same(log, unit=1.0, atol=1e-4)


def test_objects_beside_the_trajectories_of_tracker(tmp_path: Path):
    turns = pd.DataFrame(np.tile([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5), 10.0, 20.0, 30.0], (COUNT, 1)))
    lead = pd.DataFrame({"frame": np.arange(1, COUNT + 1), "sub": 0})
    objects = "Objects\n100\n,,s:s,,,,,,\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ\n,,,,,,mm,mm,mm\n"
    objects += text_of(pd.concat([lead, turns], axis=1), ",")
    (tmp_path / "take").write_text(objects + "\n" + vicon(","), encoding="utf-8")
    log = MARKER_READERS["vicon-csv"](tmp_path / "take")
    same(log)
    (body,) = log.bodies
    assert body.positions[5] == pytest.approx([0.01, 0.02, 0.03])
    assert body.rotations[5] @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1.0), ("m", 1e-3)])
def test_what_ezc3d_writes(unit: str, scale: float, tmp_path: Path):
    ezc3d = pytest.importorskip("ezc3d", reason="the independent writer of C3D files is missing")
    pytest.importorskip("c3d", reason="the extra c3d is missing")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["s:a", "s:b"]
    points = np.ones((4, 2, COUNT))
    points[:3] = scale * PLACES.transpose(2, 1, 0)
    file["data"]["points"] = points
    file.write(str(tmp_path / "take.c3d"))
    log = MARKER_READERS["c3d"](tmp_path / "take.c3d")
    assert log.names == ("s:a", "s:b")
    same(log, atol=1e-6)  # 32-bit floats


def test_labels_beyond_those_that_one_parameter_of_c3d_holds(tmp_path: Path):
    ezc3d = pytest.importorskip("ezc3d", reason="the independent writer of C3D files is missing")
    pytest.importorskip("c3d", reason="the extra c3d is missing")
    names = [f"m{k}" for k in range(600)]
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = names
    file["data"]["points"] = np.ones((4, len(names), COUNT))
    file.write(str(tmp_path / "take.c3d"))
    log = MARKER_READERS["c3d"](tmp_path / "take.c3d")
    assert list(log.names) == names
    assert log.unlabelled is None


@pytest.mark.parametrize("lead", ["", "Frame\t", "Frame\tTime\t"])
@pytest.mark.parametrize("named", [True, False])
def test_residuals_behind_the_places_of_qualisys(named: bool, lead: str, tmp_path: Path):
    markers = ["a", "b", "c", "d"]
    head = [f"FREQUENCY\t{RATE:g}", "DATA_INCLUDED\t3D", "\t".join(["MARKER_NAMES", *markers])]
    head += [lead + "\t".join(f"{m} {what}" for m in markers for what in ("X", "Y", "Z", "Residual"))] * named
    rows: list[str] = []
    for k, places in enumerate(PLACES):
        cells = [f"{k + 1}", f"{k / RATE:.5f}"][: lead.count("\t")]
        cells += [f"{value:.4f}" for place in (*places, *places) for value in (*place, 0.7)]
        rows.append("\t".join(cells))
    (tmp_path / "take").write_text("\r\n".join([*head, *rows]), encoding="utf-8")
    log = MARKER_READERS["qtm-tsv"](tmp_path / "take")
    assert log.names == tuple(markers)
    np.testing.assert_allclose(log.positions, 1e-3 * np.concatenate([PLACES, PLACES], axis=1), atol=1e-7)


@pytest.mark.parametrize("kind", [kind for kind in MARKER_READERS if kind not in {"csv", "mcap", "ros2-bag"}])
def test_an_empty_file_is_called_empty(kind: str, tmp_path: Path):
    if kind == "c3d":
        pytest.importorskip("c3d", reason="the extra c3d is missing")
    (tmp_path / "take").write_bytes(b"")
    with pytest.raises(FileError, match="is empty"):
        MARKER_READERS[kind](tmp_path / "take")


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_what_rosbags_writes(storage: str, tmp_path: Path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="the extra ros is missing")
    typesys = pytest.importorskip("rosbags.typesys", reason="the extra ros is missing")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = store.types
    plugin = rosbag2.StoragePlugin.SQLITE3 if storage == "sqlite3" else rosbag2.StoragePlugin.MCAP
    name = "geometry_msgs/msg/PointStamped"
    with rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=plugin) as writer:
        topics = {m: writer.add_connection(f"/marker/{m}", name, typestore=store) for m in "ab"}
        for k in range(COUNT):
            nanoseconds = 1_700_000_000_000_000_000 + 10_000_000 * k
            stamp = kinds["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
            head = kinds["std_msgs/msg/Header"](stamp, "world")
            for place, topic in zip(1e-3 * PLACES[k], topics.values(), strict=True):
                message = kinds[name](head, kinds["geometry_msgs/msg/Point"](*map(float, place)))
                writer.write(topic, nanoseconds + 3_000_000, store.serialize_cdr(message, name))
    log = read_bag(tmp_path / "bag")
    assert len(log.names) == 2
    same(log)


@pytest.mark.parametrize("name", DIALECTS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_cells_are_read_or_are_a_sentence(name: str, tmp_path: Path, data: st.DataObject):
    lines = DIALECTS[name].split("\n")
    at = data.draw(st.integers(0, len(lines) - 1))
    cells = data.draw(
        st.lists(st.sampled_from(["", "1,5", "1.5", "x", "\t", ";", '"', "nan", "1e999", "٣"]), max_size=9)
    )
    lines[at] = data.draw(st.sampled_from(["\t", ",", ";", " "])).join(cells)
    (tmp_path / "take").write_text("\n".join(lines), encoding="utf-8")
    with contextlib.suppress(FileError):
        log = MARKER_READERS[name.split()[0]](tmp_path / "take")
        assert (np.diff(log.t) > 0.0).all()
        assert log.positions.shape == (len(log.t), len(log.names), 3)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_tables_are_read_or_are_a_sentence(tmp_path: Path, data: st.DataObject):
    times = TIMES[data.draw(st.sampled_from([*TIMES]))]
    text = frame(times).to_csv(index=False, sep=data.draw(st.sampled_from(",;\t"))).encode()
    at = data.draw(st.integers(0, len(text)))
    spoilt = text[:at] + data.draw(st.binary(max_size=12)) + text[at + data.draw(st.integers(0, 40)) :]
    (tmp_path / "take.csv").write_bytes(spoilt)
    (tmp_path / "map.toml").write_text(MAP, encoding="utf-8")
    with contextlib.suppress(FileError):
        assert (np.diff(read_mapped(tmp_path / "take.csv", tmp_path / "map.toml").t) > 0.0).all()
