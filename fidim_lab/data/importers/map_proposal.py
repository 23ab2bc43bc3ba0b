"""A first column map ("fidim-columns/1") for a table that nobody has described, in the table's own names.

Names tell time, markers (three columns that differ by x, y, z) and poses (with four more, qx to qw). What they do not
tell is proposed in the order of the columns, to be corrected by whoever knows the file.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from fidim_lab.data.importers.reading.cells import cells_of, decimal_of, delimiter_of, is_dated, read_export
from fidim_lab.data.importers.reading.columns import COMMENTS, EXCEL, TOP, Column, without_mark
from fidim_lab.errors import FileError

TIME = re.compile(r"t|.*(time|stamp|zeit|temps|tiempo|sec).*", re.IGNORECASE)
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
    first = next((k for k, cells in enumerate(split) if _all_numbers(cells, decimal)), None)
    if first is None:
        raise FileError(path, f"first {len(rows)} lines", "no row of four numbers or more: this is no table of markers")
    columns: list[Column] = list(_names(split[:first], len(split[first]))) or list(range(1, len(split[first]) + 1))
    return "\n".join(_lines(path, columns)) + "\n"


def _lines(path: Path, columns: Sequence[Column]) -> list[str]:
    time = next((name for name in columns if isinstance(name, str) and TIME.fullmatch(UNIT.sub("", name))), columns[0])
    left = [column for column in columns if column != time]
    triples, quaternions = _groups([name for name in left if isinstance(name, str)])
    if not triples:
        triples = {chr(65 + k // 3): left[k : k + 3] for k in range(0, len(left) - 2, 3)}
    lines = [
        f"# A proposal for {path.name} by the names of its columns: correct what is wrong (docs/import.md, csv).",
        'format = "fidim-columns/1"',
        f"time = {json.dumps(time, ensure_ascii=False)}",
        '#time_unit = "s"              # s, ms, us, ns; found by the steps where left out',
        '#unit = "mm"                  # found by the robot file where left out',
        '#up = "z"                     # alike',
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
    places = {owner: [one[axis] for axis in "xyz"] for (owner, q), one in found.items() if not q and {*"xyz"} <= {*one}}
    turned = {owner: [one[axis] for axis in "wxyz"] for (owner, q), one in found.items() if q and {*"wxyz"} <= {*one}}
    return places, turned


def _names(above: Sequence[Sequence[str]], width: int) -> list[str]:
    """The line above the numbers that names the columns: of those with a word in each, the one with most of its own."""
    rows = [[cell.strip() for cell in without_mark(cells)] for cells in above]
    named = [row for row in rows if len(row) == width and all(row)]
    best = max(named, key=lambda row: len(set(row)), default=[])
    return best if len(set(best)) == width else []


def _all_numbers(cells: Sequence[str], decimal: str) -> bool:
    """Whether a row is numbers and blanks, four numbers or more, a date among them or not."""
    filled = [cell.strip().strip('"') for cell in cells if cell.strip()]
    if len(filled) < 4 or filled[0].startswith(COMMENTS):
        return False
    return all(_is_number(cell, decimal) or is_dated(cell) for cell in filled)


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text.replace(decimal, "."))
    except ValueError:
        return False
    return True
