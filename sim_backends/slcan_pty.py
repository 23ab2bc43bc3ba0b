"""A serial CAN adapter with nothing but our nodes on its bus: SLCAN text on a pseudo terminal.

Clients open it with python-can: interface "slcan", channel = the name of the terminal. It is what an adapter on USB
looks like to the host; for several clients, or another computer, see `slcan_server`.
"""

import os
import select
import tty
from collections import deque
from pathlib import Path
from typing import Any

import can

from fidim_lab.errors import SetupError
from sim_backends.pty_link import put_link, take_link
from sim_backends.slcan_server import format_line, parse_line

_LONGEST_LINE = 64
"""bytes"""
_SEND_TIMEOUT = 1.0
"""s that a host may leave its input unread; what comes after that is lost, as in an adapter whose buffer is full"""


class SlcanPtyBus(can.BusABC):
    """Our end of the line, as a python-can bus. Used from one thread.

    Not simulated: the baud rate and USB's packets, bit rate and load of the bus, answers to commands, error frames,
    flags, extended and remote frames (ignored).
    """

    def __init__(self, link: Path | None = None) -> None:
        """link: a name for it. Raises SetupError where that is taken, or the system has no pseudo terminal left."""
        self._end = self._host = -1
        self._link = link
        self.path = ""
        """what a host opens"""
        self.plugged = True
        """false: it vanishes with its name, as an adapter whose plug is pulled; true again: it is there anew"""
        self._open()
        self.lost = 0
        """frames that the host did not take"""
        self._rest = b""
        self._queue: deque[can.Message] = deque()
        super().__init__(channel=self.path)
        self.channel_info = f"SLCAN adapter {self.path}"

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """To the host."""
        line = format_line(msg)
        while line and self._there():
            try:
                line = line[os.write(self._end, line) :]
            except BlockingIOError:
                if not select.select([], [self._end], [], _SEND_TIMEOUT)[1]:
                    self.lost += 1
                    return

    def shutdown(self) -> None:
        """Take the adapter away; may be called twice."""
        super().shutdown()
        self.plugged = False
        self._close()

    def _open(self) -> None:
        try:
            self._end, self._host = os.openpty()
            tty.setraw(self._host)
            os.set_blocking(self._end, False)
            self.path = os.ttyname(self._host)
            if self._link is not None:
                put_link(self._link, self.path)
        except SetupError:
            self._close()
            raise
        except OSError as error:
            self._close()
            raise SetupError(f"simulated CAN adapter: no pseudo terminal: {error.strerror or error}.") from error

    def _there(self) -> bool:
        """Vanish, and come back, in the thread that uses it: no descriptor is closed while it is waited at."""
        if not self.plugged:
            self._close()
        elif self._end < 0:
            self._rest = b""
            self._open()
        return self.plugged

    def _close(self) -> None:
        if self._host >= 0 and self._link is not None:
            take_link(self._link, self.path)
        for descriptor in (self._end, self._host):
            if descriptor >= 0:
                os.close(descriptor)
        self._end = self._host = -1

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        ends = [self._end] if self._there() else []
        if not self._queue and select.select(ends, [], [], timeout)[0]:
            *lines, self._rest = (self._rest[-_LONGEST_LINE:] + os.read(self._end, 1 << 16)).split(b"\r")
            self._queue += [message for line in lines if (message := parse_line(line)) is not None]
        return (self._queue.popleft() if self._queue else None), False

    def __enter__(self) -> "SlcanPtyBus":
        return self

    def __exit__(self, *_: Any) -> None:
        self.shutdown()
