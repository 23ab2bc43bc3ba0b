"""Datagrams from a server that streams on request, as OptiTrack's does: ask, and keep asking.

Its answer may be an invitation to a multicast group: then the frames come there, of the same server alone.
"""

import asyncio
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass

from drivers.mocap.feeds import RECEIVE_BUFFER, DatagramFeed, Datagrams
from drivers.mocap.sender import Address, SenderCheck
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError


@dataclass(frozen=True)
class Greeting:
    """The requests to a server that streams datagrams on request."""

    hello: bytes
    """said first, and again where nothing comes"""
    keep_alive: bytes
    """said as long as something comes"""
    every: float = 1.0
    """s"""


class AskedUdpFeed(DatagramFeed):
    """Datagrams from a server that has to be asked for them, and again and again."""

    def __init__(
        self,
        clock: Clock,
        host: str,
        port: int,
        greeting: Greeting,
        invitation: Callable[[bytes], Address | None] = lambda _: None,
    ) -> None:
        """host, port: the server's, which answers to where it was asked from.

        invitation: group and port that a datagram invites to.
        """
        super().__init__(clock, (host, port))
        self._greeting = greeting
        self._invitation = invitation
        self._group: Address | None = None
        self._joining: asyncio.Future[None] | None = None
        self._members: asyncio.DatagramTransport | None = None
        self._asking: asyncio.Future[None] | None = None

    hint = "Is the server streaming, are host and port right, does a firewall block it?"

    async def open(self) -> None:
        """Say hello. Raises SetupError for an address that is none."""
        try:
            transport, _ = await self._begin(remote=self._address)
        except OSError as error:
            raise SetupError(f"{self.name}: cannot be asked: {error.strerror or error}.", hint=self.hint) from error
        self._heard = float("-inf")
        self._senders = SenderCheck(self._clock.now, transport.get_extra_info("peername")[0])
        self._asking = asyncio.ensure_future(self._ask(transport))

    async def close(self) -> None:
        """Free the socket; the server ends by itself where it is not asked any more."""
        tasks = [task for task in (self._asking, self._joining) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._asking = self._joining = self._group = None
        if self._members is not None:
            self._members.close()
            self._members = None
        await super().close()

    def _arrived(self, data: bytes, sender: Address) -> None:
        super()._arrived(data, sender)
        if (group := self._invitation(data)) not in (None, self._group):
            self._group = group
            self._joining = asyncio.ensure_future(self._join(group))

    async def _join(self, group: Address) -> None:
        """Listen to the group, on the way by which the server is reached, for what the server sends there."""
        if self._members is not None:
            self._members.close()
        own = "0.0.0.0" if self._transport is None else self._transport.get_extra_info("sockname")[0]
        listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            listener.bind(group)
            membership = struct.pack("4s4s", socket.inet_aton(group[0]), socket.inet_aton(own))
            listener.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            endpoint = asyncio.get_running_loop().create_datagram_endpoint(
                lambda: Datagrams(self._of_the_group), sock=listener
            )
            self._members, _ = await endpoint
        except OSError as error:
            listener.close()
            problem = f"its multicast group {group[0]}:{group[1]} cannot be joined: {error.strerror or error}."
            self._mailbox.fail(DeviceError(self.name, problem, hint="Let it stream in unicast."))

    def _of_the_group(self, data: bytes, sender: Address) -> None:
        if self._senders.takes(sender):
            super()._arrived(data, sender)

    async def _ask(self, transport: asyncio.DatagramTransport) -> None:
        """A server that was started again knows nobody, and says nothing: it hears hello once more."""
        greeting = self._greeting
        while True:
            silent = self._clock.now() - self._heard > 2.0 * greeting.every
            transport.sendto(greeting.hello if silent else greeting.keep_alive)
            await self._clock.sleep(greeting.every)
