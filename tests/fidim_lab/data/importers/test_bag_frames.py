"""Transforms of bags, written by rosbags: chains of frames that stand or move, and several things on one topic."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from fidim_lab.data.importers.ros_bag import read_bag
from fidim_lab.errors import FileError

rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="the extra ros is missing")
typesys = pytest.importorskip("rosbags.typesys", reason="the extra ros is missing")

COUNT, BEGAN = 40, 1_770_000_000_000_000_000
STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
POINT, TF = "geometry_msgs/msg/PointStamped", "tf2_msgs/msg/TFMessage"
RNG = np.random.default_rng(8)


def moves() -> RigidTransform:
    """COUNT poses."""
    return RigidTransform.from_components(RNG.uniform(-1.0, 1.0, (COUNT, 3)), Rotation.random(COUNT, rng=RNG))


def stands() -> RigidTransform:
    """One pose, COUNT times."""
    where, turn = RNG.uniform(-1.0, 1.0, 3), Rotation.random(rng=RNG).as_quat()
    return RigidTransform.from_components(np.tile(where, (COUNT, 1)), Rotation.from_quat(np.tile(turn, (COUNT, 1))))


class Bag:
    """One bag being written."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows: list[tuple[int, str, str, bytes]] = []

    def made(self, name: str, *values: object) -> object:
        return STORE.types[name](*values)

    def header(self, at: int, frame: str) -> object:
        return self.made("std_msgs/msg/Header", self.made("builtin_interfaces/msg/Time", *divmod(at, 10**9)), frame)

    def transform(self, topic: str, at: int, parent: str, child: str, pose: RigidTransform) -> None:
        where = self.made("geometry_msgs/msg/Vector3", *map(float, pose.translation))
        turn = self.made("geometry_msgs/msg/Quaternion", *map(float, pose.rotation.as_quat()))
        one = self.made("geometry_msgs/msg/Transform", where, turn)
        stamped = self.made("geometry_msgs/msg/TransformStamped", self.header(at, parent), child, one)
        self.rows.append((at, topic, TF, STORE.serialize_cdr(self.made(TF, [stamped]), TF)))

    def point(self, topic: str, at: int, frame: str, place: np.ndarray) -> None:
        message = self.made(POINT, self.header(at, frame), self.made("geometry_msgs/msg/Point", *map(float, place)))
        self.rows.append((at, topic, POINT, STORE.serialize_cdr(message, POINT)))

    def written(self) -> Path:
        kinds = {topic: kind for _, topic, kind, _ in self.rows}
        with rosbag2.Writer(self.folder, version=9) as writer:
            topics = {name: writer.add_connection(name, kind, typestore=STORE) for name, kind in kinds.items()}
            for at, topic, _, data in sorted(self.rows, key=lambda row: row[0]):
                writer.write(topics[topic], at, data)
        return self.folder


def stamp(k: int, rate: int = 100) -> int:
    return BEGAN + k * 10**9 // rate


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kinds=st.lists(st.sampled_from(["stands once", "stands", "moves"]), min_size=1, max_size=4), slash=st.booleans())
def test_a_body_is_read_in_every_frame_above_it(
    kinds: list[str], slash: bool, tmp_path_factory: pytest.TempPathFactory
):
    bag = Bag(tmp_path_factory.mktemp("frames") / "bag")
    poses = [moves(), *(moves() if kind == "moves" else stands() for kind in kinds)]
    for number, (kind, pose) in enumerate(zip(["moves", *kinds], poses, strict=True)):
        child, parent = "plate" if number == 0 else f"f{number}", f"{'/' * slash}f{number + 1}"
        for k in range(1 if kind == "stands once" else COUNT):
            topic = "/tf_static" if kind == "stands once" else "/tf"
            bag.transform(topic, stamp(k) - (10**10 if kind == "stands once" else 0), parent, child, pose[k])
    read = [body for body in read_bag(bag.written()).bodies if body.name.endswith("plate")]
    assert [body.read_as for body in read] == [f"in frame f{n}" for n in range(1, len(poses) + 1)]
    placed = poses[0]
    for body, above in zip(read, [*poses[1:], None], strict=True):
        np.testing.assert_allclose(body.positions, placed.translation, atol=1e-12)
        np.testing.assert_allclose(body.rotations, placed.rotation.as_matrix(), atol=1e-12)
        placed = placed if above is None else above * placed


def test_a_body_without_a_frame_above_it_is_read_once(tmp_path: Path):
    bag = Bag(tmp_path / "bag")
    pose, fixed = moves(), stands()
    for k in range(COUNT):
        bag.transform("/tf", stamp(k), "world", "plate", pose[k])
        bag.transform("/tf", stamp(k), "plate", "tool", fixed[k])
    (body,) = read_bag(bag.written()).bodies
    assert (body.name, body.read_as) == ("plate", "")


def test_frames_that_place_each_other_end(tmp_path: Path):
    bag = Bag(tmp_path / "bag")
    one, other = moves(), moves()
    for k in range(COUNT):
        bag.transform("/tf", stamp(k), "b", "a", one[k])
        bag.transform("/tf", stamp(k), "a", "b", other[k])
    assert {body.read_as for body in read_bag(bag.written()).bodies} == {"in frame a", "in frame b"}


def test_points_are_read_where_the_frame_they_move_with_puts_them(tmp_path: Path):
    """Given on a body that moves in a frame that stands in another one: which of these is the robot's is left open."""
    bag = Bag(tmp_path / "bag")
    pose, fixed = moves(), stands()
    places = RNG.uniform(-1.0, 1.0, (COUNT, 2, 3))
    bag.transform("/tf_static", stamp(0), "world", "mocap", fixed[0])
    for k in range(COUNT):
        bag.transform("/tf", stamp(k), "mocap", "plate", pose[k])
        for m in range(2):
            bag.point(f"/marker/{m}", stamp(k), "plate", places[k, m])
    log = read_bag(bag.written())
    seen = np.stack([pose.apply(places[:, m]) for m in range(2)], axis=1)
    np.testing.assert_allclose(log.positions, seen, atol=1e-12)
    (world,) = log.frames
    assert world.name == "world"
    np.testing.assert_allclose(world.points(seen[:, 0]), fixed.apply(seen[:, 0]), atol=1e-12)


def test_things_on_one_topic_with_their_own_stamps_are_named_and_chosen(tmp_path: Path):
    bag = Bag(tmp_path / "bag")
    pose, other = moves(), moves()
    for k in range(COUNT):
        bag.transform("/tf", stamp(k), "world", "plate", pose[k])
        bag.transform("/tf", stamp(k, rate=33), "odom", "base_link", other[k])
    folder = bag.written()
    with pytest.raises(FileError, match=r"/tf/plate \(40\), /tf/base_link \(40\).*--topic"):
        read_bag(folder)
    (body,) = read_bag(folder, ("/tf/plate",)).bodies
    np.testing.assert_allclose(body.positions, pose.translation, atol=1e-12)
