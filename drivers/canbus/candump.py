"""The raw log of a bus, in the format of can-utils' candump: `(12.345678) can0 181#0011AABB`, one frame a line.

`CandumpLog.write` is a tap for any CanTransport; `read_candump` gives the frames back, also of a file that was cut off.
"""

import re
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from drivers.canbus.transport import CanFrame
from drivers.disk import BlockFile
from drivers.ports import Disk
from fidim_lab.data.files.input_file import open_input
from fidim_lab.errors import FileError

_FLUSH_S = 0.1
LIMIT = 4 << 30
"""bytes, read line by line; a day of four winches at 100 Hz has 3.6 GB"""
_LONGEST_LINE = 200
"""bytes; ours have 45, and the name of a channel has at most 15"""
_LINE = re.compile(r"\(([0-9]{1,12}\.[0-9]{1,9})\) (\S+) ([0-9A-Fa-f]{3})#(R[0-8]?|(?:[0-9A-Fa-f]{2}){0,8})(?: [RT])?")


def format_line(frame: CanFrame, channel: str = "can0") -> str:
    """One frame as a line, without line end; time in µs."""
    data = "R" if frame.remote else frame.data.hex().upper()
    return f"({frame.t:017.6f}) {channel} {frame.id:03X}#{data}"


class CandumpLog:
    """Writes every frame that passes; flushed at 10 Hz of bus time, so that a killed process loses at most 0.1 s."""

    def __init__(self, path: Path, disk: Disk | None = None) -> None:
        """disk: takes the lines; whoever hands over a frame never waits. Raises FileError if it cannot be made."""
        self._file = BlockFile(path, "raw CAN log", disk)
        self._lock = threading.Lock()
        self._lines: list[str] = []
        self._closed = False
        self._flushed_at = float("-inf")

    @property
    def error(self) -> str | None:
        """Why writing ended (full disk); a tap must not raise, so whoever records has to look here."""
        return self._file.error

    def write(self, frame: CanFrame) -> None:
        """Append one frame; never raises."""
        line = format_line(frame)
        with self._lock:
            if self.error is not None or self._closed:
                return
            self._lines.append(line)
            if frame.t - self._flushed_at >= _FLUSH_S:
                self._flushed_at = frame.t
                self._flush()

    def close(self) -> None:
        """Flush and close; may be called twice."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._flush()
                self._file.close()

    def _flush(self) -> None:
        lines, self._lines = self._lines, []
        if lines:
            self._file.put(("\n".join(lines) + "\n").encode("ascii"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def read_candump(path: Path) -> Iterator[CanFrame]:
    """The frames of a log. Raises FileError naming the line that is none; a last line without an end is left out."""
    with open_input(path, LIMIT) as file:
        for number, line in enumerate(iter(partial(file.readline, _LONGEST_LINE), b""), start=1):
            if not line.endswith(b"\n") and len(line) < _LONGEST_LINE:
                return  # cut off while it was written
            if line.strip():
                yield _parse(path, number, line.decode("ascii", "replace").rstrip("\r\n"))


def _parse(path: Path, number: int, line: str) -> CanFrame:
    match = _LINE.fullmatch(line)
    if match is None:
        raise FileError(path, f"line {number}", f"{ascii(line)[:60]} is not a candump line like '(1.5) can0 181#0011'.")
    time, _, identifier, data = match.groups()
    remote = data.startswith("R")
    return CanFrame(int(identifier, 16), b"" if remote else bytes.fromhex(data), float(time), remote)
