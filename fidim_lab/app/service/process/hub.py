"""The asyncio side of the socket: connections in, bytes out; nobody who reads slowly, or not at all, is waited for.

Writing never waits: what a client has not read yet is kept up to `BACKLOG` bytes, then the client is dropped. What
clients ask for is done one thing at a time, by turns, and for no longer than `TURN` before everything else in this
process has its turn: SYNC goes out between. A client that asks for more than `COMMANDS` a second is read no further.
Of one that has gone before its turn only a stop is still done.
"""

import asyncio
import os
import socket
from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import EmergencyStop, Hello, Message, Request
from fidim_lab.app.service.messages import Answer, Refusal, Samples
from fidim_lab.app.service.process.session import ConversationStage, ServerSession
from fidim_lab.errors import SetupError

BACKLOG = 2 << 20
"""bytes that a client may be behind; half a minute of everything"""
CLIENTS = 32
"""at the user's own socket, at most; one more is refused"""
CLIENTS_TCP = 16
"""on TCP, where anybody on this computer can connect: places apart, of which those who say nothing leave first"""
HELLO_WITHIN = 10.0
"""s in which a connection says hello, or is dropped"""
TURN = 0.001
"""s of work for clients at a time, a tenth of a SYNC period of 100 Hz; it ends with the piece that is being done"""
COMMANDS, BURST = 20.0, 40.0
"""a second of one client, and at once: more than hands and scripts give; each is told to every other client"""
PENDING = 64
"""connections that wait to be accepted: all of them in one turn of the loop"""


class Hub:
    """All connections of one service.

    answer: what comes of a request. greet: what a new client is told first, line by line. left: a client has gone.
    """

    def __init__(
        self,
        answer: Callable[[ServerSession, Request], Answer],
        greet: Callable[[ServerSession], Iterator[bytes]],
        left: Callable[[ServerSession], None],
    ) -> None:
        self._answer = answer
        self._greet = greet
        self._left = left
        self._connections: set[_Connection] = set()
        self._servers: list[asyncio.Server] = []
        self._busy: deque[_Connection] = deque()
        """who has something to be done, in the order of their turns"""
        self._turning = False
        self._number = 0
        self.dropped = 0
        """clients that did not read"""

    @property
    def clients(self) -> int:
        """Those that have said hello."""
        return sum(c.session.stage is ConversationStage.TALKING for c in self._connections)

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
        made = await loop.create_unix_server(lambda: self._connection(""), sock=listener, backlog=PENDING)
        self._servers.append(made)

    async def listen_tcp(self, port: int, token: str) -> int:
        """Listen on this computer only (127.0.0.1), for clients that know the token; returns the port."""
        if not token:
            raise SetupError("A service on TCP needs a token.")
        loop = asyncio.get_running_loop()
        server = await loop.create_server(lambda: self._connection(token), "127.0.0.1", port, backlog=CLIENTS_TCP)
        self._servers.append(server)
        return int(server.sockets[0].getsockname()[1])

    def tell(self, message: Message) -> None:
        """Tell every client; never waits."""
        if not self._connections:
            return
        data, live = encode(message), isinstance(message, Samples)
        for connection in tuple(self._connections):
            if connection.session.stage is ConversationStage.TALKING and (not live or connection.session.hello.samples):
                connection.write(data)

    def close(self) -> None:
        """Close all; what was written is still sent to those who read."""
        for server in self._servers:
            server.close()
        for connection in tuple(self._connections):
            connection.end()

    def _connection(self, token: str) -> "_Connection":
        self._number += 1
        return _Connection(self, ServerSession(self._number, token), trusted=not token)

    def came(self, connection: "_Connection") -> None:
        """A connection is there."""
        others = [other for other in self._connections if other.trusted == connection.trusted]
        places = CLIENTS if connection.trusted else CLIENTS_TCP
        if len(others) >= places:
            silent = [other for other in others if other.session.stage is ConversationStage.EXPECTS_HELLO]
            if not silent:
                connection.write(encode(Refusal(says=f"Already {places} clients are connected.")))
                connection.end()
                return
            oldest = min(silent, key=lambda other: other.session.number)
            oldest.end()
            self._connections.discard(oldest)
        self._connections.add(connection)

    def gone(self, connection: "_Connection") -> None:
        """A connection has ended, whoever ended it."""
        self.dropped += connection.overrun
        if connection in self._connections:
            self._connections.discard(connection)
            self._left(connection.session)

    def turn_for(self, connection: "_Connection") -> None:
        """A connection has something to be done."""
        if connection not in self._busy:
            self._busy.append(connection)
        if not self._turning:
            self._turning = True
            asyncio.get_running_loop().call_soon(self._turn)

    def _turn(self) -> None:
        """One thing for each who waits, by turns; what is left comes after everything else in this process."""
        loop = asyncio.get_running_loop()
        begun = loop.time()
        while self._busy:
            connection = self._busy.popleft()
            if connection.work():
                self._busy.append(connection)
            if loop.time() - begun >= TURN:
                break
        self._turning = bool(self._busy)
        if self._turning:
            loop.call_soon(self._turn)

    def take(self, connection: "_Connection", message: Hello | Request | Refusal) -> None:
        """What a client says."""
        match message:
            case Hello():
                connection.greet(self._greet(connection.session))
            case Request():
                connection.write(encode(self._answer(connection.session, message)))
            case Refusal():
                connection.write(encode(message))
                connection.end()


