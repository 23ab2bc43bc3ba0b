"""Dialects of older and odd programs, and what people do to files: read right, or refused with the true cause."""

import gzip
import io
import pickle
import re
import shutil
from collections.abc import Callable
from copy import copy
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import write_robot

from .conftest import FROM_Z_UP, Swing

COLUMNS = [f"p{m}{axis}" for m in range(5) for axis in "xyz"]
MAP = 'format = "fidim-columns/1"\ntime = "time"\n' + "".join(
    f'[[marker]]\nname = "p{m}"\ncolumns = ["p{m}x", "p{m}y", "p{m}z"]\n' for m in range(5)
)


def cells(values: np.ndarray) -> list[str]:
    return [",".join(f"{x:.5f}" for x in row) for row in values.reshape(len(values), -1)]


def joined(lines: list[str], end: str = "\n") -> str:
    return "".join(line + end for line in lines)


def nexus_1(swing: Swing, unit: str = "") -> str:
    """Rows begin with a field's number; there are no sub-frames, and units only in some exports."""
    head = ["TRAJECTORIES", "100.000000,Hz", "," + ",,,".join(f"body:{m}" for m in range(5)), "Field #" + ",X,Y,Z" * 5]
    head += ["," + ",".join([unit] * 15)] if unit else []
    return joined(
        ["EVENTS", "Device,Time", "", *head, *(f"{k + 1},{row}" for k, row in enumerate(cells(1e3 * swing.markers)))]
    )


def nexus_2(swing: Swing, *, rate: str = "100", unit: str = "mm", scale: float = 1e3) -> list[str]:
    head = ["Trajectories", rate, ",," + ",,,".join(f"body:{m}" for m in range(5)), "Frame,Sub Frame" + ",X,Y,Z" * 5]
    head.append(",," + ",".join([unit] * 15))
    return head + [f"{k + 1},0,{row}" for k, row in enumerate(cells(scale * swing.markers))]


def motive(
    swing: Swing, *, timecode: bool = False, labels: bool = True, rotation: str = "Quaternion", sign: int = 1
) -> str:
    """Two things: a rigid body with angles, and the markers that the cameras saw."""
    spare = [""] if timecode else []
    types = ["Rigid Body"] * 6 + ["Marker"] * 15
    names = ["plate"] * 6 + [f"plate:{m}" for m in range(5) for _ in "xyz"]
    what = ["Rotation"] * 3 + ["Position"] * 18
    rows = [f"Format Version,1.24,Export Frame Rate,100.0,Rotation Type,{rotation},Length Units,Meters", ""]
    for label, row in (("Type", types), ("Name", names), ("", what)):
        rows.append(",".join(["", label if labels else "", *spare, *row]))
    rows.append(",".join(["Frame", "Time (Seconds)", *(["TimeCode"] if timecode else []), *"XYZ" * 7]))
    places = (swing.markers * [1, sign, 1]) @ FROM_Z_UP["y"].T
    body = np.concatenate([np.zeros((len(places), 1, 3)), places[:, :1], places], axis=1)
    for k, row in enumerate(cells(body)):
        code = f",12:00:{k // 100:02d}:{k % 100 // 4:02d}.00" if timecode else ""
        rows.append(f"{k},{k / 100:.4f}{code},{row}")
    return joined(rows, "\r\n")


def table(
    swing: Swing, form: str | None = None, *, turn: np.ndarray | None = None, shift: np.ndarray | None = None
) -> list[str]:
    places = 1e3 * swing.markers - (0.0 if shift is None else shift)
    places = places if turn is None else places @ turn.T
    began = datetime(2026, 3, 1, 9, 59, 58)
    stamps = [f"{t:.3f}" if form is None else f"{began + timedelta(seconds=float(t)):{form}}" for t in swing.t]
    return [",".join(["time", *COLUMNS]), *(f"{t},{row}" for t, row in zip(stamps, cells(places), strict=True))]


def colons(swing: Swing) -> str:
    return joined(
        [
            line.replace(".", ":", 1)[:12] + line[15:] if k else line
            for k, line in enumerate(table(swing, "%H:%M:%S.%f"))
        ]
    )


def at_rest(swing: Swing) -> Swing:
    """A static trial: the first place, with noise."""
    still = copy(swing)
    still.markers = swing.markers[:1] + 1e-4 * np.random.default_rng(6).normal(size=swing.markers.shape)
    return still


def thousands(swing: Swing, decimal: str) -> str:
    """Marks between thousands, an index, an event now and then, and a delimiter at each line's end."""
    marks = str.maketrans(",.", ".,") if decimal == "," else {}
    names = [f"p{m}{axis}" for m in range(5) for axis in "xyz"]
    rows = ["\t".join(["", "time", *names, "event", ""])]
    for k, (t, places) in enumerate(zip(swing.t, 1e3 * swing.markers.reshape(len(swing.t), -1), strict=True)):
        numbers = [f"{x:,.4f}".translate(marks) for x in (t, *places)]
        rows.append("\t".join([str(k), *numbers, "let go" if k == 100 else "", ""]))
    return joined(["# one take", *rows[:200], "# a remark", *rows[200:]])


