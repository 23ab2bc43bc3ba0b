"""The run's journal: append-only JSON lines, readable after a crash or power cut.

Nobody waits for a line: the disk takes it, and secures it at every step's end. What must be there before something
moves is awaited by who moves (`procedures.recording.disk.settled`). `Journal` writes, `read_journal` reads back. A
torn last line is what a power cut leaves; anything torn before is not.
The time of day comes from a callable that the application hands in, so that a simulated run is the same to the byte.
"""

import io
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import ConfigDict, TypeAdapter, ValidationError

from drivers.disk import InlineDisk
from drivers.ports import Clock, Disk
from fidim_lab.data.files.input_file import read_bytes, unseen
from fidim_lab.data.files.mistakes import first_mistake
from fidim_lab.errors import FileError, HardwareError
from fidim_lab.say import printable
from procedures.outcomes import Outcome

NAME = "journal.jsonl"
FORMAT = "fidim-journal/1"

WallTime = Callable[[], str]
"""the time of day as ISO 8601 text"""


class LineKind(StrEnum):
    """The kind of a line."""

    RUN_STARTED = "run-started"
    STEP_STARTED = "step-started"
    STEP_FINISHED = "step-finished"
    TRIPPED = "guard-tripped"
    WARNED = "guard-warned"
    PAUSED = "paused"
    RESUMED = "resumed"
    """after a pause"""
    CONTINUED = "run-continued"
    """in a new process, after a crash, a kill or a power cut"""
    HELD = "held"
    RUN_FINISHED = "run-finished"


@dataclass(frozen=True)
class Entry:
    """One line."""

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)  # pyright: ignore[reportUnannotatedClassAttribute]

    number: int
    t: float
    """monotonic s"""
    wall: str
    kind: LineKind
    step: str = ""
    """the step's type"""
    window: str = ""
    text: str = ""
    outcome: Outcome = Outcome.UNSET
    reason: str = ""
    data: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """measurements and whatever else belongs to the line"""


_LINE: TypeAdapter[Entry] = TypeAdapter(Entry)


class Journal:
    """Appends lines to a file; where the disk does not take one, `Disk.error` says so."""

    def __init__(self, path: Path, clock: Clock, wall_time: WallTime, disk: Disk | None = None) -> None:
        """Opens the file, and mends it where a power cut has torn it: a job for the disk."""
        self.path = path
        self._clock = clock
        self._wall_time = wall_time
        self._disk = InlineDisk() if disk is None else disk
        self._number = _mend(path) if path.exists() else 0
        self._secured = self._number
        # Unbuffered: what was written is with the operating system before the next statement runs.
        self._file = path.open("ab", buffering=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._disk.secure(self._file.close)

    def write(self, kind: LineKind, *, sync: bool = True, **fields: Any) -> None:
        """Append one line (fields as in `Entry`), and bring it to the disk, unless `sync` is False. Never waits."""
        entry = Entry(0, round(self._clock.now(), 6), self._wall_time(), kind, **fields)
        self._disk.put(lambda: self._write(entry))
        if sync:
            self._disk.secure(self._secure)

    def _write(self, entry: Entry) -> None:
        """A job: the line, with the number that it has in the file."""
        line = json.dumps(_compact(replace(entry, number=self._number + 1)), ensure_ascii=False, allow_nan=False) + "\n"
        try:
            self._append(line.encode())
        except OSError as error:
            raise self._unwritten(error) from error
        self._number += 1

    def _secure(self) -> None:
        """A job: one fsync for all lines that are there by now."""
        number = self._number
        if self._secured == number:
            return
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._unwritten(error) from error
        self._secured = number

    def _append(self, data: bytes) -> None:
        """All of it or, as far as the disk allows, none."""
        start = self._file.seek(0, os.SEEK_END)
        try:
            while data:
                data = data[self._file.write(data) or 0 :]
        except OSError:
            if self._file.seekable():
                self._file.truncate(start)
            raise

    def _unwritten(self, error: OSError) -> HardwareError:
        return HardwareError(
            f"{self.path}: the journal cannot be written: {error.strerror or error}.",
            hint="Free some space; what was recorded so far is kept.",
        )


def read_journal(path: Path) -> tuple[Entry, ...]:
    """All complete lines; an incomplete last one is left out. Raises FileError for any other mistake."""
    return tuple(entry for entry, _ in _read(path))


def _mend(path: Path) -> int:
    """Cut a torn last line off, so that appending goes on with whole lines; returns how many there are."""
    entries = _read(path)
    end = entries[-1][1] if entries else 0
    with path.open("r+b") as file:
        file.truncate(end)
        file.seek(0, os.SEEK_END)
        if end:
            file.seek(end - 1)
            if file.read(1) != b"\n":
                file.write(b"\n")
    return len(entries)


def _read(path: Path) -> list[tuple[Entry, int]]:
    """Each whole entry with the offset where it ends."""
    data = read_bytes(path)
    entries: list[tuple[Entry, int]] = []
    offset = 0
    for number, line in enumerate(io.BytesIO(data), start=1):
        offset += len(line)
        try:
            entry = _LINE.validate_json(line)
        except ValidationError as error:
            if data[offset:].strip(b"\0\n") == b"":  # the last line: torn by a crash
                break
            raise FileError(path, f"line {number}", f"is not a journal line: {_wrong(error)}") from None
        entries.append((_shown(entry) if unseen(line.decode("utf-8", "replace")) or b"\\u" in line else entry, offset))
    return entries


def _wrong(error: ValidationError) -> str:
    place, problem = first_mistake(error.errors(include_url=False))
    return f"{place}: {problem}" if place else problem


def _shown(entry: Entry) -> Entry:
    """With control characters and direction marks as their codes: a device's name may have brought them in."""

    def shown(value: Any) -> Any:
        match value:
            case dict():
                return {shown(key): shown(item) for key, item in value.items()}
            case list():
                return [shown(item) for item in value]
            case _:
                return printable(value) if isinstance(value, str) and unseen(value) else value

    texts = {name: shown(getattr(entry, name)) for name in ("step", "window", "text", "reason", "wall", "data")}
    return replace(entry, **texts)


def _compact(entry: Entry) -> dict[str, Any]:
    """Without the fields that say nothing."""
    return {name: value for name, value in asdict(entry).items() if value not in ("", Outcome.UNSET, {})}
