"""A first column map ("fidim-columns/1") for a table that nobody has described, in the table's own names.

Names tell time, markers (three columns that differ by x, y, z) and poses (with a rotation of four, three or nine more:
qx to qw, q0 to q3, roll, pitch and yaw, rx to rz, r11 to r33). What they do not tell is proposed in the order of the
columns, without those of words, to be corrected by whoever knows the file.
"""

import json
import re
from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from types import MappingProxyType

from fidim_lab.data.importers.reading.as_table import read_table
from fidim_lab.data.importers.reading.cells import cells_of, decimal_of, delimiter_of, is_dated, is_number
from fidim_lab.data.importers.reading.columns import COMMENTS, EXCEL, TOP, Column, without_mark
from fidim_lab.errors import FileError

TIME = re.compile(r"t|.*(time|stamp|zeit|temps|tiempo|sec).*", re.IGNORECASE)
BELOW = MappingProxyType(
    {
        "nanoseconds": re.compile(r".*(nano?_?sec|nsec).*", re.IGNORECASE),
        "microseconds": re.compile(r".*micro_?sec.*|us|usec", re.IGNORECASE),
        "milliseconds": re.compile(r".*(milli|msec).*|ms", re.IGNORECASE),
    }
)
"""the part of a stamp below its second, as ROS and many loggers write it, by its key in a map"""
PART = re.compile(
    r"[\s_.:/|-]*(position|translation|pos|trans|orientation|rotation|quaternion|quat|rot)$", re.IGNORECASE
)
"""behind the name of whose place or rotation it is"""
UNIT = re.compile(r"\s*[\[(][^\[(]*[\])]$|\s*[/,]?\s+(mm|cm|m)$")
"""behind a name, such as in "M1 X (mm)" """
IN_ANGLES = re.compile(r".*[\[(](?P<unit>deg|rad|°)\w*[\])]", re.IGNORECASE)
BETWEEN = r"[\s_.:/|-]*"
AXIS = re.compile(
    rf"(?:(?P<before>.*?){BETWEEN})?(?P<kind>q?)[_ ]?(?P<axis>[wxyz])(?:{BETWEEN}(?P<after>\d*))", re.IGNORECASE
)
"""such as "M1 X", "ax", "X3", "platform_qw"; what stands around the axis says whose it is"""

PLACE_AND_QUATERNION = 7
"""columns, which no markers have"""
NUMBERED = re.compile(
    rf"(?:(?P<before>.*?){BETWEEN})?(?:q|quat|quaternion|r|m|rot)[_(\[ ]*(?P<digits>\d|[0-3][,_ ]?[0-3])[)\]]*",
    re.IGNORECASE,
)
"""of a quaternion or a matrix, such as "q0", "plate_R12" """
COUNTS = (
    *(tuple(digits) for digits in ("0123", "1234")),
    *(tuple(f"{i}{j}" for i in digits for j in digits) for digits in ("123", "012")),
)
"""of them that are a whole group, in their order"""
ROLLING = re.compile(
    rf"(?:(?P<before>.*?){BETWEEN})?(?:(?P<x>roll\w*|roulis)|(?P<y>pitch|nick\w*|tangage|beccheggio)"
    r"|(?P<z>yaw|gier\w*|lacet|imbardata))",
    re.IGNORECASE,
)
TURNING = re.compile(rf"(.*?){BETWEEN}(r|rot|rotation|rv|rotvec|euler|angle|ang)", re.IGNORECASE)
"""whose x, y, z are angles"""
PLACING = re.compile(rf"(.*?){BETWEEN}(t|p|pos|position|trans|translation)", re.IGNORECASE)


def proposed_map(path: Path) -> str:
    """The text of a map for the table. Raises FileError for a file that is no table of numbers."""
    rows = [row for row in read_table(path).splitlines() if row.strip()][:TOP]
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
    return "\n".join(_lines(path, dict(zip(columns, split[first], strict=True)), words)) + "\n"


def _hint(split: Sequence[Sequence[str]], words: frozenset[int]) -> str:
    """What the last row has instead of a number, where it has one."""
    return f"The last of them has {split[-1][min(words)].strip()[:40]!r} in column {min(words) + 1}." if words else ""


def _lines(path: Path, row: Mapping[Column, str], words: frozenset[int]) -> list[str]:
    """row: the first one, by column."""
    columns = [column for k, column in enumerate(row) if k not in words]
    named = [name for name in columns if isinstance(name, str)]
    time, parts = _stamp(named, row)
    time = columns[0] if time is None else time
    date = next((column for column, cell in row.items() if _is_date_of(row[time], cell) and column != time), None)
    left = [column for column in columns if column not in (time, date, *parts.values())]
    places, turns = _groups([name for name in left if isinstance(name, str)])
    if not places and len(left) == PLACE_AND_QUATERNION:
        places = {"platform": left[:3]}
    elif not places:
        places = {f"M{k // 3 + 1}": left[k : k + 3] for k in range(0, len(left) - 2, 3)}
    if len(places) == 1 and not turns:
        ((owner, place),) = places.items()
        turned = _turned(left[left.index(place[-1]) + 1 :])
        places |= dict.fromkeys([owner, f"{owner or 'platform'} reversed"][: len(turned)], place)
        turns = dict(zip(places, turned, strict=False))
    lines = [
        f"# A proposal for {path.name} by the names of its columns: correct what is wrong (docs/import.md, csv).",
        'format = "fidim-columns/1"',
        f"time = {_toml(time)}",
        *(f"{key} = {_toml(column)}" for key, column in {**({} if date is None else {"date": date}), **parts}.items()),
        *([] if parts else ['#time_unit = "s"              # s, ms, us, ns, d; found by the steps where left out']),
        '#unit = "mm"                  # found by the robot file where left out',
        '#up = "z"                     # default: found',
    ]
    for name, place in places.items():
        turn = turns.get(name)
        lines += ["[[body]]" if turn else "[[marker]]", f"name = {_toml(name or 'platform')}"]
        lines += [f"{'position' if turn else 'columns'} = {_toml(place)}", *(turn or ())]
    return lines


