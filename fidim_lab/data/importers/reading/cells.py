"""Cells of text exports: delimiters, numbers, units and times as motion-capture programs write them."""

import csv
import math
import re
from collections.abc import Collection, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from fidim_lab.data.files.input_file import read_bytes
from fidim_lab.data.importers.reading.signatures import refuse_no_text
from fidim_lab.errors import FileError

DELIMITERS = "\t;,"
"""tried in this order: a comma may be a decimal sign beside the others"""
SPACES = " "
"""as a delimiter: any number of blanks"""
COMMA, POINT = (
    re.compile(r"[+-]?(\d+|\d{1,3}(\.\d{3})+),\d+(e[+-]?\d+)?", re.IGNORECASE),
    re.compile(r"[+-]?(\d*|\d{1,3}(,\d{3})+)\.\d+(e[+-]?\d+)?", re.IGNORECASE),
)
"""whole cells that are numbers with that decimal sign, the other one or none between thousands"""
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?P<mark>[,.' \u2019\u00a0\u202f])\d{3}(?:(?P=mark)\d{3})*(?P<decimal>[.,])\d+")
"""a number with marks between thousands and a decimal sign: without one, "1,234" may mean either"""
TWICE_ENDED = re.compile(r"\r+\n")
"""a line's end as Python's csv on Windows writes it"""
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d")
DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})[T ]+(\d{1,2})(:.*)")
"""a date with points, as much of Europe writes it"""
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
NAMED = re.compile(rf"(\d{{1,2}})[- ]({'|'.join(MONTHS)})[a-z]*[- ](\d{{4}})[T ]+(\d{{1,2}})(:.*)", re.IGNORECASE)
"""a date with the month's English name, as MATLAB and LabVIEW write it"""
BASIC = re.compile(r"(\d{4})(\d\d)(\d\d)[T _](\d\d):?(\d\d):?(\d\d)(.*)")
"""ISO 8601's basic form"""
YEAR_FIRST, SLASHED = re.compile(r"(\d{4})/(\d\d?)/(\d\d?)([T ].*)"), re.compile(r"\d\d?/\d\d?/\d{4}\b")
COLON = re.compile(r"(.*\d:\d\d:\d\d):(\d{3,6})")
"""a time of day whose fraction follows a colon"""
CLOCK = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:\.\d+)?)(?: ?([ap])\.?m\.?)?", re.IGNORECASE)
"""times of day as cells: hours, minutes, seconds, and which half of the day"""
STOPWATCH = re.compile(r"(\d{1,3}):(\d\d\.\d+)")
"""times as cells without hours: minutes and seconds, whose fraction says that they are no hours and minutes"""
LENGTH_UNITS = MappingProxyType(
    {"mm": 1e-3, "millimeters": 1e-3, "millimetres": 1e-3, "cm": 1e-2, "centimeters": 1e-2, "centimetres": 1e-2}
    | {"m": 1.0, "meters": 1.0, "metres": 1.0, "in": 0.0254, "inches": 0.0254}
)
"""metres in one unit, by the words that exports use"""
MISSING = frozenset(("", "nan", "null", "na", "n/a", "-", "#n/a", "none"))
"""cells that say: not seen"""
NO_NUMBER = re.compile(r"#.+|[+-]?(nan|1\.#).*", re.IGNORECASE)
"""alike: Excel's errors in any language (#NV, #VALUE!), and what C prints"""
MIN_FRAMES = 20
NO_HEADER = "Is its header lost? fidim import csv reads any table by a map, and proposes one."
"""what to do with a file that does not begin as its program writes it"""
EPOCH = 3e8
"""s; a time later than this counts from 1970, not from when something was switched on"""


def read_export(path: Path) -> str:
    """The text of an export: UTF-8, UTF-16 with its mark, or Windows' own letters.

    Raises FileError as `read_bytes`, and where it is no text. Bytes of 0 are left out: loggers reserve space with them.
    """
    data = read_bytes(path)
    refuse_no_text(path, data)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", "replace")
    else:
        data = data.replace(b"\0", b"")
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", "replace")
    return TWICE_ENDED.sub("\n", text)


def decimal_of(lines: Sequence[str], delimiter: str) -> str:
    """The decimal sign of rows of numbers: a comma where more cells are numbers with it than with a point."""
    cells = [cell.strip().strip('"') for line in lines for cell in cells_of(line, delimiter)]
    return "," if sum(map(bool, map(COMMA.fullmatch, cells))) > sum(map(bool, map(POINT.fullmatch, cells))) else "."


