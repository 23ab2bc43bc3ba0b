"""One simulated take, written in every format by independent writers or by hand, and imported by the user's command."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from fidim_lab.app.cli import fidim
from fidim_lab.app.report.contents.folder import ImportedTakes
from fidim_lab.app.report.sections.tables import takes_table
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.robot_file import write_robot
from fidim_lab.model.mechanism import Mechanism

from .conftest import EPOCH, FROM_Z_UP, RATE, Swing


def rows(*parts: np.ndarray) -> list[list[str]]:
    table = np.column_stack([part.reshape(len(part), -1) for part in parts])
    return [[f"{value:.7g}" for value in row] for row in table]


def joined(head: list[str], table: list[list[str]], delimiter: str = "\t") -> str:
    return "\n".join([*head, *(delimiter.join(row) for row in table)]) + "\n"


def frames(swing: Swing) -> np.ndarray:
    return np.arange(1, len(swing.t) + 1).astype(float)


def vicon(swing: Swing, folder: Path) -> list[str]:
    names = "\t\t" + "\t\t\t".join(f"platform:m{k}" for k in range(5))
    head = ["Trajectories", "100", names, "Frame\tSub Frame" + "\tX\tY\tZ" * 5, "\t\t" + "\t".join(["mm"] * 15)]
    text = joined(head, rows(frames(swing), 0 * swing.t, 1e3 * swing.seen("z")))
    (folder / "take.txt").write_text("Devices\n1000\n,Force\nFrame\nN\n1\n\n" + text, encoding="utf-8")
    return ["vicon-text", "take.txt"]


def vicon_objects(swing: Swing, folder: Path) -> list[str]:
    head = ["Objects", "100", ",,platform:platform,,,,,,", "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ", ",,,,,,mm,mm,mm"]
    table = rows(frames(swing), 0 * swing.t, swing.quaternions, 1e3 * swing.p)
    (folder / "take.csv").write_text(joined(head, table, ","), encoding="utf-8")
    return ["vicon-csv", "take.csv"]


def motive(swing: Swing, folder: Path) -> list[str]:
    turn = FROM_Z_UP["y"]
    quaternions = Rotation.from_matrix(turn @ swing.R @ turn.T).as_quat()
    head = [
        "Format Version,1.23,Take Name,a,Export Frame Rate,100.0,Rotation Type,Quaternion,Length Units,Meters",
        "",
        ",Type," + ",".join(["Rigid Body"] * 8 + ["Rigid Body Marker"] * 4),
        ",Name," + ",".join(["platform"] * 8 + ["platform:1"] * 4),
        ",ID," + ",".join(["A"] * 12),
        ",,"
        + ",".join(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 3 + ["Marker Quality"]),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,",
    ]
    one = np.column_stack([swing.seen("y")[:, 0], np.ones(len(swing.t))])
    table = rows(frames(swing) - 1, swing.t, quaternions, swing.p @ turn.T, 1e-4 * np.ones(len(swing.t)), one)
    (folder / "take.csv").write_text(joined(head, table, ","), encoding="utf-8")
    return ["motive-csv", "take.csv", "--body", "platform"]


def qtm_6d(swing: Swing, folder: Path) -> list[str]:
    head = ["NO_OF_FRAMES\t1", "FREQUENCY\t100", "DATA_INCLUDED\t6D", "BODY_NAMES\tplatform"]
    head.append(
        "\t".join(["platform X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9))])
    )
    angles = Rotation.from_matrix(swing.R).as_euler("XYZ", degrees=True)
    table = rows(1e3 * swing.p, angles, 0.1 + 0 * swing.t, swing.R.swapaxes(1, 2))
    text = joined(head, table).replace(".", ",")  # a computer that writes commas
    (folder / "take.tsv").write_text(text, encoding="utf-8")
    return ["qtm-tsv", "take.tsv"]


def qtm_mat(swing: Swing, folder: Path) -> list[str]:
    labels = np.empty((1, 5), dtype=object)
    labels[0] = [f"m{k}" for k in range(5)]
    data = np.concatenate([1e3 * swing.seen("z"), np.zeros((len(swing.t), 5, 1))], axis=2).transpose(1, 2, 0)
    data[1, :, 20:30] = np.nan
    labelled = {"Count": 5.0, "Labels": labels, "Data": data}
    none = {"Count": 0.0, "Data": np.zeros((0, 0))}
    take = {
        "FrameRate": 100.0,
        "Trajectories": {"Labeled": labelled, "Unidentified": none},
        "RigidBodies": {"Bodies": 0.0, "Name": np.empty((0, 0), dtype=object)},
    }
    scipy.io.savemat(folder / "take.mat", {"take": take})
    return ["qtm-mat", "take.mat"]


def c3d(swing: Swing, folder: Path) -> list[str]:
    ezc3d = pytest.importorskip("ezc3d", reason="the independent writer of C3D files is missing")
    pytest.importorskip("c3d", reason="the extra c3d is missing")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["a", "b", "c", "d", "*17"]
    points = np.ones((4, 5, len(swing.t)))
    points[:3] = 1e3 * swing.seen("y").transpose(2, 1, 0)
    points[:, :, 50] = np.nan
    file["data"]["points"] = points
    file.write(str(folder / "take.c3d"))
    return ["c3d", "take.c3d"]


def mapped(swing: Swing, folder: Path) -> list[str]:
    """pandas writes decimal commas, ms since 1970, poses with w first; unit and axis are not told."""
    columns = {"stamp": np.round(1e3 * (EPOCH + swing.t))}
    columns |= {f"p{axis}": 1e3 * (swing.p @ FROM_Z_UP["y"].T)[:, k] for k, axis in enumerate("xyz")}
    turned = Rotation.from_matrix(FROM_Z_UP["y"] @ swing.R).as_quat()
    columns |= {f"q{axis}": turned[:, k] for k, axis in enumerate("xyzw")}
    pd.DataFrame(columns).to_csv(folder / "take.csv", sep=";", decimal=",", index=False)
    (folder / "map.toml").write_text(
        'format = "fidim-columns/1"\ntime = "stamp"\n[[body]]\nname = "b"\nposition = ["px", "py", "pz"]\n'
        'quaternion = ["qw", "qx", "qy", "qz"]\norder = "wxyz"\n',
        encoding="utf-8",
    )
    return ["csv", "take.csv", "--map", "map.toml"]


def ros_poses(swing: Swing, folder: Path) -> list[str]:
    """A bag of rosbags' own writer: a body as PoseStamped and in /tf, and a topic that says nothing of places."""
    bags = pytest.importorskip("rosbags.rosbag2", reason="rosbags, the independent writer of bags, is missing")
    types = pytest.importorskip("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    pose_type, text_type = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String"
    tree_type = "tf2_msgs/msg/TFMessage"
    known = store.types
    with bags.Writer(folder / "bag", version=9) as writer:
        poses = writer.add_connection("/vrpn/platform/pose", pose_type, typestore=store)
        tree = writer.add_connection("/tf", tree_type, typestore=store)
        notes = writer.add_connection("/notes", text_type, typestore=store)
        writer.write(notes, int(EPOCH * 1e9), store.serialize_cdr(known[text_type]("hello"), text_type))
        for t, p, q in zip(EPOCH + swing.t, swing.p, swing.quaternions, strict=True):
            stamp = known["builtin_interfaces/msg/Time"](int(t), round(t % 1.0 * 1e9))
            header = known["std_msgs/msg/Header"](stamp, "world")
            point = known["geometry_msgs/msg/Point"](*map(float, p))
            turn = known["geometry_msgs/msg/Quaternion"](*map(float, q))
            message = known[pose_type](header, known["geometry_msgs/msg/Pose"](point, turn))
            late = int((t + 0.004 * (1.0 + np.sin(1e3 * t))) * 1e9)
            writer.write(poses, late, store.serialize_cdr(message, pose_type))
            shift = known["geometry_msgs/msg/Vector3"](*map(float, p))
            moved = known["geometry_msgs/msg/Transform"](shift, turn)
            frames = known[tree_type]([known["geometry_msgs/msg/TransformStamped"](header, "platform", moved)])
            writer.write(tree, late, store.serialize_cdr(frames, tree_type))
    return ["ros2-bag", "bag"]


def mcap_points(swing: Swing, folder: Path) -> list[str]:
    """The MCAP project's own writer: JSON messages of named points."""
    from mcap.writer import Writer

    with (folder / "take.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Markers", "jsonschema", b"{}")
        channel = writer.register_channel("/markers", "json", schema)
        for t, places in zip(swing.t, swing.seen("z"), strict=True):
            points = [
                {"name": f"m{k}", "position": dict(zip("xyz", place, strict=True))}
                if k < 3
                else {"name": f"m{k}", "position": place.tolist()}
                if k < 4
                else {"name": f"m{k}", **dict(zip("xyz", place, strict=True))}
                for k, place in enumerate(places)
            ]
            message = {"timestamp": {"sec": int(t + 5), "nsec": round((t + 5) % 1.0 * 1e9)}, "markers": points}
            writer.add_message(channel, int(t * 1e9), json.dumps(message).encode(), int(t * 1e9))
        writer.finish()
    return ["mcap", "take.mcap"]


FORMATS: dict[str, Callable[[Swing, Path], list[str]]] = {
    writer.__name__: writer
    for writer in (vicon, vicon_objects, motive, qtm_6d, qtm_mat, c3d, mapped, ros_poses, mcap_points)
}
POSES = ("vicon_objects", "motive", "qtm_6d", "mapped", "ros_poses")
"""without markers: three of five are computed"""


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_window(name: str, swing: Swing, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_robot(tmp_path / "robot.toml", swing.robot)
    arguments = FORMATS[name](swing, tmp_path)
    done = CliRunner().invoke(fidim, ["import", *arguments, "--robot", "robot.toml", "--out", "out"])
    assert done.exit_code == 0, (done.output, done.exception)
    told = json.loads((tmp_path / "out" / "import.json").read_text(encoding="utf-8"))["takes"][0]
    windows = read_campaign(tmp_path / "out").windows
    assert len(windows) >= 3, told
    for window in windows:
        at = np.rint(window.t * RATE).astype(int)
        off = window.markers - swing.markers[at]
        assert np.nanmax(np.abs(off)) < 3e-4, told
        assert np.isfinite(off).all(axis=2).mean() > (0.55 if name in POSES else 0.9)
        assert window.lengths is not None
        held = np.median(Mechanism(swing.robot).lengths(swing.p[at], swing.R[at]), axis=0)
        assert np.nanmean(window.lengths, axis=0) == pytest.approx(held, abs=2e-4)
    assert not [warning for warning in told["warnings"] if "vary" in warning], told
    assert len(told["decided"]) >= 3


@pytest.mark.parametrize("up", ["x", "y"])
def test_an_axis_that_does_not_fit_is_refused_with_the_one_that_does(
    up: str, swing: Swing, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    write_robot(tmp_path / "robot.toml", swing.robot)
    arguments = ["import", *vicon(swing, tmp_path), "--robot", "robot.toml", "--out", "out", "--up", up]
    done = CliRunner().invoke(fidim, arguments)
    assert done.exit_code == 1
    assert "Give --up z." in done.output.replace("\n", " ")


def test_an_axis_with_which_cables_would_stretch_is_refused_with_the_one_that_fits(tmp_path: Path, monkeypatch):
    """A swing of 30 mm: with another axis upwards the locked cables would have to stretch by more than 2 mm."""
    monkeypatch.chdir(tmp_path)
    invoke = CliRunner().invoke
    assert invoke(fidim, ["init", "robot"]).exit_code == 0
    simulate = ["simulate", "--robot", "robot.toml", "--out", "sim", "--equilibria", "1", "--validate", "0"]
    assert invoke(fidim, simulate).exit_code == 0
    (window,) = read_campaign(tmp_path / "sim").windows
    names = [f"{name}_{axis}" for name in "ABCD" for axis in "xyz"]
    table = joined(["t," + ",".join(names)], rows(window.t, window.markers), ",")
    (tmp_path / "take.csv").write_text(table, encoding="utf-8")
    arguments = ["import", "csv", "take.csv", "--robot", "robot.toml", "--out", "out"]
    (tmp_path / "own.toml").write_text(invoke(fidim, arguments).stdout, encoding="utf-8")
    done = invoke(fidim, [*arguments, "--map", "own.toml", "--up", "x"])
    assert done.exit_code == 1, done.output
    said = done.output.replace("\n", " ")
    assert "With x upwards, as requested, cable lengths vary by" in said
    assert "Give --up z." in said


def test_the_robot_that_comes_along_is_known_by_its_name(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "take.csv").write_text("t,ax,ay,az\n1,2,3,4\n", encoding="utf-8")
    done = CliRunner().invoke(fidim, ["import", "trc", "take.csv", "--robot", "irma4", "--out", "out"])
    assert "no such file" not in str(done.exception)
    assert "take.csv" in str(done.exception)


def test_the_report_tells_what_was_decided():
    found = {
        "id": "k1",
        "file": "a/take.c3d",
        "log": None,
        "decided": ["y upwards"],
        "warnings": ["labels"],
        "refused": None,
    }
    import_file = ImportedTakes.model_validate(
        {"kind": "c3d", "name": "robot", "takes": [found], "unread": {"k2": "is cut off"}}
    )
    assert takes_table(import_file).rows == (
        ("k1", "file", "take.c3d"),
        ("k1", "check", "labels"),
        ("k1", "decided", "y upwards"),
        ("k2", "not read", "is cut off"),
    )
