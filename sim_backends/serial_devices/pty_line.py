"""The device's end of a serial line, as a pseudo terminal under a name that the host opens."""

import asyncio
import os
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from drivers.ports import Clock
from fidim_lab.errors import SetupError
from sim_backends.pty_link import put_link, take_link

BITS_PER_BYTE = 10
"""start, eight, stop"""
CHUNK = 16
"""bytes that an adapter hands over at once"""


class PtyLine:
    """Sends as slowly as the baud rate has it; what nobody reads is lost, as on a wire.

    Not simulated: modem lines (a pseudo terminal has none), parity, framing errors, a host with another baud rate.
    """

    def __init__(self, link: Path, baud: int, clock: Clock, received: Callable[[bytes], None]) -> None:
        """link: the name by which the host opens it; `received(data)` is called for what the host writes."""
        self.link = link
        self._per_byte = BITS_PER_BYTE / baud
        self._clock = clock
        self._received = received
        self._ends: tuple[int, int] | None = None

    @property
    def plugged(self) -> bool:
        """Whether it is there."""
        return self._ends is not None

    def plug(self) -> None:
        """Appear under the name. Raises SetupError where the name is somebody else's, or the system has no pty left."""
        if self._ends is not None:
            return
        try:
            master, host = os.openpty()
            tty.setraw(host)
            os.set_blocking(master, False)
            self._ends = master, host
            put_link(self.link, os.ttyname(host))
        except SetupError:
            self.unplug()
            raise
        except OSError as error:
            self.unplug()
            raise SetupError(f"serial line {self.link}: cannot be simulated: {error.strerror or error}.") from error
        asyncio.get_running_loop().add_reader(master, self._read, master)

    def unplug(self) -> None:
        """Vanish, as an adapter whose plug is pulled; may be called twice."""
        if self._ends is None:
            return
        (master, host), self._ends = self._ends, None
        with suppress(RuntimeError):  # the loop has ended
            asyncio.get_running_loop().remove_reader(master)
        take_link(self.link, os.ttyname(host))
        os.close(host)
        os.close(master)

    async def send(self, data: bytes) -> None:
        """Send at the line's pace; returns when the last bit is out."""
        for begin in range(0, len(data), CHUNK):
            chunk = data[begin : begin + CHUNK]
            await self._clock.sleep(len(chunk) * self._per_byte)
            if self._ends is None:
                return
            with suppress(BlockingIOError):  # nobody reads
                os.write(self._ends[0], chunk)

    def _read(self, master: int) -> None:
        try:
            data = os.read(master, 4096)
        except BlockingIOError:
            return
        except OSError:
            self.unplug()
            return
        self._received(data)
