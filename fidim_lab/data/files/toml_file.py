"""Reading TOML files with manners: every error names the file, the table and the key, all mistakes at once."""

import math
import re
import tomllib
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fidim_lab.data.files.input_file import DEEPEST, MIB, NotAllowedError, check_values, place_words, read_text
from fidim_lab.data.files.mistakes import mistakes, shown
from fidim_lab.errors import FileError

Schema = TypeVar("Schema", bound="Table")
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=-(2**31), le=2**31 - 1)]
"""of an encoder, which has 32 bits"""
Word = Annotated[int, Field(ge=0, le=2**32 - 1)]
"""32 bits, of a drive's identity"""
LIMIT = MIB // 2
"""bytes, which tomllib takes up to 2 s for; a plan of 1000 windows has half of it"""

SMALLEST, LARGEST = 1e-100, 1e15
"""of a number: rounding leaves 1e-17 in axes and products of inertia, an encoder counts to 1e10"""
_TEXTS = re.compile(
    r'''"""(?:[^"\\]++|\\.|"(?!""))*+(?:"""|\Z)|\'{3}(?:[^']++|'(?!''))*+(?:\'{3}|\Z)|'''
    r""""(?:[^"\\\n]++|\\.)*+"?|'[^'\n]*+'?|\#[^\n]*+""",
    re.DOTALL,
)
"""texts of every kind, and comments; one without its end goes as far as it can, so that nothing is looked at twice"""
_LONG_NAME = re.compile(rf"(?<![\w'-])(?:[\w'-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
_TOGETHER = 700
"""characters of the mistakes that are told at once: a line for each of five cables"""
_SHOWN = 80
"""characters of a line that is no TOML"""
_BRACKETS = re.compile(r"[\[\]{}]")


class Table(BaseModel):
    """A TOML table whose keys are all known: an unknown one is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def read_toml_table(path: Path, commands: Collection[str] = ()) -> dict[str, Any]:
    """What a TOML file holds; `commands` as in `check_values`. Raises FileError as `input_file`, and for no TOML."""
    text = read_text(path, LIMIT)
    try:
        _check_depth(text)  # before it is parsed: tomllib takes a second for 3000 dots in a key
        table = tomllib.loads(text)
        check_values(table, commands)
        _check_sizes(table)
    except NotAllowedError as error:
        raise FileError(path, place_words(error.place), error.problem) from None
    except (ValueError, RecursionError) as error:  # also whole numbers of thousands of digits
        raise FileError(path, "", f"is not TOML: {error}{_the_line(text, str(error))}") from None
    return table


def _the_line(text: str, problem: str) -> str:
    """The line that a parser complains of, and what is usual there: a decimal comma."""
    found = re.search(r"at line (\d+)", problem)
    rows = text.splitlines()
    if found is None or not 0 < int(found[1]) <= len(rows):
        return ""
    row = rows[int(found[1]) - 1].strip()[:_SHOWN]
    comma = re.fullmatch(r"[^#\[\]\"\']*=\s*[-+]?\d+,\d+.*", row)
    return f": {row}{'; numbers have a decimal point, no comma' if comma else ''}"


def read_toml(path: Path, schema: type[Schema], wanted_format: str, commands: Collection[str] = ()) -> Schema:
    """A TOML file as its schema.

    `wanted_format` is the value that the key `format` must have; `commands` as in `check_values`.
    Raises FileError naming the places of all mistakes.
    """
    return validated(path, read_toml_table(path, commands), schema, wanted_format)


def validated(path: Path, table: dict[str, Any], schema: type[Schema], wanted_format: str) -> Schema:
    """What was read of a file as its schema. Raises FileError naming the places of all mistakes."""
    found = table.get("format")
    if found != wanted_format:
        what = "is missing" if found is None else f"is {found!r}"
        other = isinstance(found, str) and found.startswith("fidim-") and _kind(found) != _kind(wanted_format)
        wants = f'"{wanted_format}"'
        says = f"another kind of file; {wants} is wanted here" if other else f"this version reads {wants}"
        raise FileError(path, "format", f"{what}; {says}")
    try:
        made = schema.model_validate(table)
    except ValidationError as error:
        raise FileError(path, "", _together(_sentences(error.errors(), table, schema))) from None
    _check_types(path, table, made.model_dump(by_alias=True), ())
    return made


def _kind(name: str) -> str:
    return name.partition("/")[0]


def nearest(name: str, known: Iterable[str]) -> str:
    """The one of the known names that was probably meant; empty where none is near."""
    return next(iter(get_close_matches(name, list(known), 1)), "")


def _together(sentences: list[str]) -> str:
    """All, or as many as a person reads at once."""
    shown, *further = sentences
    while further and len(shown) + len(further[0]) <= _TOGETHER:
        shown += f"; {further.pop(0)}"
    return f"{shown}; and {len(further)} more" if further else shown


def _sentences(errors: Iterable[Any], table: dict[str, Any], schema: type[BaseModel]) -> list[str]:
    """Each mistake once, at the first of its places: what `[every_winch]` says is wrong in every winch."""
    places: dict[tuple[tuple[str, ...], str], list[str]] = {}
    keys = schema.model_json_schema()
    for location, sentence, error in mistakes(list(errors), table):
        place, problem = _problem(location, sentence, error, keys)
        names = tuple(part for part in location if isinstance(part, str))
        places.setdefault((names, problem), []).append(place)
    return [
        f"{first}: {problem}" + (f" (the same in {len(others)} more)" if others else "")
        for (_, problem), (first, *others) in places.items()
    ]


def _problem(location: tuple[int | str, ...], sentence: str, error: Any, keys: dict[str, Any]) -> tuple[str, str]:
    """Where, and what is wrong there. keys: the JSON schema of the whole file."""
    place = place_words(location) or "file"
    found = error["input"]
    match error["type"]:
        case "extra_forbidden":
            name = str(error["loc"][-1])
            inner = len(error["loc"]) > 1
            other = _elsewhere(name, keys, inner=inner)
            return place, f"{sentence}; {other or _meant(name, _inside(keys, error['loc'][:-1]))}"
        case "missing" if isinstance(found, list):  # a tuple that ended too early
            wanted = [one["minItems"] for one in _at(keys, error["loc"][:-1]) if "minItems" in one]
            says = f", {wanted[0]} are wanted" if wanted else ""
            few = "1 number is" if len(found) == 1 else f"{len(found)} numbers are"
            return place_words(error["loc"][:-1]), f"{few} too few{says}"
        case _:
            return place, sentence


def _elsewhere(name: str, keys: dict[str, Any], *, inner: bool) -> str:
    """Where a key of a table belongs above all tables, or the other way round; else empty."""
    if inner:
        return "it belongs above all tables" if name in keys.get("properties", {}) else ""
    for table, schema in keys.get("properties", {}).items():
        for one in _choices(schema, keys):
            inside = _choices(one["items"], keys) if isinstance(one.get("items"), dict) else [one]
            if any(name in found.get("properties", {}) for found in inside):
                return f"it belongs into {f'[[{table}]]' if 'items' in one else f'[{table}]'}"
    return ""


def _meant(name: str, known: list[str]) -> str:
    near = nearest(name, known)
    return f"the nearest is {near}" if near else f"allowed are {', '.join(known)}"


def _inside(keys: dict[str, Any], location: tuple[int | str, ...]) -> list[str]:
    """The keys that the table at this place may have."""
    return list(dict.fromkeys(name for one in _at(keys, location) for name in one.get("properties", ())))


def _at(keys: dict[str, Any], location: tuple[int | str, ...]) -> list[dict[str, Any]]:
    """The parts of a JSON schema that a place stands for: several where there is a choice."""
    here = _choices(keys, keys)
    for part in location:
        below = [one for before in here for one in _below(before, part)]
        here = [one for found in below for one in _choices(found, keys)] or here  # else the name of a choice
    return here


def _below(schema: dict[str, Any], part: int | str) -> list[dict[str, Any]]:
    if isinstance(part, int):
        return [*schema.get("prefixItems", ())[part : part + 1], *([schema["items"]] if "items" in schema else [])]
    if part in schema.get("properties", {}):
        return [schema["properties"][part]]
    others = schema.get("additionalProperties")  # keys that a person chooses
    return [others] if isinstance(others, dict) else []


def _choices(schema: dict[str, Any], keys: dict[str, Any]) -> list[dict[str, Any]]:
    """What a part of a schema may be, references followed."""
    if "$ref" in schema:
        return _choices(keys["$defs"][schema["$ref"].rpartition("/")[2]], keys)
    inner = [one for word in ("anyOf", "oneOf", "allOf") for one in schema.get(word, ())]
    return [found for one in inner for found in _choices(one, keys)] or [schema]


def _check_types(path: Path, written: Any, made: Any, place: tuple[str | int, ...]) -> None:
    """Raises FileError where a text or true became a number, as pydantic lets it."""
    if isinstance(written, dict) and isinstance(made, dict):
        for key in written.keys() & made.keys():
            _check_types(path, written[key], made[key], (*place, key))
    elif isinstance(written, list) and isinstance(made, list | tuple):
        for index, (one, other) in enumerate(zip(written, made, strict=False)):
            _check_types(path, one, other, (*place, index))
    elif isinstance(written, str | bool) and isinstance(made, int | float) and not isinstance(made, type(written)):
        raise FileError(path, place_words(place), f"{shown(written)}; a number is wanted")


def _check_sizes(value: Any, place: tuple[str | int, ...] = ()) -> None:
    """Raises NotAllowedError for a number that no quantity of a laboratory has; squares of all others are finite."""
    if isinstance(value, dict | list):
        for part, item in value.items() if isinstance(value, dict) else enumerate(value):
            _check_sizes(item, (*place, part))
    elif isinstance(value, float) and value and not SMALLEST <= math.fabs(value) <= LARGEST:
        raise NotAllowedError(place, f"{value:g}; numbers other than 0 are from {SMALLEST:g} to {LARGEST:g}")


def _check_depth(text: str) -> None:
    """Raises NotAllowedError where brackets or dotted names are nested deeper than any file of ours is."""
    bare = _TEXTS.sub("''", text)
    if _LONG_NAME.search(bare):
        raise NotAllowedError((), f"a name of more than {DEEPEST} parts")
    depth = 0
    for bracket in _BRACKETS.findall(bare):
        depth += 1 if bracket in "[{" else -1
        if depth > DEEPEST:
            raise NotAllowedError((), f"is nested more than {DEEPEST} levels deep")
