"""OptiTrack NatNet 3.0 and later (Motive 2.0 and later) in unicast: labelled markers with their occlusion flag.

    message     u16 what it is, u16 bytes that follow; all little endian
    hello       what = 0, "Ping": answered by what = 1, name of the server (256 bytes), its version (4), NatNet's (4)
    keep alive  what = 10, nothing: without it a unicast server ends after some seconds
    frame       what = 7: u32 number, marker sets, other markers, rigid bodies, skeletons, [assets], labelled markers, …

Each part of a frame begins with the count of its items; from NatNet 4.1 on also with its size in bytes. A labelled
marker has the streaming ID of its asset and its number there (id = asset · 65536 + number), x, y, z in metres, and
flags: bit 0 says that no camera saw it (a place that Motive has made up is none), bit 4 that no label belongs to it.
In multicast the server's answer to hello names the group and the port of the frames (`invitation`). Written after other
people's clients; checked by PyPI's `natnet`, which reads our simulated server.
"""

import socket
import struct

from drivers.mocap.decoders.decoder import UNLABELLED, DecodedFrame, Event, Malformed, Position, frame_of

CONNECT, SERVER_INFO, FRAME, KEEP_ALIVE = 0, 1, 7, 10
OLDEST, SIZED = (3, 0), (4, 1)
"""versions: the first that is read, the first whose parts say their size"""
_HEAD = struct.Struct("<HH")
_U32 = struct.Struct("<I")
_LABELLED = struct.Struct("<I3ffHf")
_OCCLUDED, _UNLABELLED = 0x01, 0x10
_RIGID_BODY, _POINT = 38, 12
_VERSIONS = 256 + 4
"""bytes of the server's answer before NatNet's own version"""
_CONNECTION = struct.Struct("<QH?4s")
"""after the versions: clock's ticks a second, port of the frames, whether in multicast, to which group"""
NO_LABEL = -1
"""stands for the id of a marker that belongs to no asset"""


def hello() -> bytes:
    """Asks the server who it is, and to stream to whoever asks."""
    return _message(CONNECT, b"Ping\0")


def keep_alive() -> bytes:
    """Says that this client is still there."""
    return _message(KEEP_ALIVE, b"\0")


def invitation(data: bytes) -> tuple[str, int] | None:
    """Group and port of a server that streams in multicast, from its answer to hello; None for any other datagram."""
    at = _HEAD.size + _VERSIONS + 4
    if len(data) < at + _CONNECTION.size or _HEAD.unpack_from(data)[0] != SERVER_INFO:
        return None
    _, port, in_multicast, group = _CONNECTION.unpack_from(data, at)
    return (socket.inet_ntoa(group), port) if in_multicast and 224 <= group[0] < 240 else None


def marker_id(name: str) -> int | None:
    """The id of "ASSET/NUMBER" (streaming ID of the asset, number of its marker), or of "unlabelled"; else None."""
    if name == UNLABELLED:
        return NO_LABEL
    asset, _, number = name.partition("/")
    if not (asset.isascii() and number.isascii() and asset.isdigit() and number.isdigit()):
        return None
    return (int(asset) << 16) + int(number) if int(asset) < 1 << 16 > int(number) else None


