"""Reading MCAP files, whole ones and what a crash left of one, which is never taken for a whole one.

`read_mcap` streams over the records that are there in full: a file without its end has `complete` False and says why.
Our own and other programs' files are read alike, as long as their messages are protobuf or plain bytes.
"""

import io
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from fidim_lab.data.files.input_file import MIB, read_bytes
from fidim_lab.data.files.mcap_encoder import MAGIC
from fidim_lab.errors import FileError

_RECORD_HEAD = 9
"""bytes: opcode and length"""
LIMIT = 512 * MIB
"""bytes of a file, and of its chunks when unpacked; the packets of a day of one marker at 100 Hz have 0.4 GiB"""
CHUNK_LIMIT = 8 * MIB
"""bytes of one unpacked chunk; recorders make them of 1 MiB"""
SMALLEST_RECORD = 48
"""bytes, on average: a message has 31 beside its values. Files of smaller ones take minutes and GiB for nothing"""


@dataclass(frozen=True, eq=False)
class Logged:
    """One message."""

    topic: str
    schema: str
    """full name; empty for plain bytes"""
    log_time: float
    """s"""
    publish_time: float
    """s"""
    sequence: int
    value: Any
    """a protobuf message, or bytes where the channel has no schema"""


@dataclass(frozen=True, eq=False)
class McapContents:
    """All that could be read of a file."""

    path: Path
    messages: tuple[Logged, ...]
    metadata: Mapping[str, Mapping[str, str]]
    channels: Mapping[str, Mapping[str, str]]
    """metadata of each topic"""
    complete: bool
    problem: str
    """why it is not complete, for a person; empty where it is"""

    def of(self, topic: str) -> tuple[Logged, ...]:
        """The messages of one topic, in file order."""
        return tuple(message for message in self.messages if message.topic == topic)


Decode = Callable[[Channel, Schema | None, bytes], Any]
"""a message's value; raises what it will for a damaged one"""


def read_mcap(path: Path, limit: int = LIMIT, decode: Decode | None = None) -> McapContents:
    """Everything in the file, of at most `limit` bytes packed and unpacked.

    decode: what makes a value of a message's bytes; without one protobuf is decoded, and plain bytes are left.

    Raises FileError where it cannot be read, is no MCAP file, larger, or damaged before its end.

    A file that just stops (killed process, power cut) is read up to its last whole record, and is not `complete`.
    """
    data = read_bytes(path, limit)
    if not data.startswith(MAGIC[: len(data)]):
        raise FileError(path, "", "is not an MCAP file.")
    end, finished = _whole_records(data)
    reader = _Reader(path, decode)
    problem = "" if finished else f"{path.name} stops after {end} bytes without an end: it was cut off while written"
    try:
        for record in _records(data[:end] + MAGIC * finished, limit):
            reader.take(record)
    except FileError:
        raise
    except Exception as error:  # mcap, zstandard, lz4 and protobuf each have errors of their own
        if finished:
            what = f"is damaged ({type(error).__name__}: {error})."
            raise FileError(path, "", what, hint="Restore it from a backup.") from None
        problem += f", and what was written last is damaged ({type(error).__name__})"
    return McapContents(path, tuple(reader.messages), reader.metadata, reader.channels, finished, problem)


def _whole_records(data: bytes) -> tuple[int, bool]:
    """Where the last whole record ends, and whether the file has its end."""
    offset = len(MAGIC)
    while offset + _RECORD_HEAD <= len(data):
        opcode = data[offset]
        length = int.from_bytes(data[offset + 1 : offset + _RECORD_HEAD], "little")
        if opcode == 0 or offset + _RECORD_HEAD + length > len(data):
            break
        offset += _RECORD_HEAD + length
        if opcode == Opcode.FOOTER:
            return offset, data[offset:] == MAGIC
    return min(offset, len(data)), False


