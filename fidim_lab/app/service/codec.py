"""Bytes to messages and back, without I/O: lines of JSON, in any pieces, with a limit on what a line may be.

`LineDecoder` takes bytes as they come and gives whole messages; what is no message is a `MalformedLine`, which ends it.
"""

from dataclasses import dataclass
from typing import Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from fidim_lab.app.service.commands import Message
from fidim_lab.data.files.mistakes import mistakes
from fidim_lab.say import printable

LINE_LIMIT = 1 << 15
"""bytes: a command with the longest reason, every character of it escaped, and no more"""

M = TypeVar("M")


@dataclass(frozen=True)
class MalformedLine:
    """A line that is no message of this protocol."""

    says: str


def encode(message: Message) -> bytes:
    """One line."""
    return message.model_dump_json().encode() + b"\n"


class LineDecoder(Generic[M]):
    """One direction of one connection. After a `MalformedLine` it takes nothing more."""

    def __init__(self, adapter: TypeAdapter[M], limit: int = LINE_LIMIT) -> None:
        self._adapter = adapter
        self._limit = limit
        self._rest = bytearray()
        self._broken = False

    def receive(self, data: bytes) -> list[M | MalformedLine]:
        """The messages that are whole now, in order."""
        self.add(data)
        return list(iter(self.next, None))

    def add(self, data: bytes) -> None:
        """Take bytes; `next` makes messages of them."""
        if not self._broken:
            self._rest += data

    def next(self) -> M | MalformedLine | None:
        """The next message; None until another one is whole."""
        if self._broken:
            return None
        end = self._rest.find(b"\n", 0, self._limit + 1)
        if end < 0:
            return self._break(f"a line of more than {self._limit} bytes") if len(self._rest) > self._limit else None
        line = bytes(self._rest[:end])
        del self._rest[: end + 1]
        return self._message(line)

    @property
    def waits(self) -> bool:
        """Whether a line, or what is too long for one, has not been taken yet."""
        return not self._broken and (b"\n" in self._rest or len(self._rest) > self._limit)

    def _message(self, line: bytes) -> M | MalformedLine:
        try:
            return self._adapter.validate_json(line)
        except ValidationError as error:
            return self._break("; ".join(_sentence(place, says) for place, says, _ in mistakes(error.errors())[:3]))

    def _break(self, says: str) -> MalformedLine:
        self._broken = True
        self._rest.clear()
        return MalformedLine(printable(says))


def _sentence(place: tuple[int | str, ...], problem: str) -> str:
    where = ".".join(str(part) for part in place)
    return f"{where}: {problem}" if where else problem
