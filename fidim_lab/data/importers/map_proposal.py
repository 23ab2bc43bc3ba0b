"""A first column map ("fidim-columns/1") for a table that nobody has described, in the table's own names.

Names tell time, markers (three columns that differ by x, y, z) and poses (with four more, qx to qw, or x to w of an
orientation). What they do not tell is proposed in the order of the columns, without those of words, to be corrected by
whoever knows the file.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from fidim_lab.data.importers.reading.cells import cells_of, decimal_of, delimiter_of, is_dated, is_number, read_export
from fidim_lab.data.importers.reading.columns import COMMENTS, EXCEL, TOP, Column, without_mark
from fidim_lab.errors import FileError

TIME = re.compile(r"t|.*(time|stamp|zeit|temps|tiempo|sec).*", re.IGNORECASE)
NANOSECONDS = re.compile(r".*(nano?_?sec|nsec).*", re.IGNORECASE)
"""ROS's second part of a stamp"""
PART = re.compile(
    r"[\s_.:/|-]*(position|translation|pos|trans|orientation|rotation|quaternion|quat|rot)$", re.IGNORECASE
)
"""behind the name of whose place or rotation it is"""
UNIT = re.compile(r"\s*[\[(][^\[(]*[\])]$|\s*[/,]?\s+(mm|cm|m)$")
"""behind a name, such as in "M1 X (mm)" """
BETWEEN = r"[\s_.:/|-]*"
AXIS = re.compile(
    rf"(?:(?P<before>.*?){BETWEEN})?(?P<kind>q?)[_ ]?(?P<axis>[wxyz])(?:{BETWEEN}(?P<after>\d*))", re.IGNORECASE
)
"""such as "M1 X", "ax", "X3", "platform_qw"; what stands around the axis says whose it is"""


def proposed_map(path: Path) -> str:
    """The text of a map for the table. Raises FileError for a file that is no table of numbers."""
    rows = [row for row in read_export(path).splitlines() if row.strip()][:TOP]
    if rows and EXCEL.fullmatch(rows[0].strip()):
        rows = rows[1:]
    delimiter = delimiter_of(rows)
    decimal = decimal_of(rows[1:], delimiter)
    split = [cells_of(row, delimiter) for row in rows]
    words = _words(split[-1], decimal) if split else frozenset()
    first = next((k for k, cells in enumerate(split) if _is_data(cells, decimal, words)), None)
    if first is None:
        found = f"first {len(rows)} lines", "no row of four numbers or more: this is not a table of markers"
        raise FileError(path, *found, hint=_hint(split, words))
    columns: list[Column] = list(_names(split[:first], len(split[first]))) or list(range(1, len(split[first]) + 1))
    return "\n".join(_lines(path, columns, words)) + "\n"


def _hint(split: Sequence[Sequence[str]], words: frozenset[int]) -> str:
    """What the last row has instead of a number, where it has one."""
    return f"The last of them has {split[-1][min(words)].strip()[:40]!r} in column {min(words) + 1}." if words else ""


def _lines(path: Path, columns: Sequence[Column], words: frozenset[int]) -> list[str]:
    columns = [column for k, column in enumerate(columns) if k not in words]
    named = [name for name in columns if isinstance(name, str)]
    below = next((name for name in named if NANOSECONDS.fullmatch(name)), None)
    stamps = [name for name in named if TIME.fullmatch(UNIT.sub("", name)) and name != below]
    time = stamps[0] if stamps else columns[0]
    left = [column for column in columns if column not in (time, below)]
    triples, quaternions = _groups([name for name in left if isinstance(name, str)])
    if not triples:
        triples = {chr(65 + k // 3): left[k : k + 3] for k in range(0, len(left) - 2, 3)}
    lines = [
        f"# A proposal for {path.name} by the names of its columns: correct what is wrong (docs/import.md, csv).",
        'format = "fidim-columns/1"',
        f"time = {json.dumps(time, ensure_ascii=False)}",
        '#time_unit = "s"              # s, ms, us, ns; found by the steps where left out'
        if below is None
        else f"nanoseconds = {json.dumps(below, ensure_ascii=False)}",
        '#unit = "mm"                  # found by the robot file where left out',
        '#up = "z"                     # default: found',
    ]
    for name, places in triples.items():
        wxyz = quaternions.get(name)
        head = "[[body]]" if wxyz else "[[marker]]"
        lines += [head, f"name = {json.dumps(name or 'platform', ensure_ascii=False)}"]
        lines += [f"{'position' if wxyz else 'columns'} = {json.dumps(places, ensure_ascii=False)}"]
        lines += [f"quaternion = {json.dumps(wxyz, ensure_ascii=False)}", 'order = "wxyz"'] if wxyz else []
    return lines


def _groups(names: Sequence[str]) -> tuple[dict[str, list[Column]], Mapping[str, list[Column]]]:
    """Names of x, y, z by what is common to them, and of qw, qx, qy, qz; only whole groups."""
    found: dict[tuple[str, bool], dict[str, Column]] = {}
    for name in names:
        if match := AXIS.fullmatch(UNIT.sub("", name)):
            owner = f"{match['before'] or ''}{match['after'] or ''}"
            found.setdefault((owner, bool(match["kind"])), {})[match["axis"].lower()] = name
    whole = {key: one for key, one in found.items() if {*"xyz"} <= {*one}}
    turned = {key: [one[axis] for axis in "wxyz"] for key, one in whole.items() if "w" in one}
    places = {key[0]: [one[axis] for axis in "xyz"] for key, one in whole.items() if key not in turned and not key[1]}
    by_owner = {PART.sub("", owner): quaternion for (owner, _), quaternion in turned.items()}
    return places, {owner: by_owner[PART.sub("", owner)] for owner in places if PART.sub("", owner) in by_owner}


def _names(above: Sequence[Sequence[str]], width: int) -> list[Column]:
    """The line above the numbers that names the columns: of those with a word in each, the one with most of its own.

    The first column may have none (an index), and the last (a delimiter ends each line): their numbers stand for them.
    """
    rows = [[cell.strip() for cell in without_mark(cells)] for cells in above]
    named = [row for row in rows if len(row) == width and all(row[1:-1])]
    best: list[Column] = [*max(named, key=lambda row: len(set(row)), default=[])]
    best = [name or k for k, name in enumerate(best, start=1)]
    return best if len(set(best)) == width else []


def _words(cells: Sequence[str], decimal: str) -> frozenset[int]:
    """Which cells of a row are words: neither a number, a time nor blank."""
    plain = [cell.strip().strip('"') for cell in cells]
    return frozenset(k for k, cell in enumerate(plain) if cell and not is_number(cell, decimal) and not is_dated(cell))


def _is_data(cells: Sequence[str], decimal: str, words: frozenset[int]) -> bool:
    """Whether a row is four numbers or more, a date among them or not, with words only where the last row has some."""
    filled = sum(bool(cell.strip()) for cell in cells)
    own = _words(cells, decimal)
    return filled - len(own) >= 4 and own <= words and not cells[0].lstrip().startswith(COMMENTS)
