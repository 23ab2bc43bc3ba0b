"""What drivers of motion capture publish in ROS 2, written by rosbags, with definitions of their types and without."""

import contextlib
import json
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidim_lab.data.importers.reading.messages import sightings
from fidim_lab.data.importers.ros_bag import read_bag
from fidim_lab.errors import FileError

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="the extra ros is missing")
typesys = pytest.importorskip("rosbags.typesys", reason="the extra ros is missing")

COUNT, RATE = 40, 100.0
PLACES = np.random.default_rng(4).uniform(-1.5, 1.5, (COUNT, 3, 3))
"""m"""
TURN = (0.0, 0.0, 0.6, 0.8)
DEFINED = {
    "mocap4r2_msgs/msg/Marker": (
        "int8 USE_NAME=0\nint8 USE_INDEX=1\nint8 USE_BOTH=2\nint8 id_type\nint32 marker_index\nstring marker_name\n"
        "geometry_msgs/Point translation\n"
    ),
    "mocap4r2_msgs/msg/Markers": "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/Marker[] markers\n",
    "mocap4r2_msgs/msg/RigidBody": (
        "string rigid_body_name\nmocap4r2_msgs/Marker[] markers\ngeometry_msgs/Pose pose\n"
    ),
    "mocap4r2_msgs/msg/RigidBodies": (
        "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/RigidBody[] rigidbodies\n"
    ),
    "vicon_receiver/msg/Position": (
        "float32 x_trans\nfloat32 y_trans\nfloat32 z_trans\nfloat32 x_rot\nfloat32 y_rot\nfloat32 z_rot\nfloat32 w\n"
        "string segment_name\nstring subject_name\nint32 frame_number\nstring translation_type\n"
    ),
    "motion_capture_tracking_interfaces/msg/NamedPose": "string name\ngeometry_msgs/Pose pose\n",
    "motion_capture_tracking_interfaces/msg/NamedPoseArray": (
        "std_msgs/Header header\nmotion_capture_tracking_interfaces/NamedPose[] poses\n"
    ),
    "lab_msgs/msg/Platform": "std_msgs/Header header\ngeometry_msgs/Point place\n",
}