def delimiter_of(lines: Sequence[str]) -> str:
    """The delimiter of a table: the first of tab, semicolon, comma that its longest line has twice, else blanks.

    Commas that only stand within numbers ("1,5 2,5") delimit nothing.
    """
    longest = max(lines, key=len, default="")
    for mark in DELIMITERS:
        words = longest.split()
        decimal = mark == "," and len(words) > 2 and all(map(COMMA.fullmatch, words))
        if longest.count(mark) >= 2 and not decimal:
            return mark
    return SPACES if len(longest.split()) > 2 else ","


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line; a delimiter within quotes belongs to its cell."""
    if delimiter == SPACES:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter), [""])
    except csv.Error:
        return line.split(delimiter)


def moment(path: Path, line: int, column: int, cell: str, *, decimal: str = ".") -> float:
    """A time: a number, or a date and time of day (ISO 8601), s since 1970, or a time of day, s since midnight.

    Raises FileError otherwise. A time without a zone is taken as UTC: only differences count.
    """
    text = _iso(cell)
    plain = text.replace(",", ".") if decimal == "," or text.count(":") in {1, 2} else text
    if short := STOPWATCH.fullmatch(plain):
        return 60.0 * int(short[1]) + float(short[2])
    if clock := CLOCK.fullmatch(plain):
        hours, minutes, seconds, half = clock.groups()
        hour = int(hours) if half is None else int(hours) % 12 + (12 if half.lower() == "p" else 0)
        return 3600.0 * hour + 60.0 * int(minutes) + float(seconds)
    if SLASHED.match(plain):
        what = f"{text[:40]!r}: it is not clear whether day or month comes first."
        raise FileError(path, f"line {line}, column {column}", what, hint="Write dates with the year first.")
    if not DATE.match(plain):
        return number(path, line, column, cell, decimal=decimal)
    whole, _, rest = plain.partition(".")
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
    try:
        found = datetime.fromisoformat(whole + rest[len(digits) :])
        known = found if found.tzinfo else found.replace(tzinfo=UTC)
        return known.timestamp() + float(f"0.{digits or 0}")
    except (ValueError, OverflowError):
        raise FileError(path, f"line {line}, column {column}", f"{text[:40]!r} is not a time") from None


def is_dated(cell: str) -> bool:
    """Whether a cell is a time of day, with a date or without: its unit is the second."""
    text = _iso(cell).replace(",", ".")
    return bool(DATE.match(text) or CLOCK.fullmatch(text) or STOPWATCH.fullmatch(text))


def _iso(cell: str) -> str:
    """A cell with its date in the order of ISO 8601."""
    text = COLON.sub(r"\1.\2", cell.strip().strip('"'))
    if found := BASIC.fullmatch(text):
        year, month, day, hour, minute, second, rest = found.groups()
        return f"{year}-{month}-{day} {hour}:{minute}:{second}{rest}"
    if found := YEAR_FIRST.fullmatch(text):
        year, month, day, rest = found.groups()
        return f"{year}-{month:0>2}-{day:0>2}{rest}"
    if found := NAMED.fullmatch(text):
        day, month, year, hour, rest = found.groups()
        return f"{year}-{MONTHS.index(month.lower()) + 1:02d}-{day:0>2} {hour:0>2}{rest}"
    if found := DAY_FIRST.fullmatch(text):
        day, month, year, hour, rest = found.groups()
        return f"{year}-{month:0>2}-{day:0>2} {hour:0>2}{rest}"
    return text


def number(path: Path, line: int, column: int, cell: str, *, decimal: str = ".") -> float:
    """A finite number in ASCII digits, NaN where the cell says that nothing was seen. Raises FileError otherwise."""
    text = cell.strip().strip('"')
    if text.lower() in MISSING or NO_NUMBER.fullmatch(text):
        return math.nan
    plain = _plain(text, decimal)
    try:
        value = float(plain) if plain.isascii() and "_" not in plain else math.inf
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        raise FileError(path, f"line {line}, column {column}", f"{text[:40]!r} is not a number")
    return value


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with this decimal sign."""
    try:
        float(_plain(cell.strip().strip('"'), decimal))
    except ValueError:
        return False
    return True


def _plain(text: str, decimal: str) -> str:
    """A number without marks between thousands, and with a decimal point."""
    grouped = THOUSANDS.fullmatch(text)
    if grouped and grouped["decimal"] == decimal != grouped["mark"]:
        text = text.replace(grouped["mark"], "")
    return text if decimal == "." else text.replace(".", "?").replace(decimal, ".")


def length_scale(path: Path, where: str, unit: str) -> float:
    """Metres in one unit. Raises FileError naming the units that are known."""
    scale = LENGTH_UNITS.get(unit.strip().strip('"').lower())
    if scale is None:
        raise FileError(path, where, f"a length unit {unit.strip()[:20]!r}; mm, cm, m or inches were expected")
    return scale


def table(
    path: Path,
    lines: Sequence[Sequence[str]],
    first: int,
    width: int,
    *,
    lead: int,
    decimal: str = ".",
    ends: Collection[int] = (),
) -> Float[np.ndarray, "N width"]:
    """Numbers of rows of `width` cells, the first of them line `first` of the file.

    Blanks at the end may be left out, but of whole markers or bodies: after `lead` columns, and after one of `ends`
    (after every third column where none are given).
    Raises FileError where a row was cut off, has more cells, or there are fewer than `MIN_FRAMES`.
    """
    found: list[list[float]] = []
    for line, cells in enumerate(lines, start=first):
        filled = max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)
        if not filled:
            if not lead:  # without frame numbers each row counts, also one in which nothing was seen
                found.append([math.nan] * width)
            continue
        whole = len(cells) >= width or filled <= lead or (filled in ends if ends else (filled - lead) % 3 == 0)
        if filled > width:
            raise FileError(path, f"line {line}", f"{filled} columns, the header has {width}: it does not name all")
        if not whole:
            raise FileError(path, f"line {line}", f"{filled} columns, the header has {width}; is the file truncated?")
        row = [number(path, line, k, cell, decimal=decimal) for k, cell in enumerate(cells[:filled], start=1)]
        found.append(row + [math.nan] * (width - filled))
    while found and not lead and all(map(math.isnan, found[-1])):
        found.pop()
    if len(found) < MIN_FRAMES:
        raise FileError(path, "", f"{len(found)} frames; a recording has at least {MIN_FRAMES}")
    return np.array(found)
