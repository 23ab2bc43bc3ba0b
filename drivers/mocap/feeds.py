"""Sources of motion-capture bytes: UDP datagrams or a TCP stream. `source` reads them through `ByteFeed`.

A simulated server offers the same port in process (`sim_backends.mocap`). All waits go by the Clock port.
"""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Protocol

from drivers.clock import within
from drivers.mocap.mailbox import Mailbox, MailboxClosedError
from drivers.mocap.sender import Address, SenderCheck
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError

RECEIVE_BUFFER = 1 << 20
"""bytes asked of the kernel: 20 s at 200 Hz survive a stalled process (Linux may grant less)"""
DATAGRAMS_QUEUED = 4096
CONNECT_TIMEOUT = 5.0
"""s"""
PAUSES = (0.1, 2.0)
"""s, first and longest pause between two attempts to connect"""


class ByteFeed(Protocol):
    """Something that delivers datagrams or pieces of a byte stream with their time of arrival; one task reads it."""

    @property
    def name(self) -> str:
        """As in messages, e.g. "motion capture 127.0.0.1:51001"."""
        ...

    @property
    def hint(self) -> str:
        """What to check when nothing arrives."""
        ...

    @property
    def connection(self) -> int:
        """How many connections were made so far: when it changes, a new byte stream has begun."""
        ...

    async def open(self) -> None:
        """Start to listen. Raises SetupError or DeviceError."""
        ...

    async def receive(self) -> tuple[float, bytes]:
        """Monotonic s of arrival, and the bytes; waits until there are some.

        Raises DeviceError when the connection fails; the next call tries again after a pause (by the clock).
        """
        ...

    async def close(self) -> None:
        """Free the socket; may be called twice, and before `open`."""
        ...


class DatagramFeed:
    """Common to feeds of datagrams: a socket, and a queue that drops what nobody fetches."""

    def __init__(self, clock: Clock, address: tuple[str, int]) -> None:
        self._clock = clock
        self._address = address
        self._mailbox: Mailbox[tuple[float, bytes]] = Mailbox(DATAGRAMS_QUEUED)
        self._senders = SenderCheck(clock.now)
        self._transport: asyncio.DatagramTransport | None = None
        self._heard = float("-inf")
        """monotonic s of the newest datagram"""
        self.connection = 0
        self.overflow = 0
        """datagrams that came while the queue was full; they show as lost frames"""

    @property
    def foreign(self) -> int:
        """Datagrams that were left out, since somebody else sent them."""
        return self._senders.foreign

    @property
    def left_out(self) -> str:
        """The origin of the newest of them, in words."""
        return self._senders.left_out

    @property
    def name(self) -> str:
        """Its address; an ephemeral port (0) is replaced by the real one once open."""
        return f"motion capture {self._address[0]}:{self._address[1]}"

    async def receive(self) -> tuple[float, bytes]:
        """The next datagram with its time of arrival at this process."""
        try:
            return await self._mailbox.get()
        except MailboxClosedError:
            await self._clock.sleep(PAUSES[1])
            raise DeviceError(self.name, "the socket was closed") from None

    async def close(self) -> None:
        """Free the socket."""
        self._mailbox.close()
        if self._transport is not None:
            self._transport.close()
            self._transport = None
            await self._clock.sleep(0.0)  # the transport lets go of its socket in the next turn of the loop

    async def _begin(
        self, *, local: tuple[str, int] | None = None, remote: tuple[str, int] | None = None
    ) -> tuple[asyncio.DatagramTransport, socket.socket]:
        """Open the socket at an address, or towards one. Raises OSError."""
        self._mailbox = Mailbox(DATAGRAMS_QUEUED)
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: Datagrams(self._arrived), local_addr=local, remote_addr=remote
        )
        bound: socket.socket = self._transport.get_extra_info("socket")
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self.connection += 1
        return self._transport, bound

    def _takes(self, sender: Address) -> bool:
        return True  # of a socket that is connected the kernel takes its peer's alone

    def _arrived(self, data: bytes, sender: Address) -> None:
        if not self._takes(sender):
            return
        self._heard = self._clock.now()
        if not self._mailbox.put((self._heard, data)):
            self.overflow += 1