class Made:
    """Messages of rosbags' own types."""

    def __init__(self) -> None:
        self.store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        for name, text in DEFINED.items():
            self.store.register(typesys.get_types_from_msg(text, name))

    def __call__(self, name: str, *values: Any) -> Any:
        return self.store.types[name](*values)

    def header(self, k: int) -> Any:
        whole = 1_700_000_000_000_000_000 + 10_000_000 * k
        stamp = self("builtin_interfaces/msg/Time", whole // 10**9, whole % 10**9)
        return self("std_msgs/msg/Header", stamp, "world")

    def point(self, place: np.ndarray) -> Any:
        return self("geometry_msgs/msg/Point", *map(float, place))

    def pose(self, place: np.ndarray) -> Any:
        return self("geometry_msgs/msg/Pose", self.point(place), self("geometry_msgs/msg/Quaternion", *TURN))

    def marker(self, name: str, index: int, place: np.ndarray) -> Any:
        return self("mocap4r2_msgs/msg/Marker", 2, index, name, self.point(place))

    def cloud(self, k: int, kind: str, order: str, padding: int) -> Any:
        code, size = {"f": (7, 4), "d": (8, 8)}[kind]
        step = 3 * size + 4 + padding
        fields = [("intensity", 0, 7, 1), *(("xyz"[axis], 4 + axis * size, code, 1) for axis in range(3))]
        data = b"".join(
            struct.pack(f"{order}f3{kind}", 0.5, *place) + bytes(padding) for place in [*PLACES[k], [np.nan] * 3]
        )
        named = [self("sensor_msgs/msg/PointField", *field) for field in fields]
        return self(
            "sensor_msgs/msg/PointCloud2", self.header(k), 1, 4, named, order == ">", step, 4 * step,
            np.frombuffer(data, dtype=np.uint8), True,
        )  # fmt: skip


def bag(folder: Path, name: str, message: Callable[[Made, int], Any], *, defined: bool) -> Path:
    """A bag of one topic; without definitions as ROS 2 Humble writes it."""
    made = Made()
    plugin = rosbag2.StoragePlugin.MCAP if defined else rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(folder / "bag", version=9 if defined else 8, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/mocap", name, typestore=made.store)
        for k in range(COUNT):
            data = made.store.serialize_cdr(message(made, k), name)
            writer.write(topic, 1_700_000_000_000_000_000 + 10_000_000 * k, data)
    for database in () if defined else (folder / "bag").glob("*.db3"):
        with contextlib.closing(sqlite3.connect(database)) as connection:
            connection.execute("DROP TABLE IF EXISTS message_definitions")
    return folder / "bag"


def markers(made: Made, k: int) -> Any:
    found = [made.marker(name, 0, place) for name, place in zip("abc", PLACES[k], strict=True)]
    return made("mocap4r2_msgs/msg/Markers", made.header(k), k, found)


def nameless(made: Made, k: int) -> Any:
    return made("mocap4r2_msgs/msg/Markers", made.header(k), k, [made.marker("", -1, place) for place in PLACES[k]])


def bodies(made: Made, k: int) -> Any:
    two = [
        made("mocap4r2_msgs/msg/RigidBody", name, [made.marker("", 1, place)], made.pose(place))
        for name, place in zip(("plate", "hand"), PLACES[k], strict=False)
    ]
    return made("mocap4r2_msgs/msg/RigidBodies", made.header(k), k, two)


def vicon(made: Made, k: int) -> Any:
    return made("vicon_receiver/msg/Position", *(1e3 * PLACES[k, 0]), *TURN, "plate", "plate", k, "Global")


def named_poses(made: Made, k: int) -> Any:
    one = made("motion_capture_tracking_interfaces/msg/NamedPose", "plate", made.pose(PLACES[k, 0]))
    return made("motion_capture_tracking_interfaces/msg/NamedPoseArray", made.header(k), [one])


@pytest.mark.parametrize("defined", [True, False])
@pytest.mark.parametrize("message", [markers, nameless])
def test_markers(message: Callable[[Made, int], Any], defined: bool, tmp_path: Path):
    log = read_bag(bag(tmp_path, "mocap4r2_msgs/msg/Markers", message, defined=defined))
    assert len(log.names) == 3
    np.testing.assert_allclose(log.positions, PLACES)


@pytest.mark.parametrize("defined", [True, False])
def test_rigid_bodies_and_the_markers_of_each(defined: bool, tmp_path: Path):
    log = read_bag(bag(tmp_path, "mocap4r2_msgs/msg/RigidBodies", bodies, defined=defined))
    assert [body.name for body in log.bodies] == ["plate", "hand"]
    np.testing.assert_allclose(log.positions, PLACES[:, :2])
    np.testing.assert_allclose(log.bodies[1].positions, PLACES[:, 1])


@pytest.mark.parametrize("defined", [True, False])
def test_vicons_own_positions_leave_their_unit_open(defined: bool, tmp_path: Path):
    log = read_bag(bag(tmp_path, "vicon_receiver/msg/Position", vicon, defined=defined))
    (body,) = log.bodies
    assert body.name == "plate"
    assert not log.unit_said
    np.testing.assert_allclose(body.positions, 1e3 * PLACES[:, 0], rtol=1e-5)
    assert body.rotations[3] @ [1.0, 0.0, 0.0] == pytest.approx([0.28, 0.96, 0.0], abs=1e-6)


@pytest.mark.parametrize("defined", [True, False])
def test_named_poses(defined: bool, tmp_path: Path):
    name = "motion_capture_tracking_interfaces/msg/NamedPoseArray"
    (body,) = read_bag(bag(tmp_path, name, named_poses, defined=defined)).bodies
    assert body.name == "plate"
    np.testing.assert_allclose(body.positions, PLACES[:, 0])


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("kind", "fd")
def test_clouds_of_markers(kind: str, order: str, padding: int, tmp_path: Path):
    made = Made()
    assert made.cloud(0, kind, order, padding).point_step == (16 if kind == "f" else 28) + padding
    log = read_bag(
        bag(tmp_path, "sensor_msgs/msg/PointCloud2", lambda m, k: m.cloud(k, kind, order, padding), defined=False)
    )
    np.testing.assert_allclose(log.positions, PLACES, rtol=1e-6)


def test_clouds_of_foxglove_and_in_whole_numbers():
    data = b"".join(struct.pack("<4i", *place, 9) for place in ([1, -2, 3], [4, 5, -6]))
    fields = [{"name": axis, "offset": 4 * k, "type": 6} for k, axis in enumerate("xyz")]
    pose = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    cloud = {"pose": pose, "point_stride": 16, "fields": fields, "data": data}
    assert [found.place for found in sightings(cloud)] == [(1.0, -2.0, 3.0), (4.0, 5.0, -6.0)]


def test_a_scanners_cloud_hides_no_pose(tmp_path: Path):
    made = Made()
    one = made.cloud(0, "f", "<", 0)
    scan = {"width": 4000, "height": 1, "point_step": one.point_step, "row_step": 0, "data": bytes(4000 * 16)}
    scan |= {"fields": [{"name": f.name, "offset": f.offset, "datatype": f.datatype} for f in one.fields]}
    assert not list(sightings(scan))


def test_what_was_not_seen_is_not_at_its_old_place():
    seen = {"marker_name": "a", "occluded": False, "translation": {"x": 1.0, "y": 2.0, "z": 3.0}}
    message: dict[str, object] = {"markers": [seen, seen | {"marker_name": "b", "occluded": True}]}
    message["bodies"] = [{"id": 1, "tracking_valid": False, "position": {"x": 0.0, "y": 0.0, "z": 0.0}}]
    assert [found.name for found in sightings(message)] == ["a"]


def test_a_type_that_nobody_defines_is_named(tmp_path: Path):
    folder = bag(
        tmp_path,
        "lab_msgs/msg/Platform",
        lambda made, k: made("lab_msgs/msg/Platform", made.header(k), made.point(PLACES[k, 0])),
        defined=False,
    )
    with pytest.raises(FileError, match=r"/mocap: lab_msgs/msg/Platform, whose definition.*ros2 bag convert"):
        read_bag(folder)


def test_a_type_without_places_is_named(tmp_path: Path):
    name = "std_msgs/msg/String"
    folder = bag(tmp_path, name, lambda made, k: made(name, json.dumps([k])), defined=True)
    with pytest.raises(FileError, match="/mocap: std_msgs/msg/String holds no point and no pose"):
        read_bag(folder)


STILL = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


@pytest.mark.parametrize("beside", [{}, {"pose": STILL}, {"channels": []}], ids=["cloud", "marker", "old cloud"])
def test_few_points_in_a_list_are_places(beside: dict[str, object]):
    """sensor_msgs/PointCloud, geometry_msgs/Polygon, visualization_msgs/Marker, and messages of one's own."""
    points = [{"x": float(k), "y": 2.0, "z": 3.0} for k in range(4)]
    assert [(one.name, one.place[0]) for one in sightings({"points": points} | beside)] == [
        (str(k), float(k)) for k in range(4)
    ]
    numbered = [point | {"id": 7 + k} for k, point in enumerate(points)]
    assert [one.name for one in sightings({"points": numbered} | beside)] == ["7", "8", "9", "10"]
    unseen = [points[0], points[1] | {"x": float("nan")}, points[2]]
    assert [one.name for one in sightings({"points": unseen} | beside)] == ["0", "2"]


def test_a_pose_beside_points_is_read_where_it_moves():
    pose = STILL | {"position": {"x": 1.0, "y": 0.0, "z": 0.0}}
    (one,) = sightings({"pose": pose, "points": [{"x": 0.0, "y": 2.0, "z": 3.0}]})
    assert one.quaternion is not None


def test_clouds_of_points_in_a_bag(tmp_path: Path):
    def cloud(made: Made, k: int) -> Any:
        points = [made("geometry_msgs/msg/Point32", *map(float, place)) for place in PLACES[k]]
        return made("sensor_msgs/msg/PointCloud", made.header(k), points, [])

    log = read_bag(bag(tmp_path, "sensor_msgs/msg/PointCloud", cloud, defined=True))
    np.testing.assert_allclose(log.positions, PLACES, rtol=1e-6)


def arrivals(folder: Path, late: np.ndarray, *, apart: bool) -> Path:
    """Points without stamps, (N, 3) s late: on a topic each, or all in one message."""
    made = Made()
    name = "geometry_msgs/msg/Point" if apart else "geometry_msgs/msg/Polygon"
    with rosbag2.Writer(folder / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        topics = [writer.add_connection(f"/m{m}", name, typestore=made.store) for m in range(3 if apart else 1)]
        for k in range(COUNT):
            points = [made("geometry_msgs/msg/Point32", *map(float, place)) for place in PLACES[k]]
            one = [{"point": place} for place in PLACES[k]] if apart else [made(name, points)]
            for m, topic in enumerate(topics):
                message = made.point(one[m]["point"]) if apart else one[0]
                arrived = 1_700_000_000_000_000_000 + int(1e9 * (k / RATE + late[k, m]))
                writer.write(topic, arrived, made.store.serialize_cdr(message, name))
    return folder / "bag"


def test_times_of_arrival_are_the_cause_that_is_told(tmp_path: Path):
    """Not that one topic of one place is too little, nor that things of one message had stamps of their own."""
    late = np.abs(np.random.default_rng(3).normal(0.0, 4e-3, (COUNT, 3)))
    with pytest.raises(FileError, match="not in even steps"):
        read_bag(arrivals(tmp_path, late, apart=False))
