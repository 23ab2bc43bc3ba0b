"""Writing MCAP without I/O: messages in, bytes out, in chunks that are closed whenever somebody wants them on the disk.

The `mcap` library's own writer keeps a chunk in memory until it is full, so that a killed process loses all of it (here
seconds of a window); `McapEncoder.flush` closes the chunk as it is. The records themselves are the library's, and the
same messages give the same bytes. `mcap_file` reads, `mcap_schemas` has the messages.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
CHUNK_SIZE = 64 * 1024
"""bytes, before compression, at which a chunk is closed by itself"""
PACKED_BLOCK = 16 * 1024
"""bytes of the index that are compressed together"""
LIBRARY = "fidim-lab"
COMPRESSION = "zstd"


def nanoseconds(t: float) -> int:
    """Seconds of the host's monotonic clock as MCAP has times."""
    return max(0, round(t * 1e9))


@dataclass(frozen=True)
class MessageSchema:
    """What a channel's messages are."""

    name: str
    encoding: str
    data: bytes


class _OpenChunk:
    """Messages that wait for their chunk to be closed."""

    def __init__(self) -> None:
        self.records = RecordBuilder()
        self.indexes: dict[int, MessageIndex] = {}
        self.start = 0
        self.end = 0

    def add(self, message: Message) -> None:
        """Append one message."""
        self.start = min(self.start, message.log_time) if self.indexes else message.log_time
        self.end = max(self.end, message.log_time)
        index = self.indexes.setdefault(message.channel_id, MessageIndex(channel_id=message.channel_id, records=[]))
        index.records.append((message.log_time, self.records.count))
        message.write(self.records)


class _Packed:
    """Bytes that grow all day and are read once: an index of ten records a second, kept at a fifth of its size."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._open = bytearray()

    def add(self, data: bytes) -> None:
        """Append."""
        self._open += data
        if len(self._open) >= PACKED_BLOCK:
            packed = zstandard.compress(bytes(self._open))
            self._blocks.append(bytes(memoryview(packed)))  # a copy: what the library returns keeps its working space
            self._open = bytearray()

    def whole(self) -> bytes:
        """All of them."""
        return b"".join([*(zstandard.decompress(block) for block in self._blocks), self._open])


class McapEncoder:
    """One MCAP file as bytes. Register channels, `add` messages, `flush` now and then, `finish` once."""

    def __init__(self, *, profile: str = "") -> None:
        self._out = RecordBuilder()
        self._out.write(MAGIC)
        self._passed_on = 0
        """bytes handed out so far"""
        self._crc = 0
        """of them"""
        self._chunk = _OpenChunk()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk_index = _Packed()
        """its records as they will be written"""
        self._chunk_count = 0
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._start: int | None = None
        self._end = 0
        Header(profile=profile, library=LIBRARY).write(self._out)

    def add_channel(
        self, topic: str, schema: MessageSchema | None, encoding: str, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Register a channel (schema None: bytes without one); returns its id."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            metadata=dict(metadata or {}),
            schema_id=0 if schema is None else self._schema_id(schema),
        )
        self._channels.append(channel)
        channel.write(self._out)
        return channel.id

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a named table of texts, in its place in the file."""
        offset = self._offset
        Metadata(name=name, metadata=dict(values)).write(self._out)
        self._metadata.append(MetadataIndex(offset=offset, length=self._offset - offset, name=name))

    def add(self, channel: int, log_time: int, data: bytes, publish_time: int | None = None) -> None:
        """Append a message; log_time (ns) when it was recorded, publish_time (ns) when it was true."""
        count = self._counts.get(channel, 0)
        self._counts[channel] = count + 1
        self._start = log_time if self._start is None else min(self._start, log_time)
        self._end = max(self._end, log_time)
        published = log_time if publish_time is None else publish_time
        self._chunk.add(Message(channel, log_time, data, published, sequence=count))
        if self._chunk.records.count >= CHUNK_SIZE:
            self._close_chunk()

    def flush(self) -> bytes:
        """Close the open chunk; all bytes since the last call, to be written to the disk."""
        self._close_chunk()
        return self._pass_on()

    def finish(self) -> bytes:
        """The last bytes, with the index and the summary; nothing may be added afterwards."""
        block = self.flush()
        DataEnd(self._crc).write(self._out)
        start = self._offset
        summary = RecordBuilder()
        offsets = [self._group(summary, start, opcode, records) for opcode, records in self._summary() if records]
        offsets_start = start + summary.count
        for offset in offsets:
            offset.write(summary)
        Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=0).write(summary)
        data = summary.end()
        crc = zlib.crc32(data[:-4])  # over the summary and the footer up to its checksum
        self._out.write(data[:-4] + crc.to_bytes(4, "little") + MAGIC)
        return block + self._pass_on()

    def _pass_on(self) -> bytes:
        block = self._out.end()
        self._passed_on += len(block)
        self._crc = zlib.crc32(block, self._crc)
        return block

    @property
    def _offset(self) -> int:
        return self._passed_on + self._out.count

    def _schema_id(self, schema: MessageSchema) -> int:
        for known in self._schemas:
            if known.name == schema.name:
                return known.id
        made = Schema(id=len(self._schemas) + 1, name=schema.name, encoding=schema.encoding, data=schema.data)
        self._schemas.append(made)
        made.write(self._out)
        return made.id

    def _close_chunk(self) -> None:
        chunk = self._chunk
        if not chunk.indexes:
            return
        self._chunk = _OpenChunk()
        data = chunk.records.end()
        packed = zstandard.compress(data)
        offset = self._offset
        Chunk(COMPRESSION, packed, chunk.end, chunk.start, zlib.crc32(data), len(data)).write(self._out)
        end = self._offset
        places: dict[int, int] = {}
        for channel, index in chunk.indexes.items():
            places[channel] = self._offset
            index.write(self._out)
        index_record = RecordBuilder()
        ChunkIndex(
            chunk_length=end - offset,
            chunk_start_offset=offset,
            compression=COMPRESSION,
            compressed_size=len(packed),
            message_end_time=chunk.end,
            message_index_length=self._offset - end,
            message_index_offsets=places,
            message_start_time=chunk.start,
            uncompressed_size=len(data),
        ).write(index_record)
        self._chunk_index.add(index_record.end())
        self._chunk_count += 1

    def _summary(self) -> tuple[tuple[Opcode, bytes], ...]:
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._start or 0,
            message_end_time=self._end,
            schema_count=len(self._schemas),
        )
        return (
            (Opcode.SCHEMA, _written(self._schemas)),
            (Opcode.CHANNEL, _written(self._channels)),
            (Opcode.STATISTICS, _written([statistics])),
            (Opcode.CHUNK_INDEX, self._chunk_index.whole()),
            (Opcode.METADATA_INDEX, _written(self._metadata)),
        )

    @staticmethod
    def _group(summary: RecordBuilder, start: int, opcode: Opcode, records: bytes) -> SummaryOffset:
        begin = summary.count
        summary.write(records)
        return SummaryOffset(group_opcode=opcode, group_start=start + begin, group_length=summary.count - begin)


def _written(records: Sequence[McapRecord]) -> bytes:
    written = RecordBuilder()
    for record in records:
        record.write(written)
    return written.end()