class UdpFeed(DatagramFeed):
    """Datagrams that arrive at a local address, of one sender: see `SenderCheck`."""

    def __init__(self, clock: Clock, port: int, host: str = "0.0.0.0", *, sender: str | None = None) -> None:
        """sender: its address, where it is known."""
        super().__init__(clock, (host, port))
        self._senders = SenderCheck(clock.now, sender)

    @property
    def port(self) -> int:
        """The port that is listened at."""
        return self._address[1]

    hint = (
        "Is the stream enabled in Tracker, is its address this computer's, is the port right, does a firewall block it?"
    )

    async def open(self) -> None:
        """Bind the socket. Raises SetupError where the address is taken or not this computer's."""
        try:
            _, bound = await self._begin(local=self._address)
        except OSError as error:
            raise SetupError(
                f"{self.name}: cannot listen there: {error.strerror or error}.",
                hint="Is another program listening on this port, is the address one of this computer's?",
            ) from error
        self._address = (self._address[0], bound.getsockname()[1])

    def _takes(self, sender: Address) -> bool:
        return self._senders.takes(sender)


class Datagrams(asyncio.DatagramProtocol):
    """Hands on what arrives, with its sender's address."""

    def __init__(self, arrived: "_Arrived") -> None:
        self._arrived = arrived

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """One datagram."""
        self._arrived(data, addr)


class _Arrived(Protocol):
    def __call__(self, data: bytes, sender: Address) -> None: ...


class Conversation(Protocol):
    """A client's side of a protocol with requests: a new one for each connection, without I/O."""

    def receive(self, data: bytes) -> bytes:
        """The bytes to send after these bytes of the server; may be empty."""
        ...


class TcpFeed:
    """A byte stream from a server that is connected to, and connected to again after it was lost."""

    def __init__(
        self, clock: Clock, host: str, port: int, *, conversation: Callable[[], Conversation] | None = None
    ) -> None:
        """conversation: makes what answers the server, where it waits to be asked."""
        self._clock = clock
        self._converse = conversation
        self._conversation: Conversation | None = None
        self._host = host
        self._port = port
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._pause = PAUSES[0]
        self.connection = 0

    @property
    def name(self) -> str:
        """The server's address."""
        return f"motion capture {self._host}:{self._port}"

    hint = "Is the server running and streaming, are host and port right?"

    async def open(self) -> None:
        """Connect. Raises DeviceError where nobody answers."""
        connecting = asyncio.open_connection(self._host, self._port)
        try:
            self._streams = await within(self._clock, CONNECT_TIMEOUT, connecting)
        except TimeoutError as error:
            raise DeviceError(self.name, f"no answer within {CONNECT_TIMEOUT:g} s.", hint=self.hint) from error
        except OSError as error:
            raise DeviceError(self.name, f"cannot connect: {error.strerror or error}.", hint=self.hint) from error
        self._conversation = self._converse() if self._converse is not None else None
        self.connection += 1

    async def receive(self) -> tuple[float, bytes]:
        """The next bytes. Raises DeviceError when the connection is lost or cannot be made."""
        if self._streams is None:
            await self._clock.sleep(self._pause)
            self._pause = min(2.0 * self._pause, PAUSES[1])
            await self.open()
        if self._streams is None:
            raise DeviceError(self.name, "the connection was closed")
        try:
            data = await self._streams[0].read(1 << 16)
        except OSError as error:
            await self.close()
            raise DeviceError(self.name, f"connection lost: {error.strerror or error}.", hint=self.hint) from error
        if not data:
            await self.close()
            raise DeviceError(self.name, "the server closed the connection.", hint=self.hint)
        arrival = self._clock.now()
        self._pause = PAUSES[0]
        if self._conversation is not None and (answer := self._conversation.receive(data)):
            self._streams[1].write(answer)
        return arrival, data

    async def close(self) -> None:
        """Hang up."""
        if self._streams is not None:
            _, writer = self._streams
            self._streams = None
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()
