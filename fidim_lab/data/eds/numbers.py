"""Numbers of EDS files in every spelling that makers use."""

import re

NODE = re.compile(r"\$?\{?NODE_?ID\}?", re.IGNORECASE)
_DECIMAL = re.compile(r"[+-]?0{0,20}[0-9]{1,20}")
_HEXADECIMAL = re.compile(r"([+-]?)(?:0x(0{0,20}[0-9a-f]{1,16})|(?=[0-9])(0{0,20}[0-9a-f]{1,16})h)", re.IGNORECASE)
_BINARY = re.compile(r"0b([01_]{1,72})", re.IGNORECASE)
_BARE = re.compile(r"[0-9a-f]{2,16}", re.IGNORECASE)
"""hexadecimal without a sign of it: only where a letter shows it"""
_FIRST = re.compile(r"([+-]?(?:0x[0-9a-f]+|[0-9][0-9a-f]*h?))(?=[\s;,(])", re.IGNORECASE)
_WORDS = {"yes": 1, "true": 1, "no": 0, "false": 0}
_PARTS = re.compile(r"([+|-]?)\s*([^+|\-\s]+)\s*")


def number(text: str) -> int | None:
    """The integer of a text; None where it is none, or has more than 64 bits could.

    Decimal with leading zeros is decimal: the standard's octal numbers are in no file that we have seen. Of a number
    with words behind it ("0x07 (UNSIGNED32)", "1;why") the number counts.
    """
    text = text.strip()
    if (whole := _whole(text)) is None and (first := _FIRST.match(text)) is not None:
        whole = _whole(first[1])
    return whole


def _whole(text: str) -> int | None:
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    text = text.rstrip("uUL" if text.lower().startswith("0x") else "uUlL")
    if _DECIMAL.fullmatch(text):
        return int(text)
    if (found := _HEXADECIMAL.fullmatch(text)) is not None:
        return int(f"{found[1]}{found[2] or found[3]}", 16)
    if (found := _BINARY.fullmatch(text)) is not None and (digits := found[1].replace("_", "")):
        return int(digits, 2)
    return int(text, 16) if _BARE.fullmatch(text) else None


def plain(text: str) -> bool:
    """Whether a number is spelt as every reader reads it."""
    return bool(re.fullmatch(r"-?(?:0|[1-9][0-9]*|0[xX][0-9a-fA-F]+)", text))


def with_node(text: str) -> int | None:
    """The sum beside `$NODEID` ("$NODEID+0x180", "0x180 + $NodeID", "{NODEID}|0x180"); None where it is no such sum.

    "|" adds as well: an identifier of the predefined set has no bit of a node id.
    """
    text = re.sub(r"[()]", " ", text).strip()
    parts = _PARTS.findall(text)
    own = [sign for sign, part in parts if NODE.fullmatch(part)]
    rest = [(sign, number(part)) for sign, part in parts if not NODE.fullmatch(part)]
    joined = "".join(f"{sign}{part}" for sign, part in parts) == re.sub(r"\s", "", text)
    unsigned = any(not sign for sign, _ in parts[1:])
    if not joined or unsigned or own not in ([""], ["+"], ["|"]) or any(value is None for _, value in rest):
        return None
    return sum(-value if sign == "-" else value for sign, value in rest if value is not None)
