"""The simulated server on real sockets, in real time: `UdpSender` as Tracker does it, `TcpServer` for byte streams.

What a server says to each of its clients (greeting, answers, frames only when asked for) is a `Session`.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Protocol

from drivers.ports import Clock
from fidim_lab.errors import SetupError
from sim_backends.mocap.server import MocapServer, ServerFeed


class UdpSender:
    """Sends each packet as a datagram to one address."""

    def __init__(self, server: MocapServer, clock: Clock, port: int, host: str = "127.0.0.1") -> None:
        self._feed = ServerFeed(server, clock)
        self._clock = clock
        self._address = (host, port)
        self._transport: asyncio.DatagramTransport | None = None
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Begin to send."""
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, remote_addr=self._address)
        self._transport = transport
        self._task = asyncio.ensure_future(self._send(transport))

    async def close(self) -> None:
        """Stop sending."""
        await _end(self._task)
        if self._transport is not None:
            self._transport.close()
            await self._clock.sleep(0.0)  # the transport lets go of its socket in the next turn of the loop

    async def _send(self, transport: asyncio.DatagramTransport) -> None:
        await self._feed.open()
        while True:
            _, data = await self._feed.receive()
            transport.sendto(data)


class Session(Protocol):
    """The server's side of one connection, without I/O."""

    def greeting(self) -> bytes:
        """What it says first."""
        ...

    def receive(self, data: bytes) -> bytes:
        """What it answers to these bytes of the client."""
        ...

    def pass_on(self, packet: bytes) -> bytes:
        """What this client gets of a frame's bytes; empty for nothing."""
        ...


class PlainSession:
    """Streams to everybody and listens to nobody."""

    def greeting(self) -> bytes:
        """Nothing."""
        return b""

    def receive(self, data: bytes) -> bytes:
        """Nothing, whatever `data` are."""
        return data[:0]

    def pass_on(self, packet: bytes) -> bytes:
        """All of it."""
        return packet


class TcpServer:
    """Sends packets to whoever is connected, as its session with each wants it; nobody is waited for."""

    def __init__(
        self,
        server: MocapServer,
        clock: Clock,
        port: int = 0,
        host: str = "127.0.0.1",
        session: Callable[[], Session] = PlainSession,
    ) -> None:
        """session: makes one for each client."""
        self._feed = ServerFeed(server, clock)
        self._address = (host, port)
        self._session = session
        self._listener: asyncio.Server | None = None
        self._clients: dict[asyncio.StreamWriter, Session] = {}
        self._task: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """Where it listens, once started."""
        return self._address[1]

    async def start(self) -> None:
        """Listen and begin to send. Raises SetupError where the port is taken."""
        host, port = self._address
        try:
            self._listener = await asyncio.start_server(self._connected, host, port)
        except OSError as error:
            raise SetupError(f"simulated motion capture {host}:{port}: cannot listen there: {error}.") from error
        self._address = (host, self._listener.sockets[0].getsockname()[1])
        self._task = asyncio.ensure_future(self._send())

    async def hang_up(self) -> None:
        """Drop every client, as a server does that is restarted; they may connect again."""
        clients, self._clients = self._clients, {}
        for client in clients:
            client.close()
            with contextlib.suppress(OSError):
                await client.wait_closed()

    async def close(self) -> None:
        """Stop sending and listening."""
        await _end(self._task)
        if self._listener is not None:
            self._listener.close()
        await self.hang_up()
        if self._listener is not None:
            await self._listener.wait_closed()

    async def _connected(self, reader: asyncio.StreamReader, client: asyncio.StreamWriter) -> None:
        session = self._session()
        client.write(session.greeting())
        self._clients[client] = session
        with contextlib.suppress(OSError):
            while data := await reader.read(1 << 16):
                if answer := session.receive(data):
                    client.write(answer)

    async def _send(self) -> None:
        await self._feed.open()
        while True:
            _, data = await self._feed.receive()
            for client, session in tuple(self._clients.items()):
                if client.is_closing():
                    del self._clients[client]
                elif wanted := session.pass_on(data):
                    client.write(wanted)


async def _end(task: asyncio.Task[None] | None) -> None:
    if task is not None:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