class _Connection(asyncio.Protocol):
    """One client's transport and its session."""

    def __init__(self, hub: Hub, session: ServerSession, *, trusted: bool) -> None:
        self.session = session
        self.trusted = trusted
        """came by the user's own socket"""
        self.overrun = False
        self._hub = hub
        self._transport: asyncio.Transport | None = None
        self._greeting: asyncio.TimerHandle | None = None
        self._first: Iterator[bytes] | None = None
        """what is left of the greeting"""
        self._after: list[bytes] = []
        """what was told meanwhile, and comes after it"""
        self._behind = 0
        """bytes of it"""
        self._reads = True
        self._allowed = BURST
        """commands that may come at once now"""
        self._counted = asyncio.get_running_loop().time()
        self._again: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
            self._greeting = asyncio.get_running_loop().call_later(HELLO_WITHIN, self._silent)
            self._hub.came(self)

    def data_received(self, data: bytes) -> None:
        self.session.add(data)
        self._due()

    def pause_writing(self) -> None:
        """The client is behind: the rest of the greeting waits."""
        self._reads = False

    def resume_writing(self) -> None:
        """It has read."""
        self._reads = True
        self._due()

    def connection_lost(self, exc: Exception | None) -> None:
        for message in islice(iter(self.session.next, None), int(BURST)):  # said, and not its turn before it was killed
            if isinstance(message, Request) and isinstance(message.command, EmergencyStop):
                self._hub.take(self, message)
        self.session.stage = ConversationStage.CLOSED
        self._first = None
        for timer in (self._greeting, self._again):
            if timer is not None:
                timer.cancel()
        self._hub.gone(self)

    def greet(self, lines: Iterator[bytes]) -> None:
        """Say these first, one at a time."""
        self._first = lines

    def work(self) -> bool:
        """Do the next pending task, commands before greetings; returns whether more may be pending."""
        if self.session.waits and self._may_ask():
            if (message := self.session.next()) is not None:
                self._hub.take(self, message)
            return True
        if self._first is not None and self._reads:  # else `resume_writing` comes back
            line = next(self._first, None)
            if line is None:
                line = b"".join(self._after)
                self._first = None
                self._after.clear()
                self._behind = 0
            self._send(line)
            return True
        if not self.session.waits and self._transport is not None:
            self._transport.resume_reading()
        return False

    def write(self, data: bytes) -> None:
        """Hand over bytes, after the greeting; drop a client that is too far behind."""
        if self._first is None:
            self._send(data)
            return
        self._after.append(data)
        self._behind += len(data)
        if self._behind > BACKLOG:
            self._drop()

    def end(self) -> None:
        """Close after what was written has been sent."""
        if self._transport is not None:
            self._transport.close()

    def _send(self, data: bytes) -> None:
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        if transport.get_write_buffer_size() > BACKLOG:
            self._drop()
            return
        transport.write(data)

    def _drop(self) -> None:
        self.overrun = True
        if self._transport is not None:
            self._transport.abort()

    def _due(self) -> None:
        if self._first is not None or self.session.waits:
            self._hub.turn_for(self)

    def _may_ask(self) -> bool:
        """Whether another command is allowed now; else the client is read no further until one is."""
        loop, transport = asyncio.get_running_loop(), self._transport
        now = loop.time()
        self._allowed = min(self._allowed + COMMANDS * (now - self._counted), BURST)
        self._counted = now
        if self._allowed >= 1.0:
            self._allowed -= 1.0
            return True
        if self._again is None and transport is not None and not transport.is_closing():
            transport.pause_reading()
            self._again = loop.call_later((1.0 - self._allowed) / COMMANDS, self._go_on)
        return False

    def _go_on(self) -> None:
        """Another command is allowed; more is read once all that has been read is answered."""
        self._again = None
        self._due()

    def _silent(self) -> None:
        if self.session.stage is ConversationStage.EXPECTS_HELLO:
            self.end()
