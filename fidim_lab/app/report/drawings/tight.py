"""The same picture in fewer characters: a page holds a hundred of them. For what matplotlib has drawn."""

import re
import zlib
from collections import Counter
from itertools import pairwise

_GROUP = re.compile(r"(</?g\b[^>]*>)")
_STYLE = re.compile(r' style="([^"]*)"')
_END = "</style>"
_NO_TURN = re.compile(r' transform="rotate\(-?0 [^)]*\)"')
_PATH = re.compile(r' d="(?P<way>[MLz\d. \n-]*)"')
_PIECE = re.compile(r"(?P<letter>[MLz]) ?(?:(?P<x>-?[\d.]+) (?P<y>-?[\d.]+))?")
_GOES_ON = re.compile(r"z\s*L")
"""a line from where a closed one began: none of matplotlib's"""
SCALE = 100
"""whole numbers of hundredths: differences of rounded places do not add up to an error"""


def shortened(svg: str) -> str:
    """Lines of straight pieces become relative, turns by 0° go."""
    return _PATH.sub(lambda found: f' d="{_relative(found["way"])}"', _NO_TURN.sub("", svg))


def ungrouped(svg: str) -> str:
    """Without groups that have no attribute."""
    kept: list[str] = []
    open_: list[bool] = []
    for piece in _GROUP.split(svg):
        if not _GROUP.fullmatch(piece):
            kept.append(piece)
            continue
        if piece.startswith("</"):
            says = open_.pop()
        else:
            says = piece not in ("<g>", "<g/>")
            if not piece.endswith("/>"):
                open_.append(says)
        if says:
            kept.append(piece)
    return re.sub(r"\n+", "\n", "".join(kept))


def classed(svg: str) -> str:
    """Styles that come more than once get a name, the same in all pictures of a page for the same style."""
    often = [style for style, count in Counter(_STYLE.findall(svg)).items() if count > 1]
    names = {style: f"s{zlib.crc32(style.encode()):x}" for style in often}
    if len(set(names.values())) < len(names) or _END not in svg:
        return svg
    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    svg = _STYLE.sub(lambda found: f' class="{names[found[1]]}"' if found[1] in names else found[0], svg)
    return svg.replace(_END, rules + _END, 1)


def _relative(way: str) -> str:
    """`M x y L x y …` with differences: short where a line has many points."""
    if _GOES_ON.search(way):
        return way
    pieces = [(found["letter"], _place(found)) for found in _PIECE.finditer(way)]
    said: list[str] = []
    for (before, (x0, y0)), (letter, (x, y)) in pairwise([("", (0, 0)), *pieces]):
        match letter:
            case "z":
                said.append("z")
            case "M":
                said.append(f"M{_number(x)} {_number(y)}")
            case _:
                said.append(("" if before == "L" else "l") + _pair(x - x0, y - y0, first=before != "L"))
    return "".join(said)


def _place(found: re.Match[str]) -> tuple[int, int]:
    return (0, 0) if found["x"] is None else (round(SCALE * float(found["x"])), round(SCALE * float(found["y"])))


def _pair(x: int, y: int, *, first: bool) -> str:
    """Two numbers; a sign parts as well as a blank does."""
    a, b = _number(x), _number(y)
    return ("" if first or a[0] == "-" else " ") + a + ("" if b[0] == "-" else " ") + b


def _number(hundredths: int) -> str:
    text = f"{hundredths / SCALE:.2f}".rstrip("0").rstrip(".")
    sign, digits = ("-", text[1:]) if text.startswith("-") else ("", text)
    return sign + (digits.removeprefix("0") or "0")
