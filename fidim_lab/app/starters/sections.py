"""A new file as text: its tables in order, each key with what it means, from the models that read the file.

A key that has a value here is written; all others stand as `#key = value`, with their default or an example, so that
every key of the reader is in the file. Prose begins with "# ".
"""

import json
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from fidim_lab.app.formats.key_words import KeyWords, key_words, sentence

WIDE = 108
"""columns of a comment"""


@dataclass(frozen=True)
class Section:
    """One table of the file."""

    header: str
    """`[platform]`, `[[cable]]`; empty for the top of the file"""
    model: type[BaseModel]
    values: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """what is written; a key that is not here stands as a comment"""
    says: str = ""
    """prose above the table"""
    only: Sequence[str] | None = None
    """these keys alone; None: all that are no tables"""
    silent: bool = False
    """without what each key means: a table like the one before"""
    commented: bool = False
    """the whole table stands as a comment"""
    examples: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """what stands behind a key that is a comment, where each table of this kind needs one of its own"""


def document(kind: str, opening: str, sections: Iterable[Section]) -> str:
    """The whole file; `kind` as `key_words` has it."""
    parts = [_prose(opening)]
    parts += [_section(kind, section) for section in sections]
    return "\n".join(parts)


def toml_value(value: Any) -> str:
    """A value as TOML writes it."""
    match value:
        case bool() | str():
            return json.dumps(value, ensure_ascii=False)
        case float():
            return repr(round(value, 9)) if abs(value) < 1e6 else f"{value:g}"
        case Mapping():
            return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
        case list() | tuple():
            return "[" + ", ".join(toml_value(one) for one in value) + "]"
        case _:
            return str(value)


def plain_keys(model: type[BaseModel]) -> list[str]:
    """Names in the file of the keys of a table that hold values and no further tables."""
    schema = model.model_json_schema()
    return [name for name, one in schema["properties"].items() if not _is_table(one, schema)]


def _is_table(one: dict[str, Any], schema: dict[str, Any]) -> bool:
    if "$ref" in one:
        return "properties" in schema["$defs"][one["$ref"].rpartition("/")[2]]
    inner = [*one.get("anyOf", ()), *([one["items"]] if "items" in one else [])]
    return any(_is_table(part, schema) for part in inner)


def _section(kind: str, section: Section) -> str:
    schema = section.model.model_json_schema()
    lines: list[str] = [_prose(section.says)] if section.says else []
    if section.header:
        lines.append(("#" if section.commented else "") + section.header)
    for key in section.only if section.only is not None else plain_keys(section.model):
        words = key_words(kind, section.model.__name__, key) or KeyWords("", f"{key}.", None)  # a test misses the words
        schema_of_key = schema["properties"][key]
        if not section.silent:
            lines.append(_prose(sentence(words, schema_of_key)))
        given = key in section.values
        example = section.examples.get(key, words.example)
        value = section.values[key] if given else _stand_in(section.model, key, example)
        lines.append(f"{'' if given and not section.commented else '#'}{key} = {toml_value(value)}")
    return "\n".join(lines) + "\n"


def _stand_in(model: type[BaseModel], key: str, example: Any) -> Any:
    """What stands behind a key that is commented out: its default, or an example."""
    if example is not None:
        return example
    named = next(one for name, one in model.model_fields.items() if (one.alias or name) == key)
    if named.is_required():
        raise KeyError(f"key_words.toml has no example of {model.__name__}, {key}")
    return to_jsonable_python(named.get_default(call_default_factory=True))


def _prose(text: str) -> str:
    lines: list[str] = []
    for paragraph in text.splitlines():
        if paragraph.startswith("    "):  # a command stays as it is typed
            lines.append(f"# {paragraph}")
        else:
            lines += textwrap.wrap(paragraph, WIDE, initial_indent="# ", subsequent_indent="# ") or ["#"]
    return "\n".join(lines)
