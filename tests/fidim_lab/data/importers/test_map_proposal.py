"""A table without a map: what is proposed reads that very table, in its own names."""

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fidim_lab.data.importers.map_proposal import proposed_map
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.errors import FileError

ROWS = 30


def table(path: Path, head: list[str], columns: int, mark: str = ",", decimal: str = ".") -> Path:
    rows = [mark.join([f"{k / 100:.2f}", *(f"{k + c:.1f}" for c in range(1, columns))]) for k in range(ROWS)]
    path.write_text("\n".join([*head, *(row.replace(".", decimal) for row in rows)]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "columns", "mark", "decimal", "names"),
    [
        (["Zeit;M1 X;M1 Y;M1 Z;M2 X;M2 Y;M2 Z"], 7, ";", ",", ("M1", "M2")),
        (["# a program", "t,ax,ay,az,bx,by,bz", "s,mm,mm,mm,mm,mm,mm"], 7, ",", ".", ("a", "b")),
        (["time,x1,y1,z1,x2,y2,z2"], 7, ",", ".", ("1", "2")),
        (["stamp\tleft_X (mm)\tleft_Y (mm)\tleft_Z (mm)"], 4, "\t", ".", ("left",)),
        (["t,one,two,three,four,five,six"], 7, ",", ".", ("M1", "M2")),
        ([], 7, ",", ".", ("M1", "M2")),
    ],
)
def test_a_proposal_reads_its_table(tmp_path, head, columns, mark, decimal, names):
    path, map_file = table(tmp_path / "take.csv", head, columns, mark, decimal), tmp_path / "map.toml"
    map_file.write_text(proposed_map(path), encoding="utf-8")
    log = read_mapped(path, map_file)
    assert log.names == names
    assert log.rate == pytest.approx(100.0)
    np.testing.assert_allclose(log.positions[3, 0], [4.0, 5.0, 6.0])


def test_columns_without_a_name_at_either_end_and_marks_between_thousands(tmp_path):
    rows = [f'{k},{k / 100:.2f},"1,00{k % 10}.5",2.5,3.5,' for k in range(ROWS)]
    path, map_file = tmp_path / "take.csv", tmp_path / "map.toml"
    path.write_text("\n".join([",time,ax,ay,az,", *rows]) + "\n", encoding="utf-8")
    map_file.write_text(proposed_map(path), encoding="utf-8")
    log = read_mapped(path, map_file)
    assert log.names == ("a",)
    np.testing.assert_allclose(log.positions[3, 0], [1003.5, 2.5, 3.5])


def test_a_pose_is_proposed_by_its_quaternion(tmp_path):
    head = ["time;body_x;body_y;body_z;body_qx;body_qy;body_qz;body_qw"]
    rows = [f"{k / 100:.2f};0.1;0.2;{k / 100:.2f};0;0;0;1" for k in range(ROWS)]
    path, map_file = tmp_path / "poses.csv", tmp_path / "map.toml"
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    map_file.write_text(proposed_map(path), encoding="utf-8")
    (body,) = read_mapped(path, map_file).bodies
    assert body.name == "body"
    np.testing.assert_allclose(body.rotations[5], np.eye(3), atol=1e-12)


def test_a_pose_with_ros_names_and_a_column_of_words(tmp_path):
    head = "header.stamp.sec,header.stamp.nanosec,header.frame_id," + ",".join(
        f"pose.{part}.{axis}" for part, axes in (("position", "xyz"), ("orientation", "xyzw")) for axis in axes
    )
    rows = [
        f"{1_700_000_000 + k // 100},{k % 100 * 10_000_000},world,0.1,0.2,{k / 100:.2f},0,0,0.6,0.8"
        for k in range(ROWS)
    ]
    path, map_file = tmp_path / "poses.csv", tmp_path / "map.toml"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    map_file.write_text(proposed_map(path), encoding="utf-8")
    log = read_mapped(path, map_file)
    (body,) = log.bodies
    assert log.names == ()
    assert log.rate == pytest.approx(100.0, rel=1e-5)
    np.testing.assert_allclose(body.positions[5], [0.1, 0.2, 0.05])
    np.testing.assert_allclose(body.rotations[5] @ [1.0, 0.0, 0.0], [0.28, 0.96, 0.0], atol=1e-12)


def test_what_stands_in_place_of_a_number_is_named(tmp_path):
    path = tmp_path / "take.csv"
    path.write_text("t,x,y,z\n" + "0.1,5 mm,6 mm,7 mm\n" * ROWS, encoding="utf-8")
    with pytest.raises(FileError, match="The last of them has '5 mm' in column 2"):
        proposed_map(path)


def test_what_is_no_table_is_refused(tmp_path):
    path = tmp_path / "notes.csv"
    path.write_text("these are\nno numbers, at all\n", encoding="utf-8")
    with pytest.raises(FileError, match="no row of four numbers"):
        proposed_map(path)


@pytest.mark.parametrize(("names", "listed"), [("alpha,beta,gamma", "xyz"), ("A,B,C", "zyx")])
def test_three_columns_beside_a_place_may_be_its_angles_in_either_order(tmp_path, names, listed):
    """KUKA's A is about z; the cable lengths tell which of the readings is meant."""
    angles = np.random.default_rng(4).uniform(-40.0, 40.0, (ROWS, 3))
    rows = [f"{k / 100:.2f},1,2,3," + ",".join(f"{x:.6f}" for x in row) for k, row in enumerate(angles)]
    path, map_file = tmp_path / "poses.csv", tmp_path / "map.toml"
    path.write_text("\n".join([f"t,x,y,z,{names}", *rows]) + "\n", encoding="utf-8")
    map_file.write_text(proposed_map(path), encoding="utf-8")
    turns = Rotation.from_euler("ZYX", angles[:, [listed.index(axis) for axis in "zyx"]], degrees=True).as_matrix()
    read = [body for body in read_mapped(path, map_file).bodies if np.allclose(body.rotations, turns, atol=1e-6)]
    assert [body.read_as for body in read] == ["angles about its own Z, Y, X in turn in deg"]


NUMBERS = st.one_of(st.floats(), st.integers(-9, 9), st.none(), st.booleans())
VALUES = st.recursive(
    st.one_of(NUMBERS, st.text(max_size=4), st.lists(NUMBERS, min_size=19, max_size=21)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=24), st.dictionaries(st.sampled_from(["t", "x", "m", "q", ""]), inner, max_size=4)
    ),
    max_leaves=30,
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=VALUES, rows=st.integers(1, 25), lines=st.booleans())
@example(value=[0.0, *[None] * 6, 0.0, 0.0, 0.0, 1.4e154, None, None, *[0.0] * 7], rows=7, lines=False)
@example(value=[*[0.0] * 10, 1.4e154, 0.0, 0.0, *[1.4e154] * 7], rows=7, lines=False)
def test_any_json_is_a_table_or_a_sentence(tmp_path, value, rows, lines):
    path, map_file = tmp_path / "take.json", tmp_path / "map.toml"
    texts = [json.dumps({"t": k, "v": value}) for k in range(rows)]
    path.write_text("\n".join(texts) if lines else f"[{','.join(texts)}]", encoding="utf-8")
    with contextlib.suppress(FileError):
        map_file.write_text(proposed_map(path), encoding="utf-8")
        assert (np.diff(read_mapped(path, map_file).t) > 0.0).all()
