"""Reading MCAP files, whole ones and what a crash left of one, which is never taken for a whole one.

`read_mcap` streams over the records that are there in full: a file without its end has `complete` False and says why.
Our own and other programs' files are read alike, as long as their messages are protobuf or plain bytes.
"""

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from fidim_lab.data.mcap_encoder import MAGIC
from fidim_lab.errors import FileError

_RECORD_HEAD = 9
"""bytes: opcode and length"""
_LARGEST = 1 << 30
"""bytes of one record; a longer one is a damaged length"""


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


def read_mcap(path: Path) -> McapContents:
    """Everything in the file. Raises FileError where it cannot be read, is no MCAP file, or is damaged before its end.

    A file that just stops (killed process, power cut) is read up to its last whole record, and is not `complete`.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(path, "", f"cannot be read: {error.strerror or error}.") from None
    if not data.startswith(MAGIC[: len(data)]):
        raise FileError(path, "", "is not an MCAP file.")
    end, finished = _whole_records(data)
    reader = _Reader(path)
    problem = "" if finished else f"{path.name} stops after {end} bytes without an end: it was cut off while written"
    try:
        for record in _records(data[:end] + MAGIC * finished):
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
        if opcode == 0 or length > _LARGEST or offset + _RECORD_HEAD + length > len(data):
            break
        offset += _RECORD_HEAD + length
        if opcode == Opcode.FOOTER:
            return offset, data[offset:] == MAGIC
    return min(offset, len(data)), False


def _records(data: bytes) -> Iterator[McapRecord]:
    """Records of a file that may lack its end. Raises what `mcap` raises for damaged ones."""
    stream = io.BytesIO(data)
    records = StreamReader(stream, validate_crcs=True, record_size_limit=_LARGEST).records
    while True:
        try:
            record = next(records)
        except (StopIteration, EndOfFile):
            if stream.tell() < len(data):
                raise McapError("a record is shorter than it says") from None
            return
        yield record


class _Reader:
    """Puts schemas, channels and messages together."""

    def __init__(self, path: Path) -> None:
        self.messages: list[Logged] = []
        self.metadata: dict[str, Mapping[str, str]] = {}
        self.channels: dict[str, Mapping[str, str]] = {}
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._known: dict[int, Channel] = {}
        self._factory = DecoderFactory()

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
        value: Any = message.data
        if schema is not None:
            decode = self._factory.decoder_for(channel.message_encoding, schema)
            if decode is None:
                what = f"is encoded as {channel.message_encoding!r}; protobuf is read here."
                raise FileError(self._path, f"topic {channel.topic}", what)
            value = decode(message.data)
        return Logged(
            topic=channel.topic,
            schema="" if schema is None else schema.name,
            log_time=message.log_time * 1e-9,
            publish_time=message.publish_time * 1e-9,
            sequence=message.sequence,
            value=value,
        )
