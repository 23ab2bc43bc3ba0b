"""Motive CSV, QTM TSV and TRC: one motion written by hand in each dialect, and any bytes without a traceback."""

import contextlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fidim_lab.app.records.import_kinds import MARKER_READERS, take_numbers
from fidim_lab.data.marker_order import order_of
from fidim_lab.data.missing import without_filled
from fidim_lab.errors import FileError, RefusedError, SetupError

PLACES = np.arange(30 * 6, dtype=float).reshape(30, 2, 3) + 1.0
"""mm"""


def motive(version: str, *, parents: bool) -> str:
    ids = [",ID,1,1,1,2,2,2"] + ([",Parent,,,,,,"] if parents else [])
    head = [
        f"Format Version,{version},Take Name,a,Export Frame Rate,100.000000,Length Units,Millimeters",
        "",
        ",Type," + ",".join(["Marker"] * 6),
        ",Name,p:1,p:1,p:1,p:2,p:2,p:2",
        *ids,
        ",," + ",".join(["Position"] * 6),
        "Frame,Time (Seconds),X,Y,Z,X,Y,Z",
    ]
    rows = [f"{k},{k / 100}," + ",".join(f"{v:g}" for v in row.ravel()) for k, row in enumerate(PLACES)]
    return "\n".join(head + rows)


def qtm(*lead: Callable[[int], str], names: str = "", end: str = "") -> str:
    """lead: cells of the columns before the data, whose names stand in a line of their own."""
    head = ["NO_OF_FRAMES\t30", "NO_OF_CAMERAS\t8", "FREQUENCY\t100", "DATA_INCLUDED\t3D", "MARKER_NAMES\tp:1\tp:2"]
    head += [f"{names}\t" + "\t".join(f"{m} {a}" for m in ("p:1", "p:2") for a in "XYZ")] if names else []
    rows = [[*(cell(k) for cell in lead), *(f"{v:g}" for v in row.ravel())] for k, row in enumerate(PLACES)]
    return "\r\n".join(head + ["\t".join(row) + end for row in rows])


def frame(k: int) -> str:
    return str(k + 1)


def second(k: int) -> str:
    return f"{k / 100:.5f}"


def time_code(k: int) -> str:
    return f"10:11:{k // 25:02d}:{k % 25:02d}"


def trc() -> str:
    head = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        "100\t100\t30\t2\tmm",
        "Frame#\tTime\tp:1\t\t\tp:2\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "",
    ]
    rows = [f"{k + 1}\t{k / 100}\t" + "\t".join(f"{v:g}" for v in row.ravel()) for k, row in enumerate(PLACES)]
    return "\n".join(head + rows)


FILES = {
    "motive-csv 1.1": motive("1.1", parents=False),
    "motive-csv 1.25": motive("1.25", parents=True),
    "qtm-tsv plain": qtm(),
    "qtm-tsv columns": qtm(frame, second, names="Frame\tTime"),
    "qtm-tsv frames alone": qtm(frame),
    "qtm-tsv times alone": qtm(second, names="Time"),
    "qtm-tsv time codes": qtm(frame, second, time_code, names="Frame\tTime\tSMPTE"),
    "qtm-tsv rows end with a tab": qtm(frame, end="\t"),
    "trc": trc(),
}


def written(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "take"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("name", FILES)
def test_every_dialect_gives_the_same_motion(name: str, tmp_path: Path):
    log = MARKER_READERS[name.split()[0]](written(tmp_path, FILES[name]))
    assert log.names == ("p:1", "p:2")
    assert log.rate == 100.0
    assert log.t == pytest.approx(np.arange(30) / 100.0)
    assert log.positions == pytest.approx(1e-3 * PLACES)
    assert log.up == ("z" if name.startswith("qtm") else "y")
    assert log.decided


@pytest.mark.parametrize("name", FILES)
def test_a_row_that_was_cut_off_is_named(name: str, tmp_path: Path):
    separator = "," if name.startswith("motive") else "\t"
    with pytest.raises(FileError, match="truncated"):
        MARKER_READERS[name.split()[0]](written(tmp_path, FILES[name].rstrip(separator).rpartition(separator)[0]))


def test_columns_that_no_name_accounts_for_are_told(tmp_path: Path):
    """A trajectory without a label has columns, but no name in the header: the file is whole all the same."""
    with pytest.raises(FileError, match="line 6: 8 columns; the header's names make 3") as told:
        MARKER_READERS["qtm-tsv"](written(tmp_path, qtm(frame, second).replace("\tp:2", "")))
    assert "Name every trajectory" in str(told.value)


@pytest.mark.parametrize("kind", MARKER_READERS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_bytes_are_a_file_error_or_read(kind: str, tmp_path: Path, data: st.DataObject):
    text = next((text for name, text in FILES.items() if name.startswith(kind)), FILES["trc"]).encode()
    at = data.draw(st.integers(0, len(text)))
    spoilt = text[:at] + data.draw(st.binary(max_size=12)) + text[at + data.draw(st.integers(0, 40)) :]
    with contextlib.suppress(FileError):
        MARKER_READERS[kind](written(tmp_path, spoilt))


@pytest.mark.parametrize("kind", ["trc", "motive-csv", "qtm-tsv"])
def test_a_rate_of_nothing_is_refused(kind: str, tmp_path: Path):
    text = next(text for name, text in FILES.items() if name.startswith(kind))
    nothing = re.sub(r"(Export Frame Rate,|FREQUENCY\t|Units[^\n]*\n)\d+(\.\d+)?", r"\g<1>0", text)
    assert nothing != text
    with pytest.raises(FileError, match="a frame rate of 0 Hz"):
        MARKER_READERS[kind](written(tmp_path, nothing))


def test_markers_are_told_apart_by_their_distances():
    body = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.35, 0], [0.1, 0.1, 0.3]])
    order, misfit, certain = order_of(np.tile(body[[2, 0, 3, 1]], (5, 1, 1)) + 1.0, body)
    assert order == (1, 3, 0, 2)
    assert misfit < 1e-9
    assert certain
    with pytest.raises(RefusedError, match="distances differ"):
        order_of(np.tile(1e3 * body, (5, 1, 1)), body)