def _records(data: bytes, limit: int) -> Iterator[McapRecord]:
    """Records of a file that may lack its end, chunks unpacked. Raises what `mcap` raises for damaged ones."""
    stream = io.BytesIO(data)
    records = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=limit).records
    unpacked = 0
    while True:
        try:
            record = next(records)
        except (StopIteration, EndOfFile):
            if stream.tell() < len(data):
                raise McapError("a record is shorter than it says") from None
            return
        if isinstance(record, Chunk):
            plain = _unpacked(record)
            unpacked += plain.uncompressed_size
            if unpacked > limit:
                raise McapError(f"its chunks unpack to more than {limit / MIB:g} MiB")
            if plain.uncompressed_crc not in (0, zlib.crc32(plain.data)):
                raise McapError("a chunk's checksum is wrong")
            yield from _inside(plain.data)
        else:
            yield record


def _inside(data: bytes) -> Iterator[McapRecord]:
    """The records of an unpacked chunk that we know."""
    stream = ReadDataStream(io.BytesIO(data))
    records = 0
    while stream.count < len(data):
        records += 1
        if records > 1000 + len(data) // SMALLEST_RECORD:
            raise McapError(f"the records of a chunk have fewer than {SMALLEST_RECORD} bytes")
        opcode, length = stream.read1(), stream.read8()
        match opcode:
            case Opcode.CHANNEL:
                yield Channel.read(stream)
            case Opcode.MESSAGE:
                yield Message.read(stream, length)
            case Opcode.SCHEMA:
                yield Schema.read(stream)
            case _:
                stream.read(length)


def _unpacked(chunk: Chunk) -> Chunk:
    """The chunk without its compression; at most what it says and what is allowed is ever unpacked."""
    size = chunk.uncompressed_size
    if size > CHUNK_LIMIT:
        raise McapError(f"a chunk unpacks to {size / MIB:.0f} MiB; at most {CHUNK_LIMIT / MIB:g} MiB are read")
    match chunk.compression:
        case "zstd":
            with zstandard.ZstdDecompressor(max_window_size=2 * CHUNK_LIMIT).stream_reader(chunk.data) as packed:
                data = _exactly(packed.read, size)
        case "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case "":
            data = chunk.data
        case other:
            raise McapError(f"a chunk is compressed by {other[:20]!r}; zstd and lz4 are read")
    if len(data) != size:
        raise McapError(f"a chunk does not unpack to the {size} bytes that it says")
    return replace(chunk, compression="", data=data)


def _exactly(read: Callable[[int], bytes], size: int) -> bytes:
    """Up to one byte more than that, so that what is too long shows."""
    parts: list[bytes] = []
    left = size + 1
    while left and (part := read(left)):
        parts.append(part)
        left -= len(part)
    return b"".join(parts)


class _Reader:
    """Puts schemas, channels and messages together."""

    def __init__(self, path: Path, decode: Decode | None) -> None:
        self.messages: list[Logged] = []
        self.metadata: dict[str, Mapping[str, str]] = {}
        self.channels: dict[str, Mapping[str, str]] = {}
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._known: dict[int, Channel] = {}
        self._factory = DecoderFactory()
        self._decode = decode or self._protobuf

    def take(self, record: McapRecord) -> None:
        """Account for one record."""
        match record:
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._known[record.id] = record
                self.channels[record.topic] = record.metadata
            case Metadata():
                self.metadata[record.name] = record.metadata
            case Message():
                self.messages.append(self._logged(record))
            case _:
                pass

    def _logged(self, message: Message) -> Logged:
        channel = self._known[message.channel_id]
        schema = self._schemas.get(channel.schema_id)
        return Logged(
            topic=channel.topic,
            schema="" if schema is None else schema.name,
            log_time=message.log_time * 1e-9,
            publish_time=message.publish_time * 1e-9,
            sequence=message.sequence,
            value=self._decode(channel, schema, message.data),
        )

    def _protobuf(self, channel: Channel, schema: Schema | None, data: bytes) -> Any:
        if schema is None:
            return data
        decode = self._factory.decoder_for(channel.message_encoding, schema)
        if decode is None:
            what = f"is encoded as {channel.message_encoding!r}; protobuf is read here."
            raise FileError(self._path, f"topic {channel.topic}", what)
        return decode(data)
