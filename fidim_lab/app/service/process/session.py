"""One client's conversation without I/O: hello first, then commands.

`add` takes bytes, `next` gives what the client asks for, one thing at a time. `Lease` says who may command.
"""

import hmac
from enum import Enum

from fidim_lab.app.service.codec import LineDecoder, MalformedLine
from fidim_lab.app.service.commands import PROTOCOL, TO_SERVICE, Hello, Request
from fidim_lab.app.service.messages import Refusal


class ConversationStage(Enum):
    """Where the conversation is."""

    EXPECTS_HELLO = "expects hello"
    TALKING = "talking"
    CLOSED = "closed"


class ServerSession:
    """The service's side of one connection."""

    def __init__(self, number: int, token: str = "") -> None:
        self.number = number
        self.stage = ConversationStage.EXPECTS_HELLO
        self.hello = Hello()
        self._token = token
        self._decoder = LineDecoder(TO_SERVICE)

    @property
    def name(self) -> str:
        """For journals and other clients' screens."""
        return f"{self.hello.client or 'client'} #{self.number}"

    def add(self, data: bytes) -> None:
        """Take bytes."""
        self._decoder.add(data)

    def next(self) -> Hello | Request | Refusal | None:
        """What the client says next: an accepted `Hello` once, then `Request`s; None until there is more.

        A `Refusal` is to be sent; the conversation is then closed.
        """
        message = None if self.stage is ConversationStage.CLOSED else self._decoder.next()
        if message is None:
            return None
        taken = self._take(message)
        if isinstance(taken, Refusal):
            self.stage = ConversationStage.CLOSED
        return taken

    @property
    def waits(self) -> bool:
        """Whether something that was said has not been taken yet."""
        return self.stage is not ConversationStage.CLOSED and self._decoder.waits

    def _take(self, message: Hello | Request | MalformedLine) -> Hello | Request | Refusal:
        match message:
            case MalformedLine(says):
                return Refusal(says=f"This is not a message of {PROTOCOL}: {says}")
            case Hello() if self.stage is ConversationStage.EXPECTS_HELLO:
                return self._greet(message)
            case Hello():
                return Refusal(says="hello was sent twice.")
            case Request() if self.stage is ConversationStage.TALKING:
                return message
            case _:
                return Refusal(says="The first message must be hello.")

    def _greet(self, hello: Hello) -> Hello | Refusal:
        if hello.protocol != PROTOCOL:
            return Refusal(says=f"The service uses the protocol {PROTOCOL}, the client {hello.protocol}.")
        if self._token and not hmac.compare_digest(self._token.encode(), hello.token.encode()):
            return Refusal(says="The token is wrong: it is in the file that the service named when it started.")
        self.hello, self.stage = hello, ConversationStage.TALKING
        return hello


class Lease:
    """Many may watch, one may command. Held by a client's number until it releases, leaves, or is overruled."""

    def __init__(self) -> None:
        self.holder: int | None = None
        self.name = ""
        """of the client that has it"""

    def take(self, client: int, name: str = "", *, force: bool = False) -> bool:
        """Whether the client has it now."""
        if self.holder is None or force:
            self.holder, self.name = client, name
        return self.holder == client

    def release(self, client: int) -> None:
        """No effect for a client that does not have it."""
        if self.holder == client:
            self.holder, self.name = None, ""
