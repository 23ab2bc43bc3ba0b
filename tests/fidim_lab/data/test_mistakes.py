"""Mistakes in files: each kind is told in our words, with what was found and what is allowed, in TOML and in JSON."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.errors import FileError


class _Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class _Box(Table):
    wide: Annotated[float, Field(gt=0, le=2.5)] = 1.0


class _Everything(Table):
    format: str
    number: Annotated[float, Field(ge=0, lt=10)] = 1.0
    whole: int = 1
    on: bool = False
    text: Annotated[str, Field(pattern="^[a-z]+$")] = "a"
    few: list[float] = Field(default_factory=list[float])
    three: tuple[float, float, float] = (1.0, 2.0, 3.0)
    pair: Annotated[list[float], Field(min_length=2, max_length=3)] = Field(default_factory=list[float])
    box: _Box = _Box()
    boxes: dict[str, _Box] = Field(default_factory=dict[str, _Box])
    kind: Literal["slow", "fast"] = "slow"
    only: Literal[3] = 3
    colour: _Colour = _Colour.RED
    either: float | list[float] = 1.0
    maybe: float | None = None


WRONG = {
    "number = 'x'": 'number: the text "x"; a number is wanted',
    "number = true": "number: true; a number is wanted",
    "number = [1.0]": "number: a list of 1 value; a number is wanted",
    "number = -1": "number: -1; at least 0 is allowed",
    "number = 10.0": "number: 10; less than 10 is allowed",
    "whole = 1.5": "whole: 1.5; a whole number is wanted",
    "whole = 'many'": 'whole: the text "many"; a whole number is wanted',
    "on = 7": "on: 7; true or false is wanted",
    "on = 'perhaps'": 'on: the text "perhaps"; true or false is wanted',
    "text = 3": "text: 3; a text is wanted",
    "text = 'A b'": 'text: the text "A b"; a text of the form ^[a-z]+$ is wanted',
    "few = 1.0": "few: 1; a list is wanted",
    "few = [1.0, 'x']": 'few 2: the text "x"; a number is wanted',
    "three = [1.0, 2.0]": "three: 2 numbers are too few, 3 are wanted",
    "three = [1.0, 2.0, 3.0, 4.0]": "three: 4 values; at most 3 are allowed",
    "pair = [1.0]": "pair: 1 value; at least 2 are needed",
    "pair = [1.0, 1.0, 1.0, 1.0]": "pair: 4 values; at most 3 are allowed",
    "box = 3": "box: 3; a table is wanted",
    "box = { wide = 3.0 }": "box, wide: 3; at most 2.5 is allowed",
    "boxes = { Left = { wide = 0.0 } }": "boxes, Left, wide: 0; more than 0 is allowed",
    "box = { wode = 3.0 }": "box, wode: unknown key; the nearest is wide",
    "kind = 'quick'": 'kind: "quick"; allowed are "slow" or "fast"',
    "only = 4": "only: 4; allowed is 3",
    "colour = 'green'": 'colour: "green"; allowed are "red" or "blue"',
    "either = 'x'": 'either: the text "x"; a number or a list is wanted',
    "boxes = { float = { wode = 0.0 } }": "boxes, float, wode: unknown key; the nearest is wide",
    "maybe = 'x'": 'maybe: the text "x"; a number is wanted',
}


@pytest.mark.parametrize("line", WRONG)
def test_toml(line: str, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text(f'format = "f/1"\n{line}\n')
    with pytest.raises(FileError) as caught:
        read_toml(path, _Everything, "f/1")
    assert str(caught.value) == f"{path}: {WRONG[line]}"


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("number", {"a": 1}, "number: a table; a number is wanted"),
        ("number", None, "number: null; a number is wanted"),
        ("few", [1.0, None], "few 2: null; a number is wanted"),
        ("box", [1], "box: a list of 1 value; a table is wanted"),
        ("kind", 5, 'kind: 5; allowed are "slow" or "fast"'),
        ("text", "x" * 500, None),
        ("text", "X" * 500, 'text: the text "XXXXX'),
    ],
)
def test_json(key: str, value: object, says: str | None, tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"format": "f/1", key: value}))
    if says is None:
        assert read_json_as(path, _Everything.model_validate).text == value
        return
    with pytest.raises(FileError) as caught:
        read_json_as(path, _Everything.model_validate)
    assert str(caught.value).startswith(f"{path}: {says}")
    assert len(str(caught.value)) < len(str(path)) + 150
