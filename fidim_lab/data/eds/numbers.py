"""Numbers of EDS files in every spelling that makers use."""

import re

NODE = re.compile(r"\$?NODE_?ID", re.IGNORECASE)
_DECIMAL = re.compile(r"[+-]?[0-9]{1,20}")
_HEXADECIMAL = re.compile(r"([+-]?)(?:0x([0-9a-f]{1,16})|([0-9][0-9a-f]{0,15})h)", re.IGNORECASE)
_WORDS = {"yes": 1, "true": 1, "no": 0, "false": 0}


def number(text: str) -> int | None:
    """The integer of a text; None where it is none, or has more than 64 bits could.

    Decimal with leading zeros is decimal: the standard's octal numbers are in no file that we have seen.
    """
    text = text.strip().rstrip("uUlL") if not text.lower().startswith("0x") else text.strip().rstrip("uUL")
    if _DECIMAL.fullmatch(text):
        return int(text)
    if (found := _HEXADECIMAL.fullmatch(text)) is not None:
        return int(f"{found[1]}{found[2] or found[3]}", 16)
    return _WORDS.get(text.lower())


def plain(text: str) -> bool:
    """Whether a number is spelt as every reader reads it."""
    return bool(re.fullmatch(r"-?(?:0|[1-9][0-9]*|0[xX][0-9a-fA-F]+)", text))


def with_node(text: str) -> int | None:
    """The sum beside `$NODEID` ("$NODEID+0x180", "0x180 + $NodeID"); None where it is no such sum."""
    parts = text.strip("() ").split("+")
    own = [part for part in parts if NODE.fullmatch(part.strip())]
    numbers = [number(part) for part in parts if not NODE.fullmatch(part.strip())]
    if len(own) != 1 or any(value is None for value in numbers):
        return None
    return sum(value for value in numbers if value is not None)
