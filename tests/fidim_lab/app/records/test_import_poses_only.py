"""Poses without markers: the campaign claims no more about the platform than the poses do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.importers.map_proposal import proposed_map
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.records import Body, Robot
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import FileError

from .conftest import Swing


def bodies_of_qualisys(swing: Swing) -> str:
    """6D as QTM writes it, with the angles that nobody should use."""
    rows = [
        ["Frame", "Time", "plate X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9))]
    ]
    turned = Rotation.from_quat(swing.quaternions).as_matrix()
    for k, (place, matrix) in enumerate(zip(swing.p, turned, strict=True)):
        numbers = [*(1e3 * place), 0.0, 0.0, 0.0, 0.3, *matrix.ravel(order="F")]
        rows.append([str(k + 1), f"{k / 100:.5f}", *(f"{x:.6f}" for x in numbers)])
    head = ["NO_OF_BODIES\t1", "FREQUENCY\t100", "EVENT\tlet go\t1\t0.01", "DATA_INCLUDED\t6D", "BODY_NAMES\tplate\t\t"]
    return "\r\n".join([*head, *("\t".join(row) for row in rows), ""])


@pytest.mark.parametrize("markers", [1, 5])
def test_three_markers_stand_for_a_pose(markers: int, swing: Swing, tmp_path: Path):
    robot = swing.robot if markers == 5 else swing.robot.__class__(**{**vars(swing.robot), "extra_markers": ()})
    write_robot(tmp_path / "robot.toml", robot)
    (tmp_path / "take.tsv").write_text(bodies_of_qualisys(swing), encoding="utf-8")
    arguments = ["qtm-tsv", str(tmp_path / "take.tsv"), "--robot", str(tmp_path / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "is seen in" not in done.output
    campaign = read_campaign(tmp_path / "out")
    for window in campaign.windows:
        seen = np.isfinite(window.markers).all(axis=2).sum(axis=1)
        assert set(seen) <= {0, 3}
        where, turned, _ = fit_pose(window.markers, campaign.robot.markers)
        at = np.rint(window.t * 100).astype(int)
        known = seen == 3
        assert where[known] == pytest.approx(swing.p[at][known], abs=1e-5)
        assert turned[known] == pytest.approx(swing.R[at][known], abs=1e-4)


def frames_of_ros(swing: Swing, noise: float = 0.0) -> str:
    """A table of transforms as `ros2 topic echo --csv /tf` gives them: the platform, and a frame that stands still."""
    rows, random = ["time,x,y,z,qx,qy,qz,qw,sx,sy,sz,s1,s2,s3,s4"], np.random.default_rng(5)
    for t, place, turn in zip(swing.t, swing.p, swing.quaternions, strict=True):
        still = 1.0 + noise * random.normal(size=3)
        rows.append(",".join(f"{x:.7f}" for x in [t, *place, *turn, *still, 0.0, 0.0, 0.0, 1.0]))
    return "".join(f"{row}\n" for row in rows)


FRAMES = (
    'format = "fidim-columns/1"\ntime = "time"\nunit = "m"\nup = "z"\n'
    '[[body]]\nname = "fixed"\nposition = ["sx", "sy", "sz"]\nquaternion = ["s1", "s2", "s3", "s4"]\norder = "xyzw"\n'
    '[[body]]\nname = "plate"\nposition = ["x", "y", "z"]\nquaternion = ["qx", "qy", "qz", "qw"]\norder = "xyzw"\n'
)


LEANS = Rotation.from_euler("xyz", [0.5, -0.7, 0.9]).as_matrix()
"""body axes that lean so far that every way to read three angles is another rotation"""


def leaning(swing: Swing) -> Robot:
    """The robot with these body axes."""
    robot, nominal = swing.robot, swing.robot.nominal
    inertia = (LEANS.T @ nominal.inertia_matrix @ LEANS)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return replace(
        robot,
        cables=tuple(replace(cable, a=LEANS.T @ cable.a) for cable in robot.cables),
        marker=LEANS.T @ robot.marker,
        extra_markers=tuple(LEANS.T @ marker for marker in robot.extra_markers),
        nominal=Body(LEANS.T @ nominal.com, inertia),
    )


def objects_of_tracker(swing: Swing, angles: np.ndarray) -> str:
    head = ["Objects", "100", ",,plate", "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ", ",,rad,rad,rad,mm,mm,mm"]
    rows = np.concatenate([angles, 1e3 * swing.p], axis=1)
    return "\n".join([*head, *(f"{k},0,{','.join(f'{x:.6f}' for x in row)}" for k, row in enumerate(rows, start=1))])


@pytest.mark.parametrize("order", ["XYZ", "zyx", "ZXY", None])
def test_angles_are_read_in_the_way_in_which_cables_keep_their_lengths(order: str | None, swing: Swing, tmp_path: Path):
    turned = Rotation.from_matrix(swing.R @ LEANS)
    angles = turned.as_rotvec() if order is None else turned.as_euler(order)
    if order:
        angles = angles[:, [order.upper().index(axis) for axis in "XYZ"]]
    write_robot(tmp_path / "robot.toml", leaning(swing))
    (tmp_path / "take.csv").write_text(objects_of_tracker(swing, angles), encoding="utf-8")
    arguments = ["vicon-csv", str(tmp_path / "take.csv"), "--robot", str(tmp_path / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    campaign = read_campaign(tmp_path / "out")
    for window in campaign.windows:
        _, rotations, _ = fit_pose(window.markers, campaign.robot.markers)
        at = np.rint(window.t * 100).astype(int)
        known = np.isfinite(rotations[:, 0, 0])
        assert rotations[known] == pytest.approx(swing.R[at][known] @ LEANS, abs=1e-4)


def turns_of(swing: Swing, kind: str) -> pd.DataFrame:
    """Places and rotations as laboratories name them."""
    turned = Rotation.from_matrix(swing.R @ LEANS)
    columns: dict[str, tuple[list[str], np.ndarray]] = {
        "quaternion, w first": (["q0", "q1", "q2", "q3"], turned.as_quat()[:, [3, 0, 1, 2]]),
        "quaternion, w last": (["q1", "q2", "q3", "q4"], turned.as_quat()),
        "matrix": ([f"R{i}{j}" for i in "123" for j in "123"], turned.as_matrix().reshape(-1, 9)),
        "roll, pitch, yaw in degrees": (["Roll", "Pitch", "Yaw"], turned.as_euler("xyz", degrees=True)),
        "roll, pitch, yaw in radians": (["roulis", "tangage", "lacet"], turned.as_euler("xyz")),
        "own axes, with their unit": (["RX [deg]", "RY [deg]", "RZ [deg]"], turned.as_euler("XYZ", degrees=True)),
        "rotation vector": (["plate rx", "plate ry", "plate rz"], turned.as_rotvec()),
    }
    names, numbers = columns[kind]
    places = ["plate x", "plate y", "plate z"] if "plate rx" in names else ["TX [mm]", "TY [mm]", "TZ [mm]"]
    return pd.DataFrame(np.column_stack([swing.t, 1e3 * swing.p, numbers]), columns=["time", *places, *names])


@pytest.mark.parametrize(
    "kind",
    [
        "quaternion, w first",
        "quaternion, w last",
        "matrix",
        "roll, pitch, yaw in degrees",
        "roll, pitch, yaw in radians",
        "own axes, with their unit",
        "rotation vector",
    ],
)
def test_a_table_of_poses_is_read_by_the_map_that_is_proposed_for_it(kind: str, swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", leaning(swing))
    turns_of(swing, kind).to_csv(tmp_path / "take.csv", index=False, sep=";", decimal=",")
    arguments = ["csv", str(tmp_path / "take.csv"), "--robot", str(tmp_path / "robot.toml")]
    (tmp_path / "map.toml").write_text(proposed_map(tmp_path / "take.csv"), encoding="utf-8")
    arguments += ["--map", str(tmp_path / "map.toml"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(fidim, ["import", *arguments])
    assert done.exit_code == 0, done.output
    campaign = read_campaign(tmp_path / "out")
    for window in campaign.windows:
        where, rotations, _ = fit_pose(window.markers, campaign.robot.markers)
        at = np.rint(window.t * 100).astype(int)
        known = np.isfinite(rotations[:, 0, 0])
        assert where[known] == pytest.approx(swing.p[at][known], abs=1e-4)
        assert rotations[known] == pytest.approx(swing.R[at][known] @ LEANS, abs=1e-4)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ('matrix = ["a", "b", "c", "d", "e", "f", "g", "h", "i"]\nangles = ["a", "b", "c"]', "one of quaternion"),
        ("", "one of quaternion, angles and matrix is needed"),
        ('angles = ["a", "b", "c"]\norder = "wxyz"', "body 1, order"),
        ('quaternion = ["a", "b", "c", "d"]\norder = "XYZ"', "body 1, order"),
        ('quaternion = ["a", "b", "c", "d"]\nangle_unit = "deg"', "angle_unit: belongs to angles"),
        ('matrix = ["a", "b", "c"]', "matrix"),
    ],
)
def test_a_rotation_is_said_in_one_way(lines: str, says: str, tmp_path: Path):
    (tmp_path / "take.csv").write_text("t,x,y,z\n" + "0,1,2,3\n" * 30, encoding="utf-8")
    head = 'format = "fidim-columns/1"\ntime = "t"\n[[body]]\nname = "p"\nposition = ["x", "y", "z"]\n'
    (tmp_path / "map.toml").write_text(head + lines, encoding="utf-8")
    with pytest.raises(FileError, match=says):
        read_mapped(tmp_path / "take.csv", tmp_path / "map.toml")


def test_angles_that_may_be_read_in_two_ways_are_refused(swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", swing.robot)
    angles = Rotation.from_matrix(swing.R).as_euler("XYZ")
    (tmp_path / "take.csv").write_text(objects_of_tracker(swing, angles), encoding="utf-8")
    arguments = ["vicon-csv", str(tmp_path / "take.csv"), "--robot", str(tmp_path / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert "Export rotations as quaternions" in " ".join(done.output.split())


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_frame_that_stands_still_is_not_the_platform(noise: float, swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", swing.robot)
    (tmp_path / "take.csv").write_text(frames_of_ros(swing, noise), encoding="utf-8")
    (tmp_path / "map.toml").write_text(FRAMES, encoding="utf-8")
    arguments = ["csv", str(tmp_path / "take.csv"), "--robot", str(tmp_path / "robot.toml")]
    arguments += ["--map", str(tmp_path / "map.toml"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(fidim, ["import", *arguments])
    assert done.exit_code == 0, done.output
    assert "rigid body plate" in done.output


def test_one_take_given_twice_counts_once(swing: Swing, tmp_path: Path):
    write_robot(tmp_path / "robot.toml", swing.robot)
    rows = bodies_of_qualisys(swing).split("\r\n")
    (tmp_path / "a.tsv").write_text("\r\n".join(rows), encoding="utf-8")
    (tmp_path / "b.tsv").write_text("\r\n".join([*rows[:6], *rows[30:]]), encoding="utf-8")  # exported again, later
    arguments = ["qtm-tsv", str(tmp_path / "*.tsv"), "--robot", str(tmp_path / "robot.toml")]
    done = CliRunner().invoke(fidim, ["import", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "samples are those of take a" in " ".join(done.output.split())
    assert {window.id[0] for window in read_campaign(tmp_path / "out").windows} == {"a"}