HEADING = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""y upwards, with the robot's x as z"""
LEVELLED, AWAY = Rotation.from_rotvec([0.0, 0.0, 40.0], degrees=True).as_matrix(), np.array([500.0, -300.0, 200.0])
"""of a motion capture's own frame, that is turned and shifted so into the robot's, mm"""
OBLIQUE = np.array([[0.8, -0.48, 0.36], [0.6, 0.64, -0.48], [0.0, 0.6, 0.8]])
DOWNWARDS = np.diag([1.0, -1.0, -1.0])


READ: dict[str, tuple[str, Callable[[Swing], str]]] = {
    "Nexus 1": ("vicon-csv", nexus_1),
    "Nexus 1 with units": ("vicon-csv", lambda swing: nexus_1(swing, "mm")),
    "lines ended twice": ("vicon-csv", lambda swing: joined(nexus_2(swing), "\r\r\n")),
    "centimetres": ("vicon-csv", lambda swing: joined(nexus_2(swing, unit="cm", scale=1e2))),
    "rate with its unit": ("vicon-csv", lambda swing: joined(nexus_2(swing, rate="100 Hz"))),
    "time codes": ("motive-csv", lambda swing: motive(swing, timecode=True, rotation="XYZ")),
    "rows without labels": ("motive-csv", lambda swing: motive(swing, labels=False, rotation="XYZ")),
    "angles beside markers": ("motive-csv", lambda swing: motive(swing, rotation="XYZ")),
    "ISO without signs": ("csv", lambda swing: joined(table(swing, "%Y%m%dT%H%M%S.%f"))),
    "a row twice": ("csv", lambda s: joined([*table(s)[:300], *table(s)[299:]])),
    "rows in another order": ("csv", lambda s: joined([*table(s)[:300], *table(s)[310:299:-1], *table(s)[311:]])),
    "slashes, year first": ("csv", lambda swing: joined(table(swing, "%Y/%m/%d %H:%M:%S.%f"))),
    "milliseconds behind a colon": ("csv", colons),
    "thousands with commas": ("csv", lambda swing: thousands(swing, ".")),
    "thousands with points": ("csv", lambda swing: thousands(swing, ",")),
    "another heading": ("csv", lambda swing: joined(table(swing, turn=HEADING))),
    "z downwards": ("csv", lambda swing: joined(table(swing, turn=DOWNWARDS))),
}
MIRROR = np.diag([1.0, -1.0, 1.0])
EXCHANGED = np.eye(3)[[1, 0, 2]]
REFUSED: dict[str, tuple[str, Callable[[Swing], str], str]] = {
    "two blocks": ("vicon-csv", lambda s: joined([*nexus_2(s), "", *nexus_2(s)]), "a second block Trajectories"),
    "two takes": ("vicon-csv", lambda s: joined(nexus_2(s) + nexus_2(s)[5:]), "Where a file has two takes"),
    "two tables": ("csv", lambda s: joined(table(s) + table(s)[1:]), "Where a file has two takes"),
    "another row at a time": (
        "csv",
        lambda s: joined([*table(s)[:300], table(s)[299] + "1", *table(s)[300:]]),
        "sample 300 has the same time as the one before, but other numbers. Delete the wrong",
    ),
    "day or month": ("csv", lambda s: joined(table(s, "%m/%d/%Y %H:%M:%S.%f")), "Write dates with the year first"),
    "a mirrored axis": ("csv", lambda s: joined(table(s, turn=MIRROR)), "mirror image"),
    "axes exchanged": ("csv", lambda s: joined(table(s, turn=EXCHANGED)), "mirror image"),
    "a mirrored take": ("motive-csv", lambda s: motive(s, rotation="XYZ", sign=-1), "mirror image"),
    "another frame": (
        "csv",
        lambda s: joined(table(s, turn=OBLIQUE)),
        "frame is not the robot's",
    ),
    "a platform at rest": ("csv", lambda s: joined(table(at_rest(s))), "stands still"),
    "nothing": ("vicon-csv", lambda s: " \r\n", "is empty"),
}


def imported(swing: Swing, folder: Path, kind: str, data: bytes, *options: str, columns: str = MAP) -> tuple[int, str]:
    """Exit code, and all that was said."""
    write_robot(folder / "robot.toml", swing.robot)
    (folder / "take").write_bytes(data)
    (folder / "map.toml").write_text(columns, encoding="utf-8")
    arguments = [kind, str(folder / "take"), "--robot", str(folder / "robot.toml"), "--out", str(folder / "out")]
    arguments += ["--map", str(folder / "map.toml")] if kind == "csv" else []
    done = CliRunner().invoke(fidim, ["import", *arguments, *options])
    return done.exit_code, " ".join(f"{done.output} {done.exception or ''}".split())


