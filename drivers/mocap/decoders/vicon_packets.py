"""Vicon DataStream's packets (TCP, port 801), as the vendor's client (SDK 1.11) reads them. Little endian, packed.

    packet   u32 0x1A2B0001, u32 bytes that follow, blocks
    block    u32 what it is (`PacketBlock`), u32 bytes that follow, body
    body     numbers one after the other; a vector, set, map or text is u32 how many, then its items

`PacketSplitter` makes packets of a byte stream, `Fields` reads a body. Lengths on the wire are mm.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.mocap.decoders.decoder import Malformed

MAGIC = 0x1A2B0001
LONGEST_PACKET = 1 << 24
"""bytes; a video frame may be large, a damaged length is larger"""
_MAGIC_BYTES = MAGIC.to_bytes(4, "little")
_HEADER = struct.Struct("<II")


class PacketBlock(IntEnum):
    """Blocks that are asked for or read."""

    STREAM_INFO = 1
    SUBJECT_INFO = 2
    FRAME_INFO = 5
    LABELLED = 6
    UNLABELLED = 7
    LATENCY = 26
    OBJECT_ENUMS = 100001
    REQUEST_FRAME = 100002
    CONTENTS = 100004


@dataclass(frozen=True, slots=True)
class StreamPacket:
    """The blocks of one packet, in order: what each is, and its body."""

    blocks: tuple[tuple[int, bytes], ...]


def packet(*blocks: tuple[int, bytes]) -> bytes:
    """The bytes of a packet."""
    body = b"".join(_HEADER.pack(kind, len(data)) + data for kind, data in blocks)
    return _HEADER.pack(MAGIC, len(body)) + body


class PacketSplitter:
    """Puts packets together from pieces; after damage it goes on at the next packet's beginning."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._lost = False

    def receive(self, data: bytes) -> list[StreamPacket | Malformed]:
        """The packets that `data` completes, and what was none. Never raises."""
        self._rest += data
        found: list[StreamPacket | Malformed] = []
        while (item := self._next()) is not None:
            found += [item] if item else []
        return found

    def _next(self) -> StreamPacket | Malformed | tuple[()] | None:
        """The next packet; () where something was skipped in silence, None where more bytes are needed."""
        if len(self._rest) < _HEADER.size:
            return None
        magic, length = _HEADER.unpack_from(self._rest)
        if magic != MAGIC or length > LONGEST_PACKET:
            return self._skip(magic, length)
        if len(self._rest) < _HEADER.size + length:
            return None
        body = bytes(self._rest[_HEADER.size : _HEADER.size + length])
        del self._rest[: _HEADER.size + length]
        self._lost = False
        return _split(body)

    def _skip(self, magic: int, length: int) -> Malformed | tuple[()]:
        start = self._rest.find(_MAGIC_BYTES, 1)
        # The beginning of a next one may be the last bytes that are here.
        del self._rest[: start if start > 0 else max(1, len(self._rest) - 3)]
        if self._lost:
            return ()
        self._lost = True
        what = f"length {length}" if magic == MAGIC else f"0x{magic:08X} where 0x{MAGIC:08X} begins a packet"
        return Malformed(f"Vicon DataStream: {what}; is this its port (801)?")


def _split(body: bytes) -> StreamPacket | Malformed:
    blocks: list[tuple[int, bytes]] = []
    at = 0
    while at < len(body):
        if at + _HEADER.size > len(body):
            return Malformed(f"Vicon DataStream: a packet is cut off in the head of block {len(blocks) + 1}")
        kind, size = _HEADER.unpack_from(body, at)
        at += _HEADER.size
        if at + size > len(body):
            return Malformed(f"Vicon DataStream: block {kind} has {size} bytes, its packet {len(body) - at} more")
        blocks.append((kind, body[at : at + size]))
        at += size
    return StreamPacket(tuple(blocks))


class Fields:
    """Reads a block's body from the front. Every method raises struct.error where it ends too early."""

    def __init__(self, body: bytes) -> None:
        self._body = body
        self._at = 0

    def take(self, layout: struct.Struct) -> tuple[float, ...]:
        """The numbers of a layout."""
        values = layout.unpack_from(self._body, self._at)
        self._at += layout.size
        return values

    def count(self, least: int = 1) -> int:
        """How many items follow, each of `least` bytes at least."""
        (number,) = struct.unpack_from("<I", self._body, self._at)
        self._at += 4
        if number * least > len(self._body) - self._at:
            raise struct.error(f"{number} items announced, {len(self._body) - self._at} bytes left")
        return int(number)

    def text(self) -> str:
        """A text with its length."""
        size = self.count()
        self._at += size
        return self._body[self._at - size : self._at].decode("utf-8", "replace")


def enums(body: bytes) -> frozenset[int]:
    """The set of block kinds in an OBJECT_ENUMS block; empty where it is damaged."""
    try:
        fields = Fields(body)
        return frozenset(int(fields.take(_U32)[0]) for _ in range(fields.count(4)))
    except struct.error:
        return frozenset()


_U32 = struct.Struct("<I")