def _stamp(named: Sequence[str], row: Mapping[Column, str]) -> tuple[str | None, dict[str, str]]:
    """Which column has the time, and which what it has below a second, by key.

    Of several times, the one whose name is most like that of the part. Milliseconds may be a time themselves: they are
    a part where a time of day has none.
    """
    stamps = [name for name in named if TIME.fullmatch(UNIT.sub("", name))]
    whole = [name for name in stamps if is_dated(row[name]) and not re.search(r"\d[.,]\d", row[name])]
    for key, pattern in BELOW.items():
        below = next((name for name in named if pattern.fullmatch(UNIT.sub("", name))), None)
        others = [name for name in (whole or stamps if key == "nanoseconds" else whole) if name != below]
        if below is not None and others:
            return max(others, key=lambda name: SequenceMatcher(None, name, below).ratio()), {key: below}
    return next(iter(stamps), None), {}


def _is_date_of(time: str, cell: str) -> bool:
    """Whether a cell is the date of a time of day."""
    return is_dated(time) and not is_dated(cell) and is_dated(f"{cell.strip()} {time.strip()}")


def _turned(columns: Sequence[Column]) -> list[Sequence[str]]:
    """Lines on the rotation that a place has in these columns, whose names do not tell it; empty where they are none.

    Of three angles in their order the last may be about z, or the first: the cable lengths tell.
    """
    if len(columns) == 3:
        return [[f"angles = {_toml(list(ways))}"] for ways in (columns, columns[::-1])]
    key = {4: "quaternion", 9: "matrix"}.get(len(columns))
    return [[f"{key} = {_toml(list(columns))}"]] if key else []


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def _groups(names: Sequence[str]) -> tuple[dict[str, list[Column]], dict[str, Sequence[str]]]:
    """Columns of x, y, z by what is common to their names, and lines on the rotation of those that have one.

    A rotation belongs to the place with its name, or to the only one. Only whole groups count.
    """
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        bare = UNIT.sub("", name)
        if rolling := ROLLING.fullmatch(bare):
            axis = next(axis for axis in "xyz" if rolling[axis])
            found.setdefault((rolling["before"] or "", "angles"), {})[axis] = name
        elif match := AXIS.fullmatch(bare):
            owner, kind = f"{match['before'] or ''}{match['after'] or ''}", "quaternion" if match["kind"] else ""
            turning = TURNING.fullmatch(owner)
            if not kind and (IN_ANGLES.match(name) or turning) and match["axis"].lower() != "w":
                owner, kind = (turning[1] if turning else owner), "angles"
            found.setdefault((owner, kind), {})[match["axis"].lower()] = name
        elif match := NUMBERED.fullmatch(bare):
            digits = re.sub(r"\D", "", match["digits"])
            found.setdefault((match["before"] or "", f"{len(digits)} digits"), {})[digits] = name
    places: dict[str, list[Column]] = {}
    turns: dict[str, Sequence[str]] = {}
    for (owner, kind), group in found.items():
        whose = PART.sub("", owner)
        if "w" in group and {*"xyz"} <= {*group}:
            turns[whose] = [f"quaternion = {_toml([group[axis] for axis in 'wxyz'])}", 'order = "wxyz"']
        elif kind == "angles" and {*"xyz"} <= {*group}:
            turns[whose] = [f"angles = {_toml([group[axis] for axis in 'xyz'])}", *_unit_of_angles(group["x"])]
        elif counted := next((digits for digits in COUNTS if {*digits} == {*group}), None):
            key = "matrix" if len(counted) > 4 else "quaternion"
            turns[whose] = [f"{key} = {_toml([group[digits] for digits in counted])}"]
        elif not kind and {*"xyz"} <= {*group}:
            places[owner] = [group[axis] for axis in "xyz"]
    if len(places) == len(turns) == 1:
        return places, dict(zip(places, turns.values(), strict=True))
    named = {owner: PART.sub("", PLACING.sub(r"\1", owner)) for owner in places}
    return places, {owner: turns[name] for owner, name in named.items() if name in turns}


def _unit_of_angles(name: str) -> Sequence[str]:
    """As the column's name says it; else it is found, as the order of angles is."""
    said = IN_ANGLES.match(name)
    return [f'angle_unit = "{"rad" if said["unit"].lower() == "rad" else "deg"}"'] if said else []


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
