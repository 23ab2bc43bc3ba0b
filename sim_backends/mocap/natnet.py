"""OptiTrack's NatNet server, written from the format alone (nothing here knows the decoder).

`NatNetEncoder` makes frames as Motive does: a marker set "all", one rigid body, and the labelled markers with their
flags. `NatNetServer` says who it is to whoever asks, and streams to those that have asked lately, or to a group.
"""

import asyncio
import math
import socket
import struct
from collections.abc import Callable, Sequence

from drivers.ports import Clock
from fidim_lab.errors import SetupError
from sim_backends.mocap.encoders import Positions
from sim_backends.mocap.server import MocapServer, ServerFeed

PATIENCE = 10.0
"""s without a word after which a client gets nothing more"""
_PING, _INFO, _FRAME, _ALIVE = 0, 1, 7, 10
_OCCLUDED, _MADE_UP, _SEEN, _OF_A_MODEL = 0x01, 0x04, 0x02, 0x08


class NatNetEncoder:
    """Frames of labelled markers, by streaming ID of their asset and number there."""

    is_stream = False

    def __init__(self, markers: Sequence[tuple[int, int]], version: tuple[int, int] = (4, 1)) -> None:
        """version: of NatNet, 3.0 or later."""
        self.version = version
        self._ids = [(asset << 16) | number for asset, number in markers]
        self._last: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)] * len(self._ids)

    def encode(self, number: int, positions: Positions) -> bytes:
        """One datagram; positions in m. A marker that is not seen is sent where it was, and flagged."""
        labelled, points = b"", b""
        for index, position in enumerate(positions):
            flags = _OF_A_MODEL | (_OCCLUDED | _MADE_UP if position is None else _SEEN)
            self._last[index] = place = self._last[index] if position is None else position
            labelled += struct.pack("<I3ffHf", self._ids[index], *place, 0.012, flags, 2e-4)
            points += struct.pack("<3f", *place)
        count = len(positions)
        named = b"all\0" + struct.pack("<I", count) + points
        body = struct.pack("<I3f4ffH", 1, *(self._last[0] if count else (0.0,) * 3), 0.0, 0.0, 0.0, 1.0, 1e-4, 1)
        stamps = struct.pack("<IIdQQQH", 0, 0, number / 100.0, 0, 0, 0, 0)
        parts = self._part(1, named) + self._part(0, b"") + self._part(1, body) + self._part(0, b"")
        if self.version >= (4, 1):
            parts += self._part(0, b"")  # assets
        parts += self._part(count, labelled) + self._part(0, b"")
        parts += self._part(0, b"")  # force plates were before, these are devices
        frame = struct.pack("<I", number % 2**32) + parts + stamps + bytes(4)
        return struct.pack("<HH", _FRAME, len(frame)) + frame

    def about(self, group: tuple[str, int] | None = None) -> bytes:
        """What the server says of itself. group: the multicast address that it streams to."""
        own = bytes((*self.version, 0, 0))
        address, port = ("0.0.0.0", 1511) if group is None else group
        where = struct.pack("<QHB4s", 10**9, port, group is not None, socket.inet_aton(address))
        body = b"Motive".ljust(256, b"\0") + bytes((3, 0, 0, 0)) + own + where
        return struct.pack("<HH", _INFO, len(body)) + body

    def _part(self, count: int, items: bytes) -> bytes:
        size = struct.pack("<I", len(items)) if self.version >= (4, 1) else b""
        return struct.pack("<I", count) + size + items


class NatNetServer:
    """One UDP socket: answers and streams."""

    def __init__(
        self,
        server: MocapServer,
        about: bytes,
        clock: Clock,
        port: int = 0,
        host: str = "127.0.0.1",
        group: tuple[str, int] | None = None,
    ) -> None:
        """about: what it says of itself (`NatNetEncoder.about`); group: where it streams instead of to its clients."""
        self._group = group
        self._about = about
        self._feed = ServerFeed(server, clock)
        self._clock = clock
        self._address = (host, port)
        self._heard: dict[tuple[str, int], float] = {}
        self._transport: asyncio.DatagramTransport | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """Where it listens, once started."""
        return self._address[1]

    async def start(self) -> None:
        """Listen and begin to take frames. Raises SetupError where the port is taken."""
        loop = asyncio.get_running_loop()
        try:
            transport, _ = await loop.create_datagram_endpoint(lambda: _Clients(self._asked), local_addr=self._address)
        except OSError as error:
            host, port = self._address
            raise SetupError(f"simulated motion capture {host}:{port}: cannot listen there: {error}.") from error
        self._address = (self._address[0], transport.get_extra_info("sockname")[1])
        if self._group is not None:
            way = socket.inet_aton(self._address[0])
            transport.get_extra_info("socket").setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, way)
        self._transport = transport
        self._task = asyncio.ensure_future(self._send(transport))

    async def close(self) -> None:
        """Stop."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self._transport is not None:
            self._transport.close()
            await self._clock.sleep(0.0)

    def _asked(self, data: bytes, client: tuple[str, int]) -> None:
        (what,) = struct.unpack_from("<H", data) if len(data) >= 4 else (math.nan,)
        if what == _PING and self._transport is not None:
            self._transport.sendto(self._about, client)
        if what == _PING or (what == _ALIVE and client in self._heard):
            self._heard[client] = self._clock.now()

    async def _send(self, transport: asyncio.DatagramTransport) -> None:
        await self._feed.open()
        while True:
            _, data = await self._feed.receive()
            if self._group is not None:
                transport.sendto(data, self._group)
                continue
            now = self._clock.now()
            for client, heard in tuple(self._heard.items()):
                if now - heard > PATIENCE:
                    del self._heard[client]
                else:
                    transport.sendto(data, client)


class _Clients(asyncio.DatagramProtocol):
    def __init__(self, asked: Callable[[bytes, tuple[str, int]], None]) -> None:
        self._asked = asked

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._asked(data, addr)