class NatNetDecoder:
    """Decoder of markers "ASSET/NUMBER", or the only "unlabelled" one; main marker first."""

    modulus = 1 << 32

    def __init__(self, names: tuple[str, ...], version: tuple[int, int] | None = None) -> None:
        """version: the server's, until it tells it: of a recording. Raises ValueError for a name that is none."""
        self.names = names
        self._ids: list[int] = []
        for name in names:
            if (known := marker_id(name)) is None:
                raise ValueError(f"{name!r} is neither ASSET/NUMBER, as 1/1, nor {UNLABELLED}")
            self._ids.append(known)
        self._known = version
        self._version = version
        self._others: set[int] = set()
        self._unlabelled = 0

    def receive(self, data: bytes) -> list[Event]:
        """The frame of one datagram; none for what is said beside frames."""
        if len(data) < _HEAD.size:
            return [Malformed(f"NatNet datagram of {len(data)} bytes")]
        what, size = _HEAD.unpack_from(data)
        body = data[_HEAD.size :]
        if size > len(body):
            return [Malformed(f"NatNet: a message of {size} bytes, {len(body)} are there")]
        if what == SERVER_INFO:
            return self._told(body)
        if what != FRAME:
            return []
        if self._version is None:
            return [Malformed("NatNet: a frame before the server has sent its version")]
        if self._version < OLDEST:
            found, oldest = _text(self._version), _text(OLDEST)
            return [Malformed(f"NatNet {found}: this program reads {oldest} (Motive 2.0) and later")]
        try:
            return [self._frame(_Reader(body, sized=self._version >= SIZED))]
        except (struct.error, _DamagedError) as error:
            return [Malformed(f"NatNet frame of {len(body)} bytes: {error}")]

    def restart(self) -> None:
        """A server that has been started again may be another version."""
        self._version = self._known

    @property
    def version(self) -> tuple[int, int] | None:
        """The server's; None before it has told it."""
        return self._version

    def advice(self) -> str:
        """Names the markers that come beside those that are wanted."""
        others = ", ".join(f"{other >> 16}/{other & 0xFFFF}" for other in sorted(self._others)) or "no other"
        return (
            f"Wanted are the markers {', '.join(self.names)} (asset/number); besides, the stream has {others}, "
            f"and {self._unlabelled} unlabelled."
        )

    def _told(self, body: bytes) -> list[Event]:
        if len(body) < _VERSIONS + 2:
            return [Malformed(f"NatNet: the server's description has {len(body)} bytes")]
        self._version = (body[_VERSIONS], body[_VERSIONS + 1])
        return []

    def _frame(self, reader: "_Reader") -> DecodedFrame | Malformed:
        number = reader.u32()
        reader.skip_named_points()
        reader.skip_items(_POINT)
        reader.skip_items(_RIGID_BODY)
        reader.skip_skeletons()
        if reader.sized:
            reader.skip_part()  # assets, which came with the sizes
        seen: list[tuple[int, Position]] = []
        self._unlabelled = 0
        for known, x, y, z, _, flags, _ in reader.labelled():
            if flags & _UNLABELLED:
                known = NO_LABEL
                self._unlabelled += 1
            elif known not in self._ids and len(self._others) < 16:
                self._others.add(known)
            if not flags & _OCCLUDED:
                seen.append((known, (x, y, z)))
        return frame_of(number, self.names, self._ids, seen, alone=NO_LABEL)


class _DamagedError(Exception):
    """Control flow: what is wrong with a frame."""


class _Reader:
    """Reads the parts of a frame in their order. Raises struct.error or _DamagedError past the end."""

    def __init__(self, data: bytes, *, sized: bool) -> None:
        self._data = data
        self._at = 0
        self.sized = sized

    def u32(self) -> int:
        (value,) = _U32.unpack_from(self._data, self._at)
        self._at += _U32.size
        return value

    def _skip(self, count: int) -> None:
        self._at += count
        if self._at > len(self._data):
            raise _DamagedError(f"ends {self._at - len(self._data)} bytes too early")

    def _sized_away(self) -> bool:
        """Skip a part whose size is told; its count has been read."""
        if self.sized:
            self._skip(self.u32())
        return self.sized

    def skip_part(self) -> None:
        """A part that says its size."""
        self.u32()
        self._sized_away()

    def skip_items(self, size: int) -> None:
        """Items of one size."""
        count = self.u32()
        if not self._sized_away():
            self._skip(count * size)

    def skip_named_points(self) -> None:
        """Marker sets: a name and its points."""
        count = self.u32()
        if self._sized_away():
            return
        for _ in range(count):
            end = self._data.find(b"\0", self._at)
            if end < 0:
                raise _DamagedError("the name of a marker set does not end")
            self._at = end + 1
            self.skip_items(_POINT)

    def skip_skeletons(self) -> None:
        """An id and rigid bodies each."""
        count = self.u32()
        if self._sized_away():
            return
        for _ in range(count):
            self.u32()
            self.skip_items(_RIGID_BODY)

    def labelled(self) -> "list[tuple[int, float, float, float, float, int, float]]":
        """id, x, y, z (m), diameter, flags, residual of each."""
        count = self.u32()
        if self.sized:
            self.u32()
        begin = self._at
        self._skip(count * _LABELLED.size)
        return list(_LABELLED.iter_unpack(self._data[begin : self._at]))


def _message(what: int, body: bytes) -> bytes:
    return _HEAD.pack(what, len(body)) + body


def _text(version: tuple[int, int]) -> str:
    return f"{version[0]}.{version[1]}"
