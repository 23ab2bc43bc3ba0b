"""The one way into this program for a file that somebody else may have written, spoilt or put there.

`open_input` takes regular files up to a size, and nothing that waits (FIFO), never ends (/dev/zero) or is no file;
`read_bytes`, `read_text` and `read_json` stand on it. What is parsed is checked once, here: nesting, size of numbers,
names that a terminal would obey. Each mistake is a FileError with file and place. TOML has its own module above this.
"""

import json
import math
import os
import re
import stat
from collections.abc import Collection, Generator
from contextlib import contextmanager
from difflib import get_close_matches
from io import BufferedReader
from pathlib import Path
from typing import Any, NoReturn

from fidim_lab.errors import FileError

MIB = 1 << 20
JSON_LIMIT = 8 * MIB
"""bytes; an explanation with all samples of its wrench has 1 MiB. 8 MiB of empty lists take 0.4 GB as objects"""
TEXT_LIMIT = 64 * MIB
"""bytes; ten minutes of window at 200 Hz are 20 MiB"""
DEEPEST = 32
"""levels of nesting; our own files have six"""
LARGEST_INTEGER = 1 << 63
"""TOML's own range; beyond it a number no longer fits what calculates with it"""

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)
_UNSEEN = re.compile(r"[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""control characters (a terminal obeys them), direction marks (they show a text in another order), half characters"""


class NotAllowedError(ValueError):
    """A parsed value that no file of ours may hold: where in the file, and why."""

    def __init__(self, place: tuple[str | int, ...], problem: str) -> None:
        super().__init__(problem)
        self.place = place
        self.problem = problem


def _meant(path: Path) -> str:
    """A file of the same kind beside it whose name is nearly the same."""
    try:
        beside = [one.stem for one in path.parent.iterdir() if one.suffix == path.suffix]
    except OSError:
        return ""
    near = get_close_matches(path.stem, beside, 1)
    return f"Did you mean {near[0]}{path.suffix}?" if near else ""


@contextmanager
def open_input(path: Path, limit: int) -> Generator[BufferedReader]:
    """A regular file of at most `limit` bytes, open for reading bytes. Raises FileError for anything else."""
    try:
        with _opened(path, limit) as file:
            yield file
    except FileNotFoundError:
        raise FileError(path, "", "no such file", hint=_meant(path)) from None
    except OSError as error:
        raise FileError(path, "", f"cannot be read: {error.strerror or error}") from None


def _opened(path: Path, limit: int) -> BufferedReader:
    if "\0" in str(path):
        raise FileError(path, "", "is not a file name: it contains a NUL")
    _check(path, path.stat(), limit)  # before it is opened: opening a device may already move it
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    file = open(descriptor, "rb")  # noqa: PTH123, SIM115 - of a descriptor; `open_input` closes it
    _check(path, os.fstat(descriptor), limit)
    return file


def read_bytes(path: Path, limit: int = TEXT_LIMIT) -> bytes:
    """All of a file. Raises FileError where it is missing, unreadable, no regular file, or too large."""
    with open_input(path, limit) as file:
        data = file.read(limit + 1)
    if len(data) > limit:  # it grew
        _too_large(path, len(data), limit)
    return data


def read_text(path: Path, limit: int = TEXT_LIMIT) -> str:
    """The text of a file. Raises FileError as `read_bytes`, and where it is not UTF-8."""
    try:
        return read_bytes(path, limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(path, f"byte {error.start}", "is not UTF-8 text") from None


def read_json(path: Path, limit: int = JSON_LIMIT) -> Any:
    """What a JSON file holds. Raises FileError as `read_text`, for what is no JSON, and as `check_values` does."""
    return parse_json(path, read_text(path, limit))


def parse_json(path: Path, text: str, place: str = "") -> Any:
    """`read_json` of a text that was read already; `place`: where in the file it stands."""
    try:
        found = json.loads(text, parse_constant=_no_number)
        check_values(found)
    except json.JSONDecodeError as error:
        raise FileError(path, place or f"line {error.lineno}", f"is not JSON: {error.msg}") from None
    except RecursionError:
        raise FileError(path, place, f"is nested more than {DEEPEST} levels deep") from None
    except NotAllowedError as error:
        raise FileError(path, ", ".join(filter(None, (place, place_words(error.place)))), error.problem) from None
    except ValueError as error:  # an integer of thousands of digits
        raise FileError(path, place, f"is not JSON: {str(error).partition(';')[0]}") from None
    return found


def check_values(value: Any, commands: Collection[str] = (), place: tuple[str | int, ...] = ()) -> None:
    """Raises NotAllowedError for what is nested too deep, not finite, too large, or holds characters nobody sees.

    commands: names of keys whose texts are bytes for a device, so that they may hold any.
    """
    if isinstance(value, str):
        if unseen(value) and not (place and place[-1] in commands):
            raise NotAllowedError(place, f"{ascii(value)[:60]} holds a control character or a direction mark")
    elif isinstance(value, float):
        if not math.isfinite(value):
            raise NotAllowedError(place, f"{value} is not a finite number")
    elif isinstance(value, int):
        if not -LARGEST_INTEGER <= value < LARGEST_INTEGER:
            raise NotAllowedError(place, "a whole number of more than 64 bits")
    elif isinstance(value, dict | list):
        if len(place) >= DEEPEST:
            raise NotAllowedError(place[:2], f"is nested more than {DEEPEST} levels deep")
        _check_inside(value, commands, place)


def _check_inside(value: dict[Any, Any] | list[Any], commands: Collection[str], place: tuple[str | int, ...]) -> None:
    if isinstance(value, list):
        for index, item in enumerate(value):
            check_values(item, commands, (*place, index))
        return
    for key, item in value.items():
        if unseen(key):
            raise NotAllowedError(place, f"key {ascii(key)[:60]} holds a control character or a direction mark")
        check_values(item, commands, (*place, key))


def unseen(text: str) -> bool:
    """Whether there is a character in it that a reader does not see and a terminal may obey."""
    return _UNSEEN.search(text) is not None


def place_words(location: tuple[int | str, ...]) -> str:
    """('cable', 2, 'radius') → 'cable 3, radius': people count from one."""
    words: list[str] = []
    for part in location:
        if isinstance(part, int) and words:
            words[-1] += f" {part + 1}"
        else:
            words.append(str(part))
    return ", ".join(words)


def _check(path: Path, found: os.stat_result, limit: int) -> None:
    """Raises FileError unless it is a regular file of at most so many bytes."""
    if not stat.S_ISREG(found.st_mode):
        what = next((name for is_so, name in _KINDS if is_so(found.st_mode)), "something else")
        raise FileError(path, "", f"is {what}, a file was expected")
    if found.st_size > limit:
        _too_large(path, found.st_size, limit)


def _too_large(path: Path, size: int, limit: int) -> NoReturn:
    raise FileError(path, "", f"is {size / MIB:.1f} MiB large; at most {limit / MIB:g} MiB are read")


def _no_number(name: str) -> NoReturn:
    raise NotAllowedError((), f"{name} is not a finite number")
