"""The one reader: regular files only, with limits; what is parsed is checked for all formats at once."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from fidim_lab.data.files.input_file import DEEPEST, open_input, read_bytes, read_json, read_text
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.files.toml_file import read_toml_table
from fidim_lab.errors import FileError

EACH_FOLDER = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


def _fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def _loop(path: Path) -> Path:
    path.symlink_to(path.name)
    return path


def _link(to: str) -> Any:
    def make(path: Path) -> Path:
        path.symlink_to(to)
        return path

    return make


@pytest.mark.parametrize("read", [read_bytes, read_text, read_json, read_toml_table])
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: path, "no such file"),
        (lambda path: path.mkdir() or path, "is a folder, a file was expected"),
        (_fifo, "is a FIFO, a file was expected"),
        (_link("/dev/zero"), "is a device, a file was expected"),
        (_loop, "cannot be read"),
        (lambda path: path / "a\0b", "NUL"),
        (lambda path: path / ("a" * 5000), "cannot be read: File name too long"),
    ],
)
def test_what_is_no_file_is_refused_in_words(tmp_path: Path, read: Any, make: Any, says: str) -> None:
    with pytest.raises(FileError, match=says) as caught:
        read(make(tmp_path / "it"))
    assert len(str(caught.value)) < 500


def test_the_limit_is_stated(tmp_path: Path) -> None:
    path = tmp_path / "large"
    path.write_bytes(b"x" * 3_000_000)
    with pytest.raises(FileError, match=r"large: is 2\.9 MiB large; at most 2 MiB are read"):
        read_bytes(path, 2 << 20)
    with pytest.raises(FileError, match="at most 2 MiB"), open_input(path, 2 << 20):
        pass
    assert len(read_bytes(path, 3 << 20)) == 3_000_000


JSONS = {
    "objects without end": ('{"a":' * 200_000, "nested"),
    "lists without end": ("[" * 500_000, "nested"),
    "whole but deep": ("[" * 40 + "]" * 40, f"nested more than {DEEPEST}"),
    "NaN": ('{"a": [1, NaN]}', "NaN is not a finite number"),
    "minus infinity": ("[-Infinity]", "-Infinity is not a finite number"),
    "1e400": ('{"a": [1, 1e400]}', "a 2: inf is not a finite number"),
    "6000 digits": ("[" + "9" * 6000 + "]", "limit"),
    "65 bits": ('{"a": 9223372036854775808}', "a: a whole number of more than 64 bits"),
    "escape": (r'{"a": "x\u001b[2J"}', r"a: 'x\\x1b\[2J' holds a control character"),
    "direction": (r'{"\u202ea": 1}', r"key '\\u202ea' holds a control character or a direction mark"),
    "half a character": (r'["\ud800"]', "control character"),
    "no JSON": ('{"a": 1,\n}', "line 2: is not JSON"),
    "nothing": ("", "line 1: is not JSON"),
}


@pytest.mark.parametrize(("text", "says"), JSONS.values(), ids=list(JSONS))
def test_json_is_checked(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(FileError, match=says) as caught:
        read_json(path)
    assert len(str(caught.value)) < 500


TOMLS = {
    "lists": ("a = " + "[" * 400 + "]" * 400, "nested more than"),
    "tables": ("a = " + "{a=" * 5000 + "1" + "}" * 5000, "nested more than"),
    "dotted key": (".".join("a" * 20_000) + " = 1", "a name of more than"),
    "header": ("[" + " . ".join("a" * 3000) + "]", "a name of more than"),
    "quoted header": ("[" + ".".join(['"a"'] * 3000) + "]", "a name of more than"),
    "5000 digits": ("a = " + "9" * 5000, "is not TOML"),
    "400 digits": ("a = " + "9" * 400, "a: a whole number of more than 64 bits"),
    "nan": ("[[w]]\nx = [1.0, nan]", "w 1, x 2: nan is not a finite number"),
    "inf": ("a = -inf", "a: -inf is not a finite number"),
    "escape": (r'a = "\u001b[2J"', "a: .* holds a control character"),
    "date": ("a = 9999-99-99", "is not TOML"),
    "open text": ('a = """' + '\\"""' * 50_000, "is not TOML"),
}


@pytest.mark.parametrize(("text", "says"), TOMLS.values(), ids=list(TOMLS))
def test_toml_is_checked(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "x.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=says) as caught:
        read_toml_table(path)
    assert len(str(caught.value)) < 500


def test_brackets_and_dots_in_texts_and_comments_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text(
        f'''a = "{"[" * 50}"  # {"{" * 50}\nb = \'\'\'{"[" * 50}\'\'\'\nc = "{".x" * 50}"\n"d.e".f = [[1]]\n'''
    )
    assert read_toml_table(path)["d.e"] == {"f": [[1]]}


def test_the_place_of_a_wrong_key_counts_from_one(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('{"a": [1, "x"]}')
    with pytest.raises(FileError, match='a 2: the text "x"; a number is wanted'):
        read_json_as(path, TypeAdapter(dict[str, list[float]]).validate_python)


@EACH_FOLDER
@given(data=st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "any"
    path.write_bytes(data)
    for read in (read_json, read_toml_table):
        try:
            read(path)
        except FileError as error:
            assert len(str(error)) < 500 + len(str(path))  # noqa: PT017 - both ends are right


@EACH_FOLDER
@given(
    value=st.recursive(
        st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False),
        lambda inner: st.lists(inner) | st.dictionaries(st.text("abc äß\n"), inner),
        max_leaves=20,
    )
)
def test_any_json_of_ours_comes_back(tmp_path: Path, value: Any) -> None:
    path = tmp_path / "any"
    path.write_text(json.dumps(value))
    assert read_json(path) == value


@pytest.mark.parametrize(
    ("wanted", "meant"), [("hal.toml", " Did you mean hall.toml?"), ("hal.json", ""), ("x.toml", "")]
)
def test_a_name_that_is_nearly_right_is_named(tmp_path: Path, wanted: str, meant: str):
    for name in ("hall.toml", "rig.toml"):
        (tmp_path / name).touch()
    with pytest.raises(FileError) as told:
        read_text(tmp_path / wanted)
    assert str(told.value) == f"{tmp_path / wanted}: no such file{'.' if meant else ''}{meant}"
