"""The asyncio side of the socket: connections in, bytes out; nobody who reads slowly, or not at all, is waited for.

Writing never waits: what a client has not read yet is kept up to `BACKLOG` bytes, then the client is dropped.
"""

import asyncio
import os
import socket
from collections.abc import Callable, Sequence
from pathlib import Path

from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import Hello, Message, Request
from fidim_lab.app.service.messages import Answer, Refusal, Samples
from fidim_lab.app.service.session import ServerSession, Stage
from fidim_lab.errors import SetupError

BACKLOG = 2 << 20
"""bytes that a client may be behind; half a minute of everything"""
CLIENTS = 32
"""at most; one more is refused"""
HELLO_WITHIN = 10.0
"""s in which a connection says hello, or is dropped"""


class Hub:
    """All connections of one service.

    answer: what comes of a request. greet: what a new client is told first. left: a client has gone.
    """

    def __init__(
        self,
        answer: Callable[[ServerSession, Request], Answer],
        greet: Callable[[ServerSession], Sequence[Message]],
        left: Callable[[ServerSession], None],
    ) -> None:
        self._answer = answer
        self._greet = greet
        self._left = left
        self._connections: set[_Connection] = set()
        self._servers: list[asyncio.Server] = []
        self._number = 0
        self.dropped = 0
        """clients that did not read"""

    @property
    def clients(self) -> int:
        """Those that have said hello."""
        return sum(c.session.stage is Stage.TALKING for c in self._connections)

    async def listen_unix(self, path: Path) -> None:
        """Listen at a socket of the user's own (mode 0600). Raises SetupError where it cannot be made."""
        path.unlink(missing_ok=True)  # whoever holds the rig's lock owns its name
        listener = socket.socket(socket.AF_UNIX)
        before = os.umask(0o177)
        try:
            listener.bind(str(path))
        except OSError as error:
            listener.close()
            raise SetupError(f"{path}: the service's socket cannot be made: {error.strerror or error}.") from error
        finally:
            os.umask(before)
        loop = asyncio.get_running_loop()
        self._servers.append(await loop.create_unix_server(lambda: self._connection(""), sock=listener))

    async def listen_tcp(self, port: int, token: str) -> int:
        """Listen on this computer only (127.0.0.1), for clients that know the token; returns the port."""
        if not token:
            raise SetupError("A service on TCP needs a token.")
        loop = asyncio.get_running_loop()
        server = await loop.create_server(lambda: self._connection(token), "127.0.0.1", port)
        self._servers.append(server)
        return int(server.sockets[0].getsockname()[1])

    def tell(self, message: Message) -> None:
        """Tell every client; never waits."""
        if not self._connections:
            return
        data, live = encode(message), isinstance(message, Samples)
        for connection in tuple(self._connections):
            if connection.session.stage is Stage.TALKING and (not live or connection.session.hello.samples):
                connection.write(data)

    def close(self) -> None:
        """Close all; what was written is still sent to those who read."""
        for server in self._servers:
            server.close()
        for connection in tuple(self._connections):
            connection.end()

    def _connection(self, token: str) -> "_Connection":
        self._number += 1
        return _Connection(self, ServerSession(self._number, token))

    def came(self, connection: "_Connection") -> None:
        """A connection is there."""
        if len(self._connections) >= CLIENTS:
            connection.write(encode(Refusal(says=f"There are {CLIENTS} clients already.")))
            connection.end()
            return
        self._connections.add(connection)

    def gone(self, connection: "_Connection") -> None:
        """A connection has ended, whoever ended it."""
        self.dropped += connection.overrun
        if connection in self._connections:
            self._connections.discard(connection)
            self._left(connection.session)

    def take(self, connection: "_Connection", message: Hello | Request | Refusal) -> None:
        """What a client says."""
        match message:
            case Hello():
                for said in self._greet(connection.session):
                    connection.write(encode(said))
            case Request():
                connection.write(encode(self._answer(connection.session, message)))
            case Refusal():
                connection.write(encode(message))
                connection.end()


class _Connection(asyncio.Protocol):
    """One client's transport and its session."""

    def __init__(self, hub: Hub, session: ServerSession) -> None:
        self.session = session
        self.overrun = False
        self._hub = hub
        self._transport: asyncio.Transport | None = None
        self._greeting: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
            self._greeting = asyncio.get_running_loop().call_later(HELLO_WITHIN, self._silent)
            self._hub.came(self)

    def data_received(self, data: bytes) -> None:
        for message in self.session.receive(data):
            self._hub.take(self, message)

    def connection_lost(self, exc: Exception | None) -> None:
        self.session.stage = Stage.CLOSED
        if self._greeting is not None:
            self._greeting.cancel()
        self._hub.gone(self)

    def write(self, data: bytes) -> None:
        """Hand over bytes; drop a client that is too far behind."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        if transport.get_write_buffer_size() > BACKLOG:
            self.overrun = True
            transport.abort()
            return
        transport.write(data)

    def end(self) -> None:
        """Close after what was written has been sent."""
        if self._transport is not None:
            self._transport.close()

    def _silent(self) -> None:
        if self.session.stage is Stage.EXPECTS_HELLO:
            self.end()
