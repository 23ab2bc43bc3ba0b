"""What is wrong with a value, in our words: what was found, and what is allowed. One rule for every kind of file.

Models are checked by pydantic; its kinds of mistake are translated here, so that a person reads the same sentence
about a robot, a rig, a journal or a result. A kind that is not in the table keeps its meaning, in the style of all.
"""

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ConfigDict, ValidationError

from fidim_lab.data.files.input_file import JSON_LIMIT, place_words, read_json
from fidim_lab.errors import FileError
from fidim_lab.say import counted

T = TypeVar("T")
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
"""for a dataclass that a file holds as it is: its `__pydantic_config__`"""

_WANTED = {
    "float": "a number",
    "finite": "a finite number",
    "int": "a whole number",
    "bool": "true or false",
    "string": "a text",
    "path": "a path",
    "list": "a list",
    "tuple": "a list",
    "set": "a list",
    "dict": "a table",
    "mapping": "a table",
    "model": "a table",
    "dataclass": "a table",
    "none": "null",
}
"""what is wanted, by how the name of the mistake begins: float_type, float_parsing, int_from_float, …"""
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_TYPE = re.compile(
    r"(float|int|str|bool|none|list|tuple|dict|set|literal|enum|json-or-python)\b.*|(constrained|function|lax|is)-.*"
    r"|.*\[.*|[A-Z][a-z]+([A-Z]\w*)?"
)
"""how pydantic names one of several types that a value may have"""
_SHOWN = 60
"""characters of a value"""


def place_of(error: Any, data: Any) -> tuple[int | str, ...]:
    """The keys that lead to a mistake, without the names of types that pydantic puts among them.

    A name of a type that the data have as a key is a key: somebody may call a thing so.
    """
    kept: list[int | str] = []
    for part in error["loc"]:
        inside = _inside(data, part)
        if isinstance(part, str) and inside is None and _TYPE.fullmatch(part):
            continue
        kept.append(part)
        data = inside
    return tuple(kept)


def _inside(data: Any, part: int | str) -> Any:
    if isinstance(data, dict):
        return data.get(part)
    return data[part] if isinstance(data, list) and isinstance(part, int) and part < len(data) else None


def mistake(error: Any) -> str:
    """What is wrong, as a part of a sentence that follows the place."""
    kind, context, found = error["type"], error.get("ctx", {}), shown(error["input"])
    if kind in _BOUNDS:
        name, words = _BOUNDS[kind]
        return f"{found}; {words} {_number(context[name])} is allowed"
    if kind in ("literal_error", "enum"):
        allowed = context["expected"].replace("'", '"')
        return f"{_bare(error['input'])}; allowed {'are' if ' or ' in allowed else 'is'} {allowed}"
    if kind == "json_invalid":
        return f"no JSON: {context['error']}"
    if kind == "union_tag_invalid":
        tag, key = context["tag"], context["discriminator"].strip("'")
        return f"{key} is {_bare(tag)}; allowed are {context['expected_tags']}"
    if kind in ("missing", "extra_forbidden"):
        return "is missing" if kind == "missing" else "unknown key"
    if kind in ("too_short", "too_long"):
        few, most = context.get("min_length"), context.get("max_length")
        limit = f"at least {few} are needed" if kind == "too_short" else f"at most {most} are allowed"
        return f"{counted(context['actual_length'], 'value')}; {limit}"
    if kind == "string_pattern_mismatch":
        return f"{found}; a text of the form {context['pattern']} is wanted"
    if kind == "value_error":
        return str(context["error"])
    wanted = _wanted(kind)
    if wanted:
        return f"{found}; {wanted} is wanted"
    return f"{found}; {_plain(error['msg'])}"


def mistakes(errors: Sequence[Any], data: Any = None) -> list[tuple[tuple[int | str, ...], str, Any]]:
    """Place, sentence and first error of each mistake; a value that fits none of several types is told once.

    data: what was checked, as far as it is known.
    """
    together: dict[tuple[int | str, ...], list[Any]] = {}
    for error in errors:
        together.setdefault(place_of(error, data), []).append(error)
    return [(place, _one_of(here), here[0]) for place, here in together.items()]


def first_mistake(errors: Sequence[Any], data: Any = None) -> tuple[str, str]:
    """Place in words, and sentence, of the first one."""
    place, sentence, _ = mistakes(errors, data)[0]
    return place_words(place), sentence


def shown(value: Any) -> str:
    """A value as a file has it, and of which kind it is where that is not plain."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"a list of {counted(len(value), 'value')}"
    if isinstance(value, dict):
        return "a table"
    if value is None:
        return "null"
    if not isinstance(value, str):
        return _number(value) if isinstance(value, int | float) else _short(str(value))
    return f"the text {_bare(value)}"


def _one_of(errors: Sequence[Any]) -> str:
    wanted = list(dict.fromkeys(_wanted(error["type"]) for error in errors))
    if len(wanted) > 1 and all(wanted) and len({id(error["input"]) for error in errors}) == 1:
        return f"{shown(errors[0]['input'])}; {', '.join(wanted[:-1])} or {wanted[-1]} is wanted"
    return mistake(errors[0])


def _wanted(kind: str) -> str:
    begins, _, ends = kind.partition("_")
    about = ends in (
        "type",
        "parsing",
        "number",
        "from_float",
        "attributes_type",
        "parsing_size",
        "required",
        "exact_type",
    )
    return _WANTED.get(begins, "") if about else ""


def _plain(message: str) -> str:
    told = re.sub(r"^(Input|Value|String|List|Tuple|Dictionary) should", "it must", message.rstrip("."))
    return told[:1].lower() + told[1:]


def _bare(value: Any) -> str:
    """Where texts are allowed, too."""
    return _short(json.dumps(value, ensure_ascii=False)) if isinstance(value, str) else shown(value)


def _number(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else _short(str(value))


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def read_json_as(path: Path, validate: Callable[[Any], T], limit: int = JSON_LIMIT) -> T:
    """A JSON file as `validate` makes it (`Model.model_validate`). Raises FileError with the key that is wrong."""
    return validated_json(path, read_json(path, limit), validate)


def validated_json(path: Path, found: Any, validate: Callable[[Any], T]) -> T:
    """What was read of a file as `validate` makes it. Raises FileError with the key that is wrong."""
    try:
        return validate(found)
    except ValidationError as error:
        raise FileError(path, *first_mistake(error.errors(include_url=False), found)) from None
