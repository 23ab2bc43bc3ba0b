"""One serial port with pyserial: reopened when possible, read by a thread, written without waiting.

The port is all that knows of pyserial. A plug that is pulled is a state of it, never an exception of the reader.
"""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import cast

import serial

from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError

RETRY = 1.0
"""s between two attempts to open"""
READ_WAIT = 0.1
"""s after which the reading thread looks whether it is to end"""
WRITE_WAIT = 0.2
"""s that a command may take to be handed to the adapter"""


class SerialPort:
    """Bytes of a serial port; `received(data, t)` and `changed(connected)` are called in the event loop."""

    def __init__(
        self,
        url: str,
        baud: int,
        clock: Clock,
        device: str,
        received: Callable[[bytes, float], None],
        changed: Callable[[bool], None],
    ) -> None:
        """url: as pyserial takes it: "/dev/ttyUSB0", "COM3", "socket://host:port". device: its name in messages."""
        self.url = url
        self.problem = "was not opened yet"
        """why it is not connected"""
        self._baud = baud
        self._clock = clock
        self._device = device
        self._received = received
        self._changed = changed
        self._port: serial.Serial | None = None
        self._tried = float("-inf")

    @property
    def connected(self) -> bool:
        """Whether it is open, as far as is known."""
        return self._port is not None

    async def keep_open(self) -> None:
        """Open it where it is closed and the last attempt is a while ago; what goes wrong is in `problem`.

        Raises SetupError for a URL that pyserial does not know.
        """
        if self._port is not None or self._clock.now() - self._tried < RETRY:
            return
        self._tried = self._clock.now()
        try:
            port = await asyncio.to_thread(self._open)
        except (serial.SerialException, OSError) as error:
            self.problem = _words(error)
            return
        except ValueError as error:
            raise SetupError(f"{self._device}: port {self.url!r} cannot be used: {error}.") from error
        self._port, self.problem = port, ""
        loop = asyncio.get_running_loop()
        threading.Thread(target=self._read, args=(port, loop), name=f"serial {self._device}", daemon=True).start()
        self._changed(True)

    def write(self, data: bytes) -> None:
        """Hand bytes over. Raises DeviceError where it is not connected or does not take them; then it is closed."""
        port = self._port
        if port is None:
            raise DeviceError(self._device, f"is not connected: {self.url}: {self.problem}.", hint="Check its plug.")
        try:
            port.write(data)
        except (serial.SerialException, OSError) as error:
            self._lost(port, _words(error))
            raise DeviceError(self._device, f"does not accept a command: {self.problem}.") from error

    def close(self) -> None:
        """Let it go; may be called twice."""
        if self._port is not None:
            self._lost(self._port, "closed")

    def _open(self) -> serial.Serial:
        port = cast(
            "serial.Serial",
            serial.serial_for_url(self.url, do_not_open=True, baudrate=self._baud, timeout=READ_WAIT),
        )
        port.write_timeout = WRITE_WAIT
        if "://" not in self.url:
            port.exclusive = True  # two programs on one line take each other's answers
        port.open()
        with contextlib.suppress(OSError, serial.SerialException):
            port.reset_input_buffer()  # what waited there is old
        return port

    def _read(self, port: serial.Serial, loop: asyncio.AbstractEventLoop) -> None:
        problem = ""
        while not problem:
            try:
                data = port.read(max(1, min(port.in_waiting, 4096)))
            except Exception as error:  # pyserial raises TypeError too, for a port that is closed under it
                problem = _words(error)
                data = b""
            if self._port is not port:
                return
            with contextlib.suppress(RuntimeError):  # the loop has ended
                if data:
                    loop.call_soon_threadsafe(self._arrived, port, data)
                elif problem:
                    loop.call_soon_threadsafe(self._lost, port, problem)

    def _arrived(self, port: serial.Serial, data: bytes) -> None:
        if self._port is port:
            self._received(data, self._clock.now())

    def _lost(self, port: serial.Serial, problem: str) -> None:
        if self._port is not port:
            return
        self._port, self.problem = None, problem
        with contextlib.suppress(Exception):  # it is gone
            port.close()
        self._changed(False)


def _words(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return str(text).rstrip(".") or type(error).__name__
