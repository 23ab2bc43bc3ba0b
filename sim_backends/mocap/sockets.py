"""The simulated server on real sockets, in real time: `UdpSender` as Tracker does it, `TcpServer` for lines of text."""

import asyncio
import contextlib

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


class TcpServer:
    """Sends all packets to whoever is connected; nobody is waited for."""

    def __init__(self, server: MocapServer, clock: Clock, port: int = 0, host: str = "127.0.0.1") -> None:
        self._feed = ServerFeed(server, clock)
        self._address = (host, port)
        self._listener: asyncio.Server | None = None
        self._clients: set[asyncio.StreamWriter] = set()
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
        clients, self._clients = self._clients, set()
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

    async def _connected(self, _: asyncio.StreamReader, client: asyncio.StreamWriter) -> None:
        self._clients.add(client)

    async def _send(self) -> None:
        await self._feed.open()
        while True:
            _, data = await self._feed.receive()
            for client in tuple(self._clients):
                if client.is_closing():
                    self._clients.discard(client)
                else:
                    client.write(data)


async def _end(task: asyncio.Task[None] | None) -> None:
    if task is not None:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
