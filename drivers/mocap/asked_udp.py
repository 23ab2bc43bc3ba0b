"""Datagrams from a server that streams to whoever asks, as OptiTrack's does in unicast: ask, and go on asking."""

import asyncio
import math
import socket
from dataclasses import dataclass

from drivers.mocap.feeds import DATAGRAMS_QUEUED, PAUSES, RECEIVE_BUFFER, Datagrams
from drivers.mocap.mailbox import Mailbox, MailboxClosedError
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError


@dataclass(frozen=True)
class Greeting:
    """What is said to a server that streams datagrams to whoever asks."""

    hello: bytes
    """said first, and again where nothing comes"""
    keep_alive: bytes
    """said as long as something comes"""
    every: float = 1.0
    """s"""


class AskedUdpFeed:
    """Datagrams from a server that has to be asked for them, and again and again."""

    def __init__(self, clock: Clock, host: str, port: int, greeting: Greeting) -> None:
        """host, port: the server's, which answers to where it was asked from."""
        self._clock = clock
        self._address = (host, port)
        self._greeting = greeting
        self._mailbox: Mailbox[tuple[float, bytes]] = Mailbox(DATAGRAMS_QUEUED)
        self._transport: asyncio.DatagramTransport | None = None
        self._asking: asyncio.Future[None] | None = None
        self._heard = -math.inf
        self.connection = 0
        self.overflow = 0
        """datagrams that came while the queue was full; they show as lost frames"""

    @property
    def name(self) -> str:
        """The server's address."""
        return f"motion capture {self._address[0]}:{self._address[1]}"

    hint = "Is the server streaming, in unicast, are host and port right, does a firewall block it?"

    async def open(self) -> None:
        """Say hello. Raises SetupError for an address that is none."""
        loop = asyncio.get_running_loop()
        self._mailbox = Mailbox(DATAGRAMS_QUEUED)
        try:
            self._transport, _ = await loop.create_datagram_endpoint(
                lambda: Datagrams(self._arrived), remote_addr=self._address
            )
        except OSError as error:
            raise SetupError(f"{self.name}: cannot be asked: {error.strerror or error}.", hint=self.hint) from error
        bound: socket.socket = self._transport.get_extra_info("socket")
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._heard = -math.inf
        self.connection += 1
        self._asking = asyncio.ensure_future(self._ask(self._transport))

    async def receive(self) -> tuple[float, bytes]:
        """The next datagram with its time of arrival at this process."""
        try:
            return await self._mailbox.get()
        except MailboxClosedError:
            await self._clock.sleep(PAUSES[1])
            raise DeviceError(self.name, "the socket was closed") from None

    async def close(self) -> None:
        """Free the socket; the server ends by itself where it is not asked any more."""
        self._mailbox.close()
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)
            self._asking = None
        if self._transport is not None:
            self._transport.close()
            self._transport = None
            await self._clock.sleep(0.0)

    async def _ask(self, transport: asyncio.DatagramTransport) -> None:
        """A server that was started again knows nobody, and says nothing: it hears hello once more."""
        greeting = self._greeting
        while True:
            silent = self._clock.now() - self._heard > 2.0 * greeting.every
            transport.sendto(greeting.hello if silent else greeting.keep_alive)
            await self._clock.sleep(greeting.every)

    def _arrived(self, data: bytes, sender: str) -> None:
        self._heard = self._clock.now()
        if not self._mailbox.put((self._heard, data)):
            self.overflow += 1
