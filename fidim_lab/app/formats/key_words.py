"""What the keys of files mean: unit and frame, a sentence, an example. From `key_words.toml` beside this module."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

_RANGES = (("exclusiveMinimum", "> "), ("minimum", "≥ "), ("exclusiveMaximum", "< "), ("maximum", "≤ "))
GUARD = "GuardTable"
"""end of the names of tables that share the words of [rig.guards]"""


class KeyWords(NamedTuple):
    """One key of a table."""

    unit: str
    """with the frame; empty where it has none"""
    says: str
    example: Any
    """None where the default is one"""


@cache
def _all() -> dict[str, dict[str, dict[str, dict[str, Any]]]]:
    text = (files("fidim_lab.app.formats") / "key_words.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def key_words(kind: str, table: str, key: str) -> KeyWords | None:
    """Of a key: `kind` of file (robot, rig, plan, campaign), `table` its model's name. None where none are kept."""
    tables = _all().get(kind, {})
    known = tables.get(table, {}).get(key)
    if known is None and table.endswith(GUARD):
        known = tables.get("guards", {}).get(key)
    return None if known is None else KeyWords(known.get("unit", ""), known["says"], known.get("example"))


def known_keys(kind: str) -> set[tuple[str, str]]:
    """Every (table, key) that this kind of file has words for."""
    return {(table, key) for table, keys in _all()[kind].items() for key in keys}


def sentence(words: KeyWords, field: dict[str, Any]) -> str:
    """Unit, meaning and range in one line, as a comment has it; `field`: the key's JSON schema."""
    allowed = range_words(field)
    return " ".join(
        part
        for part in (f"[{words.unit}]" if words.unit else "", words.says, f"Allowed: {allowed}." if allowed else "")
        if part
    )


def range_words(field: dict[str, Any]) -> str:
    """What a number is held to, e.g. "≥ 1, ≤ 127"; empty where anything goes."""
    parts = field.get("anyOf", [field])
    return ", ".join(f"{sign}{part[key]:.10g}" for part in parts for key, sign in _RANGES if key in part)