@pytest.mark.parametrize("others", [12, 300])
def test_markers_are_found_among_those_of_the_room(others: int):
    """Anchors, tools, other subjects: their distances to the platform change, and few of theirs are like its own."""
    random = np.random.default_rng(others)
    body = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.35, 0], [0.1, 0.1, 0.3], [-0.1, 0.2, 0.12]])
    swing = 0.05 * np.sin(np.arange(80) / 10.0)[:, np.newaxis, np.newaxis] * [1.0, 0.5, 0.2]
    room = np.tile(random.uniform(-2.0, 2.0, (others, 3)), (80, 1, 1))
    seen = np.concatenate([room[:, : others // 2], body + swing, room[:, others // 2 :]], axis=1)
    seen = seen + 1e-4 * random.normal(size=seen.shape)
    order, misfit, certain = order_of(seen, body)
    assert order == tuple(others // 2 + np.arange(5))
    assert misfit < 1e-3
    assert certain
    with pytest.raises(RefusedError, match=r"none of them at the distances.*--order"):
        order_of(seen, 2.0 * body)


def test_zeros_sentinels_and_held_places_are_missing():
    rng = np.random.default_rng(1)
    places = rng.normal(size=(60, 4, 3))
    places[3:6, 0] = 0.0
    places[7, 1] = -9.999
    places[20:40, 2] = places[20, 2]
    found, said = without_filled(places, 1e-3)
    assert np.isnan(found[:, 0, 0]).sum() == 3
    assert np.isnan(found[:, 1, 0]).sum() == 1
    assert np.isnan(found[:, 2, 0]).sum() == 19
    assert np.isfinite(found[:, 3]).all()
    assert len(said) == 3


def test_take_numbers():
    assert take_numbers("1-3, 7") == {1, 2, 3, 7}
    for wrong in ("", "3-1", "a", "1--2"):
        with pytest.raises(SetupError, match="--takes"):
            take_numbers(wrong)


TURNED = "0,0,0.7071068,0.7071068"
"""a quaternion, x y z w: 90° about z"""


def motive_bodies(rotation: str = "Quaternion", turned: str = TURNED) -> str:
    head = [
        f"Format Version,1.25,Take Name,a,Export Frame Rate,100,Rotation Type,{rotation},Length Units,Meters",
        "",
        ",Type," + ",".join(["Rigid Body"] * 8 + ["Marker"] * 3),
        ",Name," + ",".join(["p"] * 8 + ["Unlabeled 1234"] * 3),
        ",ID," + ",".join(["1"] * 11),
        ",Parent,,,,,,,,,,,",
        ",," + ",".join(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 3),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z",
    ]
    rows = [f"{k},{k / 100},{turned},1,2,{k},0.001" + (",7,8,9" if k % 2 else "") for k in range(30)]
    rows[4] = "4,0.04,,,,,,,,,,,"
    return "\n".join(head + rows)


def test_motive_bodies_and_loose_markers(tmp_path: Path):
    log = MARKER_READERS["motive-csv"](written(tmp_path, motive_bodies()))
    (body,) = log.bodies
    assert log.names == ()
    assert body.positions[3] == pytest.approx([1.0, 2.0, 3.0])
    assert body.rotations[3] @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
    assert np.isnan(body.rotations[4]).all()
    assert log.unlabelled is not None
    assert np.isfinite(log.unlabelled[:, 0, 0]).sum() == 15
    with pytest.raises(FileError, match="Rotation: Quaternion"):
        MARKER_READERS["motive-csv"](written(tmp_path, motive_bodies("XYZ")))
    with pytest.raises(FileError, match="length is not 1"):
        MARKER_READERS["motive-csv"](written(tmp_path, motive_bodies(turned="1,1,1,1")))


def test_qtm_6d_turns_column_by_column(tmp_path: Path):
    turn = "0\t1\t0\t-1\t0\t0\t0\t0\t1"  # 90° about z, column by column
    head = ["FREQUENCY\t100", "DATA_INCLUDED\t6D", "BODY_NAMES\tp"]
    rows = [f"1000\t2000\t{k}\t0\t0\t90\t0.1\t{turn}" for k in range(30)]
    rows[2] = "\t".join(["0"] * 16)
    (body,) = MARKER_READERS["qtm-tsv"](written(tmp_path, "\r\n".join(head + rows))).bodies
    assert body.rotations[1] @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assert body.positions[1] == pytest.approx([1.0, 2.0, 0.001])
    assert np.isnan(body.positions[2]).all()
    spoilt = "\r\n".join(head + [row.replace("-1", "0.5") for row in rows])
    with pytest.raises(FileError, match="not a rotation"):
        MARKER_READERS["qtm-tsv"](written(tmp_path, spoilt))


def test_vicon_sub_frames_blocks_decimal_commas_and_loose_names(tmp_path: Path):
    head = ["Devices", "1000", "Force", "Frame", "N", "1", "", "Trajectories", "100", ";;s:a;;;s:*7;;"]
    head += ["Frame;Sub Frame;X;Y;Z;X;Y;Z", ";;mm;mm;mm;mm;mm;mm"]
    rows = [f"{k // 2 + 1};{k % 2};1,5;2;{k};4;5;6" for k in range(40)]
    log = MARKER_READERS["vicon-csv"](written(tmp_path, "\n".join([*head, *rows, "", "Model Outputs"])))
    assert log.names == ("s:a",)
    assert log.rate == 200.0
    assert np.diff(log.t) == pytest.approx(0.005)
    assert log.positions[3, 0] == pytest.approx([0.0015, 0.002, 0.003])
    assert log.unlabelled is not None
    with pytest.raises(FileError, match="line 20, column 5: 'many' is not a number"):
        MARKER_READERS["vicon-csv"](written(tmp_path, "\n".join([*head, *rows[:7], "5;0;1;2;many;4;5;6", *rows])))


def test_vicon_objects_with_angles_are_read_in_every_way(tmp_path: Path):
    head = ["Objects", "100", ",,p:p", "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ", ",,deg,deg,deg,mm,mm,mm"]
    rows = ["1,0,10,20,30,1,2,3", *[f"{k},0,,,,,," for k in range(2, 40)]]
    bodies = MARKER_READERS["vicon-csv"](written(tmp_path, "\n".join([*head, *rows]))).bodies
    assert {body.name for body in bodies} == {"p:p"}
    assert len({body.read_as for body in bodies}) == len(bodies) == 7
    told = {body.read_as: body.rotations[0] for body in bodies}
    expected = Rotation.from_euler("XYZ", [10, 20, 30], degrees=True).as_matrix()
    assert told["angles about its own X, Y, Z in turn"] == pytest.approx(expected)
    expected = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    assert told["angles about its own Z, Y, X in turn"] == pytest.approx(expected)
    expected = Rotation.from_rotvec([10, 20, 30], degrees=True).as_matrix()
    assert told["angles as a rotation vector"] == pytest.approx(expected)
    assert np.isnan(bodies[0].positions[1]).all()
    text = "\n".join([*head, *rows]).replace("deg", "")
    with pytest.raises(FileError, match="no unit of angles"):
        MARKER_READERS["vicon-csv"](written(tmp_path, text))


@pytest.mark.parametrize("end", ["", "\t"])
def test_a_last_marker_that_is_seen_late_leaves_every_column_at_its_place(end: str, tmp_path: Path):
    """Its blank cells are no tab at the ends of rows."""
    rows = qtm(frame, second, names="Frame\tTime", end=end).split("\r\n")
    late = [row if k >= 26 or k < 6 else _blank(row, end) for k, row in enumerate(rows)]
    log = MARKER_READERS["qtm-tsv"](written(tmp_path, "\r\n".join(late)))
    assert log.positions[:, 0] == pytest.approx(1e-3 * PLACES[:, 0], abs=1e-6)
    assert np.isnan(log.positions[:20, 1]).all()
    assert log.positions[20:, 1] == pytest.approx(1e-3 * PLACES[20:, 1], abs=1e-6)


def _blank(row: str, end: str) -> str:
    cells = row.removesuffix(end).split("\t") if end else row.split("\t")
    return "\t".join([*cells[:-3], "", "", ""]) + end
