"""Frames other than the robot's: those of a bag are put together, a foreign one is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import write_robot

from .conftest import Swing

TURN = Rotation.from_euler("zyx", [25.0, 4.0, -3.0], degrees=True)
SHIFT = np.array([0.3, -0.2, 0.1])
"""m"""


def imported(robot: Robot, folder: Path, kind: str, take: str, *options: str) -> tuple[int, str]:
    """Exit code, and all that was said."""
    write_robot(folder / "robot.toml", robot)
    arguments = [kind, str(folder / take), "--robot", str(folder / "robot.toml"), "--out", str(folder / "out")]
    done = CliRunner().invoke(fidim, ["import", *arguments, *options])
    return done.exit_code, " ".join(f"{done.output} {done.exception or ''}".split())


def bag(swing: Swing, folder: Path, what: str) -> None:
    """The platform, as a transform or by points, in a frame that /tf_static places in the robot's."""
    bags = pytest.importorskip("rosbags.rosbag2", reason="rosbags, the independent writer of bags, is missing")
    types = pytest.importorskip("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_JAZZY)
    kinds = store.types

    def header(nanoseconds: int, frame: str) -> object:
        return kinds["std_msgs/msg/Header"](
            kinds["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9), frame
        )

    def transform(nanoseconds: int, parent: str, child: str, place: np.ndarray, turn: Rotation) -> bytes:
        one = kinds["geometry_msgs/msg/Transform"](
            kinds["geometry_msgs/msg/Vector3"](*map(float, place)),
            kinds["geometry_msgs/msg/Quaternion"](*map(float, turn.as_quat())),
        )
        stamped = kinds["geometry_msgs/msg/TransformStamped"](header(nanoseconds, parent), child, one)
        return store.serialize_cdr(kinds["tf2_msgs/msg/TFMessage"]([stamped]), "tf2_msgs/msg/TFMessage")

    point = "geometry_msgs/msg/PointStamped"
    with bags.Writer(folder / "take", version=9) as writer:
        latched, moving = (
            writer.add_connection(topic, "tf2_msgs/msg/TFMessage", typestore=store) for topic in ("/tf_static", "/tf")
        )
        topics = [writer.add_connection(f"/m{m}", point, typestore=store) for m in range(5) if what == "points"]
        began = 1_770_000_000 * 10**9
        writer.write(latched, began, transform(began, "world", "capture", SHIFT, TURN))
        for k, (place, turn) in enumerate(zip(swing.p, swing.R, strict=True)):
            at = began + 10_000_000 * k
            own = TURN.inv().apply(swing.markers[k] - SHIFT)
            for m, topic in enumerate(topics):
                message = kinds[point](header(at, "capture"), kinds["geometry_msgs/msg/Point"](*map(float, own[m])))
                writer.write(topic, at, store.serialize_cdr(message, point))
            if not topics:
                seen = TURN.inv() * Rotation.from_matrix(turn)
                where = TURN.inv().apply(place - SHIFT)
                writer.write(moving, at, transform(at, "capture", "plate", where, seen))


@pytest.mark.parametrize("what", ["transforms", "points"])
def test_a_bag_is_read_in_the_frame_in_which_cables_keep_their_lengths(what: str, swing: Swing, tmp_path: Path):
    bag(swing, tmp_path, what)
    code, said = imported(swing.robot, tmp_path, "ros2-bag", "take")
    assert code == 0, said
    assert "in frame world" in said
    window = read_campaign(tmp_path / "out").windows[0]
    at = np.rint(window.t * 100).astype(int)
    seen = np.isfinite(window.markers).all(axis=2)
    assert seen.any(axis=1).mean() > 0.9
    np.testing.assert_allclose(window.markers[seen], swing.markers[at][seen], atol=2e-4)


def table(swing: Swing, folder: Path, what: str) -> None:
    """The take as a table of markers or of poses, with its map."""
    names = [f"{m}{axis}" for m in "abcde" for axis in "xyz"] if what == "markers" else [*"xyz", *"ijkw"]
    values = swing.markers.reshape(len(swing.t), -1)
    if what == "body":  # its origin amid the markers, its axes as they were when somebody made it
        turned = swing.R @ TURN.as_matrix()
        where = swing.p + swing.R @ swing.robot.markers.mean(axis=0)
        values = np.concatenate([where, Rotation.from_matrix(turned).as_quat()], axis=1)
    lines = [",".join(["t", *names])]
    lines += [f"{t:.3f}," + ",".join(f"{x:.6f}" for x in row) for t, row in zip(swing.t, values, strict=True)]
    (folder / "take.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    columns = "".join(f'[[marker]]\nname = "{m}"\ncolumns = ["{m}x", "{m}y", "{m}z"]\n' for m in "abcde")
    if what == "body":
        columns = (
            '[[body]]\nname = "plate"\nposition = ["x", "y", "z"]\nquaternion = ["i", "j", "k", "w"]\norder = "xyzw"'
        )
    head = 'format = "fidim-columns/1"\ntime = "t"\nunit = "m"\n'
    (folder / "map.toml").write_text(head + columns, encoding="utf-8")


def test_a_rigid_body_with_another_origin_and_other_axes_is_named(swing: Swing, tmp_path: Path):
    table(swing, tmp_path, "body")
    code, said = imported(swing.robot, tmp_path, "csv", "take.csv", "--map", str(tmp_path / "map.toml"))
    assert code == 1, said
    assert "its origin or axes are not those of the robot file" in said
    assert "export its markers" in said
    assert f"turned by {np.degrees(TURN.magnitude()):.1f}°" in said
    assert "motion-capture frame is not" not in said


def test_markers_measured_from_another_origin_are_named(swing: Swing, tmp_path: Path):
    table(swing, tmp_path, "markers")
    off = np.array([0.03, 0.0, 0.06])
    markers = swing.robot.markers + off
    robot = replace(swing.robot, marker=markers[0], extra_markers=tuple(markers[1:]))
    code, said = imported(robot, tmp_path, "csv", "take.csv", "--map", str(tmp_path / "map.toml"))
    assert code == 1, said
    assert "they are not in its body frame" in said
    assert "motion-capture frame is not" not in said
