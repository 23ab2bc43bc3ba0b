"""Spoilt, foreign and made-up binary files end in a FileError of a sentence, never in anything else."""

import io
import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from fidim_lab.data.importers.c3d_file import read_c3d
from fidim_lab.data.importers.qtm_mat import read_qtm_mat
from fidim_lab.data.importers.reading.messages import sightings
from fidim_lab.data.importers.ros_bag import read_bag
from fidim_lab.errors import FileError

LONGEST = 500
"""characters of a message"""
ANY = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def mcap(messages: list[object], encoding: str = "json") -> bytes:
    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    schema = writer.register_schema("Pose", "jsonschema", b"position")
    channel = writer.register_channel("/pose", encoding, schema)
    for k, message in enumerate(messages):
        writer.add_message(channel, 10_000_000 * k, json.dumps(message).encode(), 10_000_000 * k)
    writer.finish()
    return out.getvalue()


def poses(count: int = 40) -> list[object]:
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    return [{"pose": {"position": {"x": 0.1, "y": 0.2, "z": 0.01 * k}, "orientation": turn}} for k in range(count)]


def c3d(folder: Path) -> bytes:
    ezc3d = pytest.importorskip("ezc3d", reason="the independent writer of C3D files is missing")
    pytest.importorskip("c3d", reason="the extra c3d is missing")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["a", "b", "c"]
    file["data"]["points"] = np.random.default_rng(1).normal(size=(4, 3, 40))
    file.write(str(folder / "made.c3d"))
    return (folder / "made.c3d").read_bytes()


def qtm(folder: Path) -> bytes:
    labels = np.empty((1, 2), dtype=object)
    labels[0] = ["a", "b"]
    labelled = {"Labels": labels, "Data": np.ones((2, 4, 40))}
    bodies = {
        "Name": "b",
        "Positions": np.ones((1, 3, 40)),
        "Rotations": np.tile(np.eye(3).reshape(1, 9, 1), (1, 1, 40)),
    }
    table = {"FrameRate": 100.0, "Trajectories": {"Labeled": labelled}, "RigidBodies": bodies}
    scipy.io.savemat(folder / "made.mat", {"take": table})
    return (folder / "made.mat").read_bytes()


def bag(folder: Path) -> bytes:
    path = folder / "made.db3"
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        base.execute("INSERT INTO topics VALUES (1, '/point', 'geometry_msgs/msg/PointStamped', 'cdr')")
        for k in range(40):
            head = np.array([0, 10_000_000 * (k + 1), 2], "<u4").tobytes() + b"w\0\0\0"
            data = b"\0\1\0\0" + head + b"\0" * (-len(head) % 8) + np.array([1.0, 2.0, 0.1 * k]).tobytes()
            base.execute("INSERT INTO messages VALUES (?, 1, ?, ?)", (k + 1, 10_000_000 * k, data))
    base.close()
    return path.read_bytes()


READERS = {
    "mcap": (read_bag, lambda folder: mcap(poses())),
    "c3d": (read_c3d, c3d),
    "qtm-mat": (read_qtm_mat, qtm),
    "db3": (read_bag, bag),
}


def needs(name: str) -> None:
    if name == "db3":
        pytest.importorskip("rosbags.typesys", reason="the extra ros is missing")


@pytest.mark.parametrize("name", READERS)
def test_what_the_writers_made_is_read(name: str, tmp_path: Path):
    needs(name)
    read, make = READERS[name]
    path = tmp_path / "take"
    path.write_bytes(make(tmp_path))
    found = read(path)
    assert found.rate == pytest.approx(100.0)
    assert len(found.t) == 40


@pytest.mark.parametrize("name", READERS)
@ANY
@given(data=st.data())
def test_spoilt_bytes_are_read_or_are_a_sentence(name: str, tmp_path: Path, data: st.DataObject):
    needs(name)
    read, make = READERS[name]
    whole = make(tmp_path)
    at = data.draw(st.integers(0, len(whole)))
    spoilt = whole[:at] + data.draw(st.binary(max_size=12)) + whole[at + data.draw(st.integers(0, 40)) :]
    path = tmp_path / "take"
    path.write_bytes(spoilt if data.draw(st.booleans()) else spoilt[:at])
    try:
        read(path)
    except FileError as error:
        assert len(str(error)) < LONGEST  # noqa: PT017 - what is read is as good


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (mcap(poses(), "xml"), "encoded as 'xml'"),
        (mcap([{"text": "position"}] * 40), "no message with a point or a pose"),
        (mcap(poses(5)), "5 stamps"),
        (mcap([{"points": [{"position": {"x": 1, "y": 2, "z": 3}}] * 1200}] * 30), "more than 1000 points"),
        (b"#ROSBAG V2.0\n", "ROS 1"),
        (b"hello", "not an MCAP"),
        (b"SQLite format 3\0" + b"\0" * 100, "damaged"),
    ],
)
def test_bags_that_cannot_be_read_say_why(content: bytes, says: str, tmp_path: Path):
    path = tmp_path / "take"
    path.write_bytes(content)
    with pytest.raises(FileError, match=says):
        read_bag(path)


def test_a_database_made_to_run_for_ever_ends(tmp_path: Path):
    path = tmp_path / "bomb.db3"
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id, name, type, serialization_format)")
        base.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
            "SELECT id, 1 AS topic_id, 0 AS timestamp, x'00' AS data FROM n"
        )
    base.close()
    with pytest.raises(FileError, match="without topics and messages"):
        read_bag(path)


@ANY
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["x", "y", "z", "w", "position", "orientation", "header", "stamp", "sec"]), inner
            )
        ),
        max_leaves=12,
    )
)
def test_any_message_is_walked(message: object):
    assert all(len(found.place) == 3 for found in sightings(message))