@pytest.mark.parametrize("name", READ)
def test_dialects_are_read(name: str, swing: Swing, tmp_path: Path):
    kind, write = READ[name]
    code, said = imported(swing, tmp_path, kind, write(swing).encode())
    assert code == 0, said
    windows = read_campaign(tmp_path / "out").windows
    assert sum(window.t[-1] - window.t[0] for window in windows) > 15.0
    for window in windows:
        off = window.markers - swing.markers[np.rint(window.t * 100).astype(int)]
        assert np.nanmax(np.abs(off)) < 3e-4, said


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_meant_is_refused_with_its_cause(name: str, swing: Swing, tmp_path: Path):
    kind, write, cause = REFUSED[name]
    code, said = imported(swing, tmp_path, kind, write(swing).encode())
    assert code != 0
    assert cause in said


def crowded(swing: Swing) -> tuple[str, str]:
    """A table with eight more markers than the platform's, whose unit nothing says, and its map."""
    lines, names = table(swing), [f"p{m}" for m in range(5, 13)]
    lines[0] += "".join(f",{name}{axis}" for name in names for axis in "xyz")
    lines[1:] = [line + "".join(f",{10 * k},{k}{k},5" for k in range(8)) for line in lines[1:]]
    more = "".join(f'[[marker]]\nname = "{n}"\ncolumns = ["{n}x", "{n}y", "{n}z"]\n' for n in names)
    return joined(lines), MAP + more


@pytest.mark.parametrize(
    ("order", "cause"), [("p0,p1,p2,p3,p4", ""), ("p1,p0,p2,p3,p4", "Give --order p0,p1,p2,p3,p4")]
)
def test_a_stated_order_tells_the_unit_and_is_checked(order: str, cause: str, swing: Swing, tmp_path: Path):
    text, columns = crowded(swing)
    code, said = imported(swing, tmp_path, "csv", text.encode(), "--order", order, columns=columns)
    assert code == (1 if cause else 0), said
    assert (cause or "lengths in mm") in said


def test_one_file_for_each_marker_is_told_to_be_joined(swing: Swing, tmp_path: Path):
    columns = MAP[: MAP.index("[[marker]]", MAP.index("[[marker]]") + 1)]
    code, said = imported(swing, tmp_path, "csv", joined(table(swing)).encode(), columns=columns)
    assert code == 1
    assert "Put all markers of a take side by side into one file" in said


def test_a_foreign_frame_is_named_and_read_by_someone_who_knows_it(swing: Swing, tmp_path: Path):
    """Cables that stretch look like a wrong frame."""
    assert imported(swing, tmp_path, "csv", joined(table(swing)).encode())[0] == 0
    free = max(read_campaign(tmp_path / "out").windows, key=lambda window: len(window.t))
    begin, end = np.rint(free.t[[0, -1]] * 100).astype(int)
    lines = table(swing, turn=LEVELLED.T, shift=AWAY)
    text = joined([lines[0], *lines[1:][begin:end]]).encode()
    shutil.rmtree(tmp_path / "out")
    code, said = imported(swing, tmp_path, "csv", text)
    assert code == 1
    shutil.rmtree(tmp_path / "out")
    turn, shift = re.search(r"turned by (\S+)° about \(.*, 1.00\) and shifted by \((.*?)\) mm", said).groups()
    assert float(turn) == pytest.approx(40.0, abs=2.0)
    assert [float(x) for x in shift.split(",")] == pytest.approx(list(AWAY), abs=150.0)  # one window of small swings
    code, said = imported(swing, tmp_path, "csv", joined(lines).encode(), "--up", "z")
    assert code == 0, said
    assert "frame is not the robot's" in said


def packed(values: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.savez(out, values)
    return out.getvalue()


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (packed(np.eye(3)), "a ZIP"),
        (pickle.dumps({"t": [0.0]}), "a pickle of Python"),
        (gzip.compress(b"time,x", mtime=0), "packed with gzip"),
        (b"\x89HDF\r\n\x1a\n" + bytes(40), "HDF5"),
        (b"PAR1" + bytes(40), "a Parquet file"),
        (b"#ROSBAG V2.0\n", "a bag of ROS 1"),
    ],
    ids=["zip", "pickle", "gzip", "hdf5", "parquet", "rosbag"],
)
@pytest.mark.parametrize("kind", ["csv", "trc"])
def test_files_that_are_no_text_are_named(data: bytes, what: str, kind: str, swing: Swing, tmp_path: Path):
    code, said = imported(swing, tmp_path, kind, data)
    assert code != 0
    assert f"is {what}" in said
