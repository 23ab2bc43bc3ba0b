r"""A CAN bus over TCP that speaks SLCAN, the text of serial CAN adapters: `t1812AABB\r` is frame 0x181 with AA BB.

`r7011\r` is the remote frame that asks for frame 0x701, of one byte.

Clients open it with python-can: interface "slcan", channel "socket://HOST:PORT". For simulated nodes in a process of
their own where the kernel has no CAN: nothing is lost, frames keep their order, and a plug that is pulled is noticed.
"""

import selectors
import socket
from collections import deque
from typing import Any

import can

from fidim_lab.errors import SetupError

_BACKLOG = 8
_SEND_TIMEOUT = 1.0
"""s after which a client that does not read is hung up on"""
_LONGEST_LINE = 64
"""bytes"""


class SlcanServerBus(can.BusABC):
    """Our end of the bus, as a python-can bus; each frame goes to all clients but its sender.

    Used from one thread. Not simulated: bit rate and load, error frames, flags, extended frames (ignored).
    """

    def __init__(self, host: str, port: int) -> None:
        """Listen; port 0 takes a free one. Raises SetupError where the address is taken or not this computer's."""
        self._selector = selectors.DefaultSelector()
        self._buffers: dict[socket.socket, bytes] = {}
        self._queue: deque[can.Message] = deque()
        try:
            self._listener = socket.create_server((host, port), backlog=_BACKLOG)
        except OSError as error:
            self._selector.close()
            raise SetupError(
                f"simulated CAN bus {host}:{port}: cannot listen there: {error.strerror or error}.",
                hint="Are simulators running already?",
            ) from error
        self.port: int = self._listener.getsockname()[1]
        self.plugged = True
        """false: every client is hung up on, as when the adapter's plug is pulled"""
        self._selector.register(self._listener, selectors.EVENT_READ)
        super().__init__(channel=f"{host}:{self.port}")
        self.channel_info = f"SLCAN server {host}:{self.port}"

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """To all clients."""
        self._forward(msg, None)

    def shutdown(self) -> None:
        """Hang up and stop listening; may be called twice."""
        super().shutdown()
        for client in tuple(self._buffers):
            self._drop(client)
        self._listener.close()
        self._selector.close()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._queue:
            for key, _ in self._selector.select(timeout):
                if key.fileobj is self._listener:
                    self._accept()
                elif isinstance(key.fileobj, socket.socket):
                    self._read(key.fileobj)
        return (self._queue.popleft() if self._queue else None), False

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.settimeout(_SEND_TIMEOUT)
        self._buffers[client] = b""
        self._selector.register(client, selectors.EVENT_READ)
        if not self.plugged:
            self._drop(client)

    def _read(self, client: socket.socket) -> None:
        try:
            data = client.recv(1 << 16) if self.plugged else b""
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        *lines, rest = (self._buffers[client] + data).split(b"\r")
        self._buffers[client] = rest[-_LONGEST_LINE:]
        for line in lines:
            if (message := parse_line(line)) is not None:
                self._queue.append(message)
                self._forward(message, client)

    def _forward(self, message: can.Message, sender: socket.socket | None) -> None:
        line = format_line(message)
        for client in tuple(self._buffers):
            if not self.plugged:
                self._drop(client)
            elif client is not sender:
                try:
                    client.sendall(line)
                except OSError:  # gone, or it has stopped reading
                    self._drop(client)

    def _drop(self, client: socket.socket) -> None:
        if self._buffers.pop(client, None) is not None:
            self._selector.unregister(client)
            client.close()

    def __enter__(self) -> "SlcanServerBus":
        return self

    def __exit__(self, *_: Any) -> None:
        self.shutdown()


def format_line(message: can.Message) -> bytes:
    """A standard frame as a line, its end included."""
    if message.is_remote_frame:
        return b"r%03X%d\r" % (message.arbitration_id, message.dlc)
    return b"t%03X%d%s\r" % (message.arbitration_id, message.dlc, bytes(message.data).hex().upper().encode())


def parse_line(line: bytes) -> can.Message | None:
    """The standard frame in a line without its end; None for commands (open, bit rate) and for what is none."""
    try:
        text = line.decode("ascii")
        if text[:1] not in ("t", "r") or not 0 <= int(text[4]) <= 8:
            return None
        identifier, length = int(text[1:4], 16), int(text[4])
        if text[0] == "r" and identifier <= 0x7FF:
            return can.Message(arbitration_id=identifier, is_remote_frame=True, dlc=length, is_extended_id=False)
        data = bytes.fromhex(text[5 : 5 + 2 * length])
    except (ValueError, IndexError):
        return None
    if identifier > 0x7FF or len(data) != length:
        return None
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
