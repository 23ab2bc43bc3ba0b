"""MATLAB files: fields with the shape asked for, every other content a FileError that names the field."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fidim_lab.data.importers.reading.mat5 import DamagedError, read_variables
from fidim_lab.data.importers.reading.matlab import load_struct, variables
from fidim_lab.errors import FileError


def cell(*items: object) -> np.ndarray:
    array = np.empty(len(items), dtype=object)
    array[:] = items
    return array


CONTENT = {
    "mass": 12.5,
    "count": np.int16(4),
    "com": np.array([0.0, 0.1, 0.2]),
    "name": "IRMA",
    "bad": np.array([1.0, np.nan]),
    "inner": {"table": np.arange(12.0).reshape(3, 4)},
    "pulleys": cell({"r": 0.03}, {"r": 0.04}),
    "one": cell({"r": 0.05}),
    "points": cell(np.array([1.0, 2.0, 3.0]), np.array([4, 5, 6], dtype=np.uint8)),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    scipy.io.savemat(tmp_path / "robot.mat", {"s": CONTENT, "other": 1.0})
    return tmp_path / "robot.mat"


def test_fields_come_with_the_shape_asked_for(path: Path):
    s = load_struct(path, "s")
    assert s.number("mass") == 12.5
    assert s.number("count") == 4.0
    assert s.array("com", 3) == pytest.approx([0.0, 0.1, 0.2])
    assert s.struct("inner").array("table", 3, None).shape == (3, 4)
    assert [pulley.number("r") for pulley in s.structs("pulleys")] == [0.03, 0.04]
    assert [pulley.number("r") for pulley in s.structs("one")] == [0.05]
    assert np.array(s.cells("points", 3)) == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]))
    assert set(variables(path)) == {"s", "other"}


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda s: s.number("weight"), "s.weight: is missing; found mass, count"),
        (lambda s: s.number("com"), "s.com: has shape 1 × 3; one number was expected"),
        (lambda s: s.number("name"), "s.name: is text; numbers (one number) were expected"),
        (lambda s: s.array("com", 4), "s.com: has shape 1 × 3; 4 was expected"),
        (lambda s: s.array("com", 3, None), "s.com: has shape 1 × 3; 3 × any was expected"),
        (lambda s: s.array("bad", 2), "s.bad: holds values that are not finite"),
        (lambda s: s.array("inner", 2), "s.inner: is a struct; numbers (2) were expected"),
        (lambda s: s.struct("com"), "s.com: is an array of 1 × 3 numbers; a struct was expected"),
        (lambda s: s.structs("points"), "s.points{1}: is an array"),
        (lambda s: s.cells("pulleys", 3), "s.pulleys{1}: is a struct"),
        (lambda s: s.cells("points", 2), "s.points{1}: has shape 1 × 3; 2 was expected"),
        (lambda s: s.struct("inner").array("table", 4, 4), "s.inner.table: has shape 3 × 4; 4 × 4 was expected"),
        (lambda s: s.structs("pulleys")[1].number("x"), "s.pulleys{2}.x: is missing"),
    ],
)
def test_every_wrong_field_is_named(path: Path, ask, says: str):
    with pytest.raises(FileError) as caught:
        ask(load_struct(path, "s"))
    assert says in str(caught.value)
    assert "robot.mat" in str(caught.value)


def test_wrong_files_are_named(path: Path, tmp_path: Path):
    with pytest.raises(FileError, match="no such variable; found s, other"):
        load_struct(path, "st_out")
    with pytest.raises(FileError, match="a struct was expected"):
        load_struct(path, "other")
    with pytest.raises(FileError, match="no such file"):
        variables(tmp_path / "none.mat")
    with pytest.raises(FileError, match="is a folder"):
        variables(tmp_path)
    text = tmp_path / "text.mat"
    text.write_text("mass = 3\n" * 100)
    with pytest.raises(FileError, match=r"no \.mat file"):
        variables(text)
    hdf5 = tmp_path / "new.mat"
    hdf5.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n" * 64)
    with pytest.raises(FileError, match=r"7\.3"):
        load_struct(hdf5, "s")


@pytest.mark.parametrize("packed", [False, True])
def test_what_scipy_writes_is_read_as_scipy_reads_it(tmp_path: Path, packed: bool):
    rng = np.random.default_rng(1)
    values = {
        name: rng.integers(0, 100, size).astype(kind)
        for kind, name, size in (
            ("f8", "a", (3, 4)),
            ("f4", "b", (1, 7)),
            ("i2", "c", (2, 3, 2)),
            ("u1", "d", (1, 3)),
            ("i8", "e", (5, 1)),
            ("u4", "f", (0, 0)),
            ("bool", "g", (1, 2)),
        )
    }
    path = tmp_path / "values.mat"
    scipy.io.savemat(path, {"s": values}, do_compression=packed)
    read = load_struct(path, "s").fields
    theirs = scipy.io.loadmat(path)["s"][0, 0]
    for name in values:
        assert read[name].shape == theirs[name].shape
        assert np.array_equal(read[name], theirs[name])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_any_number_of_markers_may_be_one_or_none(tmp_path: Path, count: int):
    scipy.io.savemat(tmp_path / "one.mat", {"s": {"Data": np.ones((count, 4, 30))}})
    assert load_struct(tmp_path / "one.mat", "s").samples("Data", None, 4, None).shape == (count, 4, 30)


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (np.array([1 + 2j]), "complex"),
        (scipy.sparse.eye_array(3).tocsc(), "a sparse matrix"),
    ],
)
def test_what_is_not_read_is_refused_by_name(tmp_path: Path, value: object, says: str):
    scipy.io.savemat(tmp_path / "odd.mat", {"s": {"v": value}})
    with pytest.raises(FileError, match=says):
        load_struct(tmp_path / "odd.mat", "s")


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, 3000), at=st.integers(0, 3000), byte=st.integers(0, 255), packed=st.booleans())
def test_a_damaged_file_is_read_or_refused_with_a_sentence(tmp_path: Path, cut: int, at: int, byte: int, packed: bool):
    path = tmp_path / "damaged.mat"
    scipy.io.savemat(path, {"s": CONTENT}, do_compression=packed)
    whole = bytearray(path.read_bytes())
    whole[at % len(whole)] = byte
    path.write_bytes(whole[: len(whole) - (cut % len(whole) if cut % 3 == 0 else 0)])
    for attempt in (lambda: variables(path), lambda: load_struct(path, "s").number("mass")):
        with contextlib.suppress(FileError):  # anything else fails the test
            attempt()


@given(st.binary(max_size=300))
def test_any_bytes_after_a_header_are_read_or_refused(tail: bytes):
    content = b"MATLAB".ljust(124) + b"\x00\x01IM" + tail
    with contextlib.suppress(DamagedError):
        read_variables(content)
