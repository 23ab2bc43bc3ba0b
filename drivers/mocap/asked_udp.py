"""Datagrams from a server that streams to whoever asks, as OptiTrack's does in unicast: ask, and go on asking."""

import asyncio
from dataclasses import dataclass

from drivers.mocap.feeds import DatagramFeed
from drivers.ports import Clock
from fidim_lab.errors import SetupError


@dataclass(frozen=True)
class Greeting:
    """What is said to a server that streams datagrams to whoever asks."""

    hello: bytes
    """said first, and again where nothing comes"""
    keep_alive: bytes
    """said as long as something comes"""
    every: float = 1.0
    """s"""


class AskedUdpFeed(DatagramFeed):
    """Datagrams from a server that has to be asked for them, and again and again."""

    def __init__(self, clock: Clock, host: str, port: int, greeting: Greeting) -> None:
        """host, port: the server's, which answers to where it was asked from."""
        super().__init__(clock, (host, port))
        self._greeting = greeting
        self._asking: asyncio.Future[None] | None = None

    hint = "Is the server streaming, in unicast, are host and port right, does a firewall block it?"

    async def open(self) -> None:
        """Say hello. Raises SetupError for an address that is none."""
        try:
            transport, _ = await self._begin(remote=self._address)
        except OSError as error:
            raise SetupError(f"{self.name}: cannot be asked: {error.strerror or error}.", hint=self.hint) from error
        self._heard = float("-inf")
        self._asking = asyncio.ensure_future(self._ask(transport))

    async def close(self) -> None:
        """Free the socket; the server ends by itself where it is not asked any more."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)
            self._asking = None
        await super().close()

    async def _ask(self, transport: asyncio.DatagramTransport) -> None:
        """A server that was started again knows nobody, and says nothing: it hears hello once more."""
        greeting = self._greeting
        while True:
            silent = self._clock.now() - self._heard > 2.0 * greeting.every
            transport.sendto(greeting.hello if silent else greeting.keep_alive)
            await self._clock.sleep(greeting.every)
