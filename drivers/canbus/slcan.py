"""`SlcanBus`: python-can's SLCAN interface, read in chunks.

python-can reads its port byte by byte, at two system calls each: a frame costs 110 to 170 µs, and one Python process
cannot read a full bus of 1 Mbit/s (7407 frames/s) without falling behind. This one takes whatever has arrived at once
and cuts it into lines, and does not wait for the port after each line that it sends; what a line means, and options,
are python-can's.
"""

import os
import re
import select
import socket
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from can import Message
from can.exceptions import CanOperationError, error_check
from can.interfaces.slcan import slcanBus

_CHUNK = 1 << 16
"""bytes"""
_LINE = re.compile(rb"[^\r\a]*[\r\a]")
"""a line ends with a carriage return, or with BELL where the adapter refuses a command"""
_FRAME = re.compile(r"(?:[tr][0-7][0-9A-Fa-f]{2}|[TRx][01][0-9A-Fa-f]{7})(?P<length>[0-8])(?P<rest>[0-9A-Fa-f]*)\r")
"""a classic frame: letter, identifier, length, data, and a time stamp of 4 or 8 digits where the adapter adds one"""
_FRAME_LETTERS = "tTrRxdDbB"
_STAMPS = (0, 4, 8)
_LONGEST = 256
"""bytes without an end of line that are still waited for; the longest frame (CAN FD) has 138"""


class SlcanBus(slcanBus):
    """As `can.interfaces.slcan.slcanBus`, on a serial port, a pseudo terminal or `socket://HOST:PORT`."""

    def __init__(self, channel: str, **options: Any) -> None:
        """As of python-can; raises what its own raises."""
        self._lines: deque[str] = deque()
        super().__init__(channel, **options)

    def _read(self, timeout: float | None) -> str | None:
        """The next line, its end included; None where none is whole within `timeout` s (None: for ever).

        Raises CanOperationError where the port is gone, UnicodeDecodeError (a ValueError) for a line that is no text.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._lines:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            with error_check("Could not read from serial device"):
                data = self._chunk(left)
            self._cut(data)
            if not data and not left:
                return None
        return _checked(self._lines.popleft())

    def _recv_internal(self, timeout: float | None) -> tuple[Message | None, bool]:
        """As python-can's. Raises ValueError for a line that is no frame, whatever python-can raises for it."""
        try:
            return super()._recv_internal(timeout)
        except (LookupError, TypeError) as error:  # of CAN FD lines, which `_checked` does not take apart
            raise ValueError(f"a line that is not a frame: {error}") from error

    def _write(self, string: str) -> None:
        """Hand one line to the port.

        python-can waits after each until the port has sent it (tcdrain), in the control loop, five times a SYNC. The
        kernel keeps their order without that.
        """
        with error_check("Could not write to serial device"):
            self.serialPortOrig.write(string.encode() + self.LINE_TERMINATOR)

    def flush(self) -> None:
        """Forget what has arrived and was not asked for."""
        self._lines.clear()
        super().flush()

    def _cut(self, data: bytes) -> None:
        self._buffer += data
        end = 0
        for found in _LINE.finditer(self._buffer):
            # What is no text becomes a line that is none: it is counted as garbled where it is parsed.
            self._lines.append(found.group().decode("ascii", "replace"))
            end = found.end()
        del self._buffer[:end]
        if len(self._buffer) > _LONGEST:
            self._buffer.clear()
            raise ValueError(f"more than {_LONGEST} bytes without an end of line")

    def _chunk(self, timeout: float | None) -> bytes:
        """Whatever has arrived; empty where nothing does within `timeout` s."""
        port = self.serialPortOrig
        link = getattr(port, "_socket", None)
        if isinstance(link, socket.socket):
            return _arrived(link.fileno(), lambda: link.recv(_CHUNK), timeout)
        descriptor: int | None = getattr(port, "fd", None)  # of a serial port, on POSIX only
        if descriptor is not None:
            return _arrived(descriptor, lambda: os.read(descriptor, _CHUNK), timeout)
        port.timeout = timeout  # loop://, Windows: no descriptor to wait at
        return bytes(port.read(1)) + bytes(port.read(port.in_waiting))


def _checked(line: str) -> str:
    """The line. Raises ValueError for a frame that lost or changed characters on its way over the serial line.

    python-can takes "t18" for an index error and "t-12…" for an identifier, and keeps a frame with less data than its
    length says. Answers of the adapter (z, F00, V1013, an empty line) are no frames and pass.
    """
    if line[0] not in _FRAME_LETTERS:
        if line[0].isascii() and (line[0].isalpha() or line[0] in "\r\a"):
            return line
        raise ValueError(f"a line that is neither frame nor answer: {line[:30]!r}")
    if line[0] in "dDbB":
        return line
    found = _FRAME.fullmatch(line)
    if found is None:
        raise ValueError(f"a line that is not a frame: {line[:30]!r}")
    data = 0 if line[0] in "rR" else 2 * int(found["length"])
    if len(found["rest"]) - data not in _STAMPS:
        raise ValueError(f"a frame whose data are not as long as it says: {line[:30]!r}")
    return line


def _arrived(descriptor: int, read: Callable[[], bytes], timeout: float | None) -> bytes:
    """Raises CanOperationError where the other end has hung up."""
    if not select.select([descriptor], [], [], timeout)[0]:
        return b""
    try:
        data = read()
    except BlockingIOError:
        return b""
    if not data:
        raise CanOperationError("the adapter was disconnected")
    return data
